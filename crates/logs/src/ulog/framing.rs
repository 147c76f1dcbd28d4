//! Framing of ULog records: is what lies at a place a record, and how sure is that?

use super::entry::{is_entry, is_line, is_parameter};
use super::message_format::{is_definition, is_message_name};

/// Magic payload of synchronisation records.
pub const SYNC: [u8; 8] = [0x2f, 0x73, 0x13, 0x20, 0x25, 0x0c, 0xbb, 0x12];
/// Length and type in front of every payload.
pub const HEAD: usize = 3;
/// Records that may follow each other without one that can be vouched for.
const DOUBTFUL_CHAIN: usize = 32;

/// Bytes of a line of text that a search looks at.
const LINE_START: usize = 64;

/// Why bytes were not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// No record starts here.
    Unreadable,
    /// A sample of a message number that was never announced.
    UnknownId,
    /// A sample whose length does not fit its definition.
    WrongSize,
    /// An announcement of a message whose definition is missing or has no size.
    UnknownFormat,
    /// A record type that this reader does not know.
    UnknownType,
    /// A record whose framing holds but whose content does not.
    Malformed,
    /// A sample in front of unreadable bytes: its end may be overwritten.
    Suspect,
    /// The file ends inside a record.
    Truncated,
    /// A record is cut where data was appended after a crash.
    CutByAppended,
}

impl Reason {
    /// Plain words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Unreadable => "no record starts here",
            Self::UnknownId => "samples of a message that was never announced",
            Self::WrongSize => "a sample whose length does not fit its definition",
            Self::UnknownFormat => "an announced message has no usable definition",
            Self::UnknownType => "a record type that is not known",
            Self::Malformed => "a record whose content is malformed",
            Self::Suspect => "a sample in front of unreadable bytes, its end may be overwritten",
            Self::Truncated => "the file ends inside a record",
            Self::CutByAppended => "a record is cut where crash data was appended",
        }
    }
}

/// How far a record can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Worth {
    /// Random bytes do not look like this: a sample of known number and length, a magic.
    Certain,
    /// Well formed, but short enough that chance could make it.
    Valid,
    /// Only the framing can be right; its content is of no use.
    Doubtful(Reason),
    /// Well formed as far as it goes; it runs past the end.
    Cut,
    /// Not a record.
    Broken,
}

/// What the framing needs to know of the log so far.
pub trait Known {
    /// Payload lengths (least, most) of a sample with this number; none where it is not announced.
    fn sizes(&self, id: u16) -> Option<(usize, usize)>;
    /// Whether a definition of this name was read.
    fn defines(&self, name: &[u8]) -> bool;
}

/// A record as found: judgement, type, and where payload and record end.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// How far to trust it.
    pub worth: Worth,
    /// Type letter.
    pub kind: u8,
    /// First byte after the record.
    pub stop: usize,
}

const BROKEN: Found = Found { worth: Worth::Broken, kind: 0, stop: 0 };

/// Judge what lies at `at`. `strict` is for the search after damage, where chance gets many tries.
pub fn judge(bytes: &[u8], at: usize, known: &impl Known, strict: bool) -> Found {
    let Some(&[low, high, kind]) = bytes.get(at..at + HEAD) else {
        let cut = at < bytes.len();
        return Found { worth: if cut { Worth::Cut } else { Worth::Broken }, ..BROKEN };
    };
    let length = usize::from(u16::from_le_bytes([low, high]));
    let stop = at + HEAD + length;
    let worth = match bytes.get(at + HEAD..stop) {
        Some(payload) => judge_payload(kind, payload, known, strict),
        None => judge_cut(kind, length, &bytes[at + HEAD..], known),
    };
    Found { worth, kind, stop }
}

fn judge_payload(kind: u8, payload: &[u8], known: &impl Known, strict: bool) -> Worth {
    let valid = |good: bool| {
        if good {
            Worth::Valid
        } else if strict {
            Worth::Broken
        } else {
            Worth::Doubtful(Reason::Malformed)
        }
    };
    match kind {
        b'D' => judge_sample(payload, known),
        b'S' if payload == SYNC => Worth::Certain,
        b'A' => match payload.get(3..) {
            Some(name) if known.defines(name) => Worth::Certain,
            Some(name) if is_message_name(name) => Worth::Doubtful(Reason::UnknownFormat),
            _ => Worth::Broken,
        },
        b'F' if is_definition(payload) => Worth::Certain,
        b'I' => valid(is_entry(payload)),
        b'P' => valid(is_parameter(payload)),
        b'M' => valid(payload.get(1..).is_some_and(is_entry)),
        b'Q' => valid(payload.get(1..).is_some_and(is_parameter)),
        b'L' | b'C' => {
            valid(is_line(payload, kind == b'C', if strict { LINE_START } else { usize::MAX }))
        }
        b'O' => valid(payload.len() == 2),
        b'R' => match payload {
            &[low, high] => valid(known.sizes(u16::from_le_bytes([low, high])).is_some()),
            _ => valid(false),
        },
        b'S' | b'F' | b'B' => valid(false),
        0 => Worth::Broken,
        _ if strict || payload.is_empty() => Worth::Broken,
        _ => Worth::Doubtful(Reason::UnknownType),
    }
}

fn judge_sample(payload: &[u8], known: &impl Known) -> Worth {
    let Some((id, sample)) = payload.split_first_chunk::<2>() else {
        return Worth::Broken;
    };
    match known.sizes(u16::from_le_bytes(*id)) {
        Some((least, most)) if (least..=most).contains(&sample.len()) => Worth::Certain,
        Some(_) => Worth::Doubtful(Reason::WrongSize),
        None => Worth::Doubtful(Reason::UnknownId),
    }
}

/// A record that runs past the end: cut off, or a damaged length?
fn judge_cut(kind: u8, length: usize, payload: &[u8], known: &impl Known) -> Worth {
    let plausible = match kind {
        b'D' => match payload.split_first_chunk::<2>() {
            Some((id, _)) => known
                .sizes(u16::from_le_bytes(*id))
                .is_some_and(|(least, most)| (least..=most).contains(&(length - 2))),
            None => length >= 2,
        },
        b'S' => length == SYNC.len(),
        b'O' | b'R' => length == 2,
        b'A' | b'B' | b'C' | b'F' | b'I' | b'L' | b'M' | b'P' | b'Q' => true,
        _ => false,
    };
    if plausible { Worth::Cut } else { Worth::Broken }
}

/// Tell whether what lies at `at` carries on a chain of records: one that can be trusted, perhaps
/// behind doubtful ones, or the end.
pub fn carries_on(bytes: &[u8], mut at: usize, known: &impl Known) -> bool {
    for _ in 0..DOUBTFUL_CHAIN {
        if at == bytes.len() {
            return true;
        }
        let found = judge(bytes, at, known, true);
        match found.worth {
            Worth::Certain | Worth::Valid | Worth::Cut => return true,
            Worth::Doubtful(_) => at = found.stop,
            Worth::Broken => return false,
        }
    }
    false
}

/// First place at or after `from` where records start again; the end where there is none.
pub fn next_record(bytes: &[u8], from: usize, known: &impl Known) -> usize {
    (from..bytes.len())
        .find(|&at| {
            let found = judge(bytes, at, known, true);
            match found.worth {
                Worth::Certain => true,
                Worth::Valid => {
                    found.stop == bytes.len()
                        || matches!(
                            judge(bytes, found.stop, known, true).worth,
                            Worth::Certain | Worth::Valid
                        )
                }
                _ => false,
            }
        })
        .unwrap_or(bytes.len())
}

/// First record that starts in `from..stop`, ends behind `stop` and is followed by another: where
/// it is there, what was read up to `stop` had a damaged length and bit into it.
pub fn record_across(bytes: &[u8], from: usize, stop: usize, known: &impl Known) -> Option<usize> {
    (from..stop).find(|&at| {
        let found = judge(bytes, at, known, true);
        found.stop > stop
            && matches!(found.worth, Worth::Certain | Worth::Valid)
            && carries_on(bytes, found.stop, known)
    })
}

/// Tell whether the bytes of a gap look like one record of which only the head was damaged.
pub fn is_one_damaged_record(gap: &[u8], known: &impl Known) -> bool {
    let Some((&[low, high, kind], payload)) = gap.split_first_chunk::<HEAD>() else {
        return false;
    };
    let same_length = usize::from(u16::from_le_bytes([low, high])) == payload.len();
    let fits = payload.split_first_chunk::<2>().is_some_and(|(id, rest)| {
        known
            .sizes(u16::from_le_bytes(*id))
            .is_some_and(|(least, most)| (least..=most).contains(&rest.len()))
    });
    let named = kind.is_ascii_uppercase();
    usize::from(same_length) + usize::from(fits) + usize::from(named) >= 2
}
