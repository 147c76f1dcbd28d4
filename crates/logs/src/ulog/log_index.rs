//! A ULog as an index of its records: definitions, samples, entries, and what could not be read.

use std::collections::HashMap;

use super::entry::{self, Entry, Line};
use super::framing::{
    Found, Known, Reason, Worth, carries_on, is_one_damaged_record, judge, next_record,
    record_across,
};
use super::message_format::{Formats, Shape, is_message_name};
use crate::error::LogError;
use crate::places::Places;

const MAGIC: [u8; 7] = [0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35];
const HEADER: usize = 16;
/// Length of the payload of a flag record: compatible, incompatible flags, three offsets.
const FLAGS: usize = 40;
const NO_TABLE: u32 = u32::MAX;

/// Bytes that were not read, `start..stop`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skipped {
    /// First byte.
    pub start: usize,
    /// First byte after.
    pub stop: usize,
    /// Why.
    pub reason: Reason,
}

/// All samples of one instance of one message.
#[derive(Debug, Clone)]
pub struct Table {
    /// Name of the message.
    pub name: Box<str>,
    /// Instance (0 for the first sensor of a kind).
    pub instance: u8,
    /// Place of each sample's payload in the file, message number excluded.
    pub offsets: Places,
    pub(crate) shape: Shape,
}

/// Something that happened at a time of the boot clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Stamped<T> {
    /// Microseconds of the boot clock: the last sample's stamp before it.
    pub stamp_us: u64,
    /// What happened.
    pub item: T,
}

/// Index of a log: what it holds and where.
#[derive(Debug, Clone, Default)]
pub struct Ulog {
    /// Version byte of the header.
    pub version: u8,
    /// Microseconds of the boot clock when logging started.
    pub start_us: u64,
    /// Definitions of the messages.
    pub formats: Formats,
    /// Samples by message and instance, in order of announcement.
    pub tables: Vec<Table>,
    /// Information entries, in order.
    pub infos: Vec<Entry>,
    /// Parts of multiple-information entries with "continues the one before".
    pub multi_infos: Vec<(bool, Entry)>,
    /// Parameters when logging started.
    pub parameters: Vec<Entry>,
    /// Default values, with the bits that say whose default (1 system, 2 this airframe).
    pub defaults: Vec<(u8, Entry)>,
    /// Parameters set while logging.
    pub changes: Vec<Stamped<Entry>>,
    /// Lines of text, plain and tagged.
    pub lines: Vec<Line>,
    /// Times during which the logger lost samples, ms.
    pub dropouts: Vec<Stamped<u16>>,
    /// Number of synchronisation records.
    pub syncs: u64,
    /// Where crash data was appended.
    pub appended: Vec<usize>,
    /// Bytes that were not read.
    pub skipped: Vec<Skipped>,
    by_id: Vec<u32>,
    by_key: HashMap<(Box<str>, u8), u32>,
    shapes: HashMap<Box<str>, Option<Shape>>,
    in_data: bool,
    last_us: u64,
    last_sample: Option<(u32, usize, usize)>,
}

impl Known for Ulog {
    fn sizes(&self, id: u16) -> Option<(usize, usize)> {
        let table = *self.by_id.get(usize::from(id))?;
        let shape = self.tables.get(table as usize)?.shape;
        Some((shape.least, shape.most))
    }

    fn defines(&self, name: &[u8]) -> bool {
        is_message_name(name)
            && std::str::from_utf8(name).is_ok_and(|name| self.formats.contains(name))
    }
}

impl Ulog {
    /// Walk through a log once.
    pub fn index(bytes: &[u8]) -> Result<Self, LogError> {
        let head = bytes.get(..HEADER).filter(|head| head.starts_with(&MAGIC));
        let Some((_, [version, stamp @ ..])) = head.and_then(|head| head.split_at_checked(7))
        else {
            return Err(LogError::NotALog {
                expected: "PX4 ULog",
                found: format!("first bytes {:02x?}", &bytes[..bytes.len().min(7)]),
            });
        };
        let mut log = Self {
            version: *version,
            start_us: little_endian(stamp),
            last_us: little_endian(stamp),
            ..Self::default()
        };
        let mut start = log.read_flags(bytes)?;
        for stop in log.appended.clone() {
            log.walk(&bytes[..stop], start, Reason::CutByAppended);
            start = stop;
        }
        log.walk(bytes, start, Reason::Truncated);
        Ok(log)
    }

    /// The flag record comes first or not at all; returns where the records after it start. Flags
    /// that change the format end the reading.
    fn read_flags(&mut self, bytes: &[u8]) -> Result<usize, LogError> {
        let Some(([low, high, b'B'], rest)) = bytes[HEADER..].split_first_chunk::<3>() else {
            return Ok(HEADER);
        };
        let length = usize::from(u16::from_le_bytes([*low, *high]));
        let Some(flags) = rest.get(..length).filter(|flags| flags.len() >= FLAGS) else {
            return Ok(HEADER);
        };
        let incompatible = little_endian(&flags[8..16]);
        if incompatible & !1 != 0 {
            return Err(LogError::Unsupported {
                what: format!("ULog with incompatible flags {incompatible:#x}"),
            });
        }
        if incompatible & 1 == 1 {
            for place in flags[16..FLAGS].chunks_exact(8).map(little_endian) {
                let after = self.appended.last().copied().unwrap_or(HEADER);
                match usize::try_from(place) {
                    Ok(place) if place > after && place <= bytes.len() => self.appended.push(place),
                    _ => {}
                }
            }
        }
        Ok(HEADER + 3 + length)
    }

    fn walk(&mut self, bytes: &[u8], start: usize, at_end: Reason) {
        let mut at = start;
        while at < bytes.len() {
            let found = judge(bytes, at, self, false);
            if matches!(found.worth, Worth::Certain | Worth::Valid) {
                self.accept(bytes, at, found.kind, found.stop);
                at = found.stop;
            } else if let Some(inside) = self.take_back(bytes, at) {
                at = inside;
            } else {
                at = self.pass(bytes, at, found, at_end);
            }
        }
    }

    /// Take back the sample before `at` where it bit into the next record: a damaged length can
    /// still fit the definition, by the padding that may be left out. Returns where that record
    /// starts.
    fn take_back(&mut self, bytes: &[u8], at: usize) -> Option<usize> {
        let (table, start, stop) = self.last_sample.filter(|&(_, _, stop)| stop == at)?;
        let inside = record_across(bytes, start + 1, stop, self)?;
        self.tables.get_mut(table as usize)?.offsets.pop();
        self.last_sample = None;
        self.skip(start, inside, Reason::Unreadable);
        Some(inside)
    }

    /// Step over a record that cannot be vouched for, or over the damage; returns where to go on.
    fn pass(&mut self, bytes: &[u8], at: usize, found: Found, at_end: Reason) -> usize {
        match found.worth {
            Worth::Doubtful(reason) if self.frames(bytes, at, found.stop) => {
                if matches!(found.kind, b'C' | b'L') {
                    self.accept(bytes, at, found.kind, found.stop);
                } else {
                    self.skip(at, found.stop, reason);
                }
                found.stop
            }
            worth => self.resume(bytes, at, worth, at_end),
        }
    }

    /// Tell whether a doubtful record can at least be stepped over: records go on behind it, and
    /// none starts inside it or reaches across its end, as they would if its length were damaged.
    fn frames(&self, bytes: &[u8], at: usize, stop: usize) -> bool {
        carries_on(bytes, stop, self)
            && next_record(&bytes[..stop], at + 1, self) == stop
            && record_across(bytes, at + 1, stop, self).is_none()
    }

    /// Go on behind damage at `at`; returns the place of the next record.
    fn resume(&mut self, bytes: &[u8], at: usize, worth: Worth, at_end: Reason) -> usize {
        let next = next_record(bytes, at + 1, self);
        if next == bytes.len() && worth == Worth::Cut {
            self.skip(at, next, at_end);
            return next;
        }
        if let Some((table, start, stop)) = self.last_sample.take()
            && stop == at
            && !is_one_damaged_record(&bytes[at..next], self)
            && let Some(table) = self.tables.get_mut(table as usize)
        {
            table.offsets.pop();
            self.skip(start, stop, Reason::Suspect);
        }
        self.skip(at, next, Reason::Unreadable);
        next
    }

    fn skip(&mut self, start: usize, stop: usize, reason: Reason) {
        match self.skipped.last_mut() {
            Some(last) if last.stop == start && last.reason == reason => last.stop = stop,
            _ => self.skipped.push(Skipped { start, stop, reason }),
        }
    }

    fn accept(&mut self, bytes: &[u8], at: usize, kind: u8, stop: usize) {
        let payload = &bytes[at + 3..stop];
        self.in_data |= matches!(kind, b'A' | b'C' | b'D' | b'L');
        match kind {
            b'D' => self.accept_sample(payload, at, stop),
            b'A' if !self.announce(payload) => self.skip(at, stop, Reason::UnknownFormat),
            b'F' => {
                self.formats.add(payload);
            }
            b'I' => self.infos.extend(entry::read(payload)),
            b'M' => self
                .multi_infos
                .extend(flagged(payload).map(|(first, entry)| (first & 1 == 1, entry))),
            b'Q' => self.defaults.extend(flagged(payload)),
            b'P' if self.in_data => {
                self.changes.extend(
                    entry::read(payload).map(|item| Stamped { stamp_us: self.last_us, item }),
                );
            }
            b'P' => self.parameters.extend(entry::read(payload)),
            b'L' | b'C' => self.lines.extend(Line::read(payload, kind == b'C')),
            b'O' => self.dropouts.push(Stamped {
                stamp_us: self.last_us,
                item: u16::from_le_bytes([payload[0], payload[1]]),
            }),
            b'S' => self.syncs += 1,
            _ => {}
        }
        if kind != b'D' {
            self.last_sample = None;
        }
    }

    fn accept_sample(&mut self, payload: &[u8], at: usize, stop: usize) {
        let Some((id, sample)) = payload.split_first_chunk::<2>() else {
            return;
        };
        let index = self.by_id.get(usize::from(u16::from_le_bytes(*id))).copied();
        let index = index.unwrap_or(NO_TABLE);
        let Some(table) = self.tables.get_mut(index as usize) else {
            return;
        };
        table.offsets.push(at + 5);
        self.last_sample = Some((index, at, stop));
        let stamp = table.shape.stamp.and_then(|(primitive, offset)| {
            primitive.unsigned(sample.get(offset..offset + primitive.size())?)
        });
        self.last_us = self.last_us.max(stamp.unwrap_or(0));
    }

    /// Give a message number to an instance of a message; false where it has no usable definition.
    fn announce(&mut self, payload: &[u8]) -> bool {
        let &[instance, low, high, ref name @ ..] = payload else {
            return false;
        };
        let Ok(name) = std::str::from_utf8(name) else {
            return false;
        };
        let shape = match self.shapes.get(name) {
            Some(shape) => *shape,
            None => {
                let shape = self.formats.shape(name);
                self.shapes.insert(name.into(), shape);
                shape
            }
        };
        let Some(shape) = shape else {
            return false;
        };
        let key = (Box::from(name), instance);
        let index = *self.by_key.entry(key).or_insert_with(|| {
            self.tables.push(Table {
                name: name.into(),
                instance,
                offsets: Places::default(),
                shape,
            });
            (self.tables.len() - 1) as u32
        });
        let id = usize::from(u16::from_le_bytes([low, high]));
        if self.by_id.len() <= id {
            self.by_id.resize(id + 1, NO_TABLE);
        }
        self.by_id[id] = index;
        true
    }
}

fn flagged(payload: &[u8]) -> Option<(u8, Entry)> {
    let (&first, rest) = payload.split_first()?;
    entry::read(rest).map(|entry| (first, entry))
}

fn little_endian(bytes: &[u8]) -> u64 {
    let mut wide = [0_u8; 8];
    for (target, source) in wide.iter_mut().zip(bytes) {
        *target = *source;
    }
    u64::from_le_bytes(wide)
}
