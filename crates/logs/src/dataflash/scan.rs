//! The one pass over the bytes: which are messages, which are not, and why.
//!
//! A header is three bytes, so damaged or foreign bytes look like one every 2^16 places or so. A
//! message is therefore accepted only on proof:
//!
//! - in step (the message before ended here): another known header, or the end of the file, follows
//!   directly; or, where something else follows, the next proven message does not begin inside it;
//! - anywhere: it is a `FMT` whose claimed size is the sum of its fields;
//! - after garbage: another known header, or the end, follows directly; or its stamp lies within
//!   `NEAR_US` of the last one read (a chance of 1e-11 for random bytes).
//!
//! Everything else is skipped and reported. The work is linear in the number of bytes: each search
//! begins where the one before ended.

use super::format::{FMT_SIZE, FMT_TYPE, HEADER_1, HEADER_2, HEADER_SIZE, Layout, definition};
use super::message_table::Table;
use crate::places::Places;

/// Stamps this close to the last one prove a message after garbage, µs.
const NEAR_US: u64 = 60_000_000;
/// Layouts kept. A log has at most 256 at a time; a file that defines without end is not believed.
const MAXIMUM_TABLES: usize = 1024;
/// No table: marks a type whose layout is unknown or contradicts itself.
const NO_TABLE: usize = usize::MAX;

/// Why bytes were skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SkipReason {
    /// No header where one was due.
    NoHeader,
    /// A header of a type that no `FMT` defines.
    UnknownType(u8),
    /// A message of a type whose `FMT` contradicts itself, or is one of too many.
    BadDefinition(u8),
    /// A message begins, but the next proven one starts inside it: bytes are missing.
    CutShort(u8),
    /// The file ends inside a message.
    Truncated(u8),
    /// The file ends inside a header.
    EndsInHeader,
    /// One byte repeated: the unwritten rest of a block.
    Filling(u8),
}

impl std::fmt::Display for SkipReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoHeader => write!(f, "no message header"),
            Self::UnknownType(id) => write!(f, "message type {id} has no FMT"),
            Self::BadDefinition(id) => write!(f, "the FMT of message type {id} cannot be used"),
            Self::CutShort(id) => write!(f, "message of type {id} cut short by the next"),
            Self::Truncated(id) => write!(f, "the file ends inside a message of type {id}"),
            Self::EndsInHeader => write!(f, "the file ends inside a message header"),
            Self::Filling(byte) => write!(f, "filled with 0x{byte:02x}"),
        }
    }
}

/// A byte range that is in no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skipped {
    /// First byte.
    pub start: usize,
    /// First byte after.
    pub stop: usize,
    /// Why.
    pub reason: SkipReason,
}

/// What a scan finds.
pub struct Found {
    /// Tables in order of definition.
    pub tables: Vec<Table>,
    /// Ranges in file order.
    pub skipped: Vec<Skipped>,
}

/// Walk the bytes once.
pub fn scan(bytes: &[u8]) -> Found {
    let mut scanner = Scanner::new(bytes);
    scanner.run();
    let Scanner { mut tables, offsets, skipped, .. } = scanner;
    for (table, offsets) in tables.iter_mut().zip(offsets) {
        table.offsets = offsets;
    }
    Found { tables, skipped }
}

/// What is known of a type number.
#[derive(Clone, Copy)]
struct Known {
    /// Size with header; 0 where the type is unknown.
    size: usize,
    table: usize,
    /// Place of a 64-bit stamp in µs from the first header byte; 0 where there is none.
    stamp: usize,
}

struct Scanner<'a> {
    bytes: &'a [u8],
    known: [Known; 256],
    tables: Vec<Table>,
    /// Rows by table: apart from the tables, so that those in use share a few cache lines.
    offsets: Vec<Places>,
    skipped: Vec<Skipped>,
    /// Place of the last stamp read; 0 before the first.
    last_stamp: usize,
}

impl<'a> Scanner<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let mut scanner = Self {
            bytes,
            known: [Known { size: 0, table: NO_TABLE, stamp: 0 }; 256],
            tables: Vec::new(),
            offsets: Vec::new(),
            skipped: Vec::new(),
            last_stamp: 0,
        };
        scanner.adopt(Layout::of_fmt());
        scanner
    }

    fn run(&mut self) {
        let end = self.bytes.len();
        let mut at = 0;
        while at < end {
            at = self.in_step(at);
            let Some(type_id) = self.header(at) else {
                let next = self.resynchronise(at + 1);
                self.skip(at, next, self.reason_without_header(at, next));
                at = next;
                continue;
            };
            let stop = at + self.known(type_id).size;
            if self.goes_on_at(stop) || self.defines_soundly(at, type_id) {
                self.accept(at, stop, type_id);
                at = stop;
                continue;
            }
            let next = self.resynchronise(at + 1);
            if stop <= next {
                self.accept(at, stop, type_id);
                self.skip(stop, next, self.reason_without_header(stop, next));
            } else if next == end {
                self.skip(at, next, SkipReason::Truncated(type_id));
            } else {
                self.skip(at, next, SkipReason::CutShort(type_id));
            }
            at = next;
        }
    }

    /// Accept messages as long as a known header follows each: nearly all of a sound log. Gives the
    /// place of the first that needs another proof. Every header is looked at once.
    fn in_step(&mut self, from: usize) -> usize {
        let mut at = from;
        let Some(mut type_id) = self.header(at) else {
            return at;
        };
        loop {
            let stop = at + self.known(type_id).size;
            let Some(next) = self.header(stop) else {
                return at;
            };
            self.accept(at, stop, type_id);
            (at, type_id) = (stop, next);
        }
    }

    #[inline]
    fn known(&self, type_id: u8) -> Known {
        self.known[usize::from(type_id)]
    }

    /// Type of a header at a place, if it is one of a known type.
    #[inline]
    fn header(&self, at: usize) -> Option<u8> {
        match self.bytes.get(at..at + HEADER_SIZE) {
            Some(&[HEADER_1, HEADER_2, type_id]) if self.known(type_id).size > 0 => Some(type_id),
            _ => None,
        }
    }

    /// Whether a place continues the row of messages: a known header (or as much of one as the file
    /// still holds), or the end.
    #[inline]
    fn goes_on_at(&self, at: usize) -> bool {
        if self.header(at).is_some() {
            return true;
        }
        match self.bytes.get(at..) {
            Some([]) | Some([HEADER_1]) | Some([HEADER_1, HEADER_2]) => true,
            Some(_) | None => false,
        }
    }

    /// First place at or after `from` where a message is proven without knowing the one before.
    fn resynchronise(&self, from: usize) -> usize {
        let mut from = from;
        while let Some(distance) =
            self.bytes.get(from..).and_then(|rest| rest.iter().position(|&byte| byte == HEADER_1))
        {
            let at = from + distance;
            if self.header(at).is_some_and(|id| self.is_proven(at, id)) {
                return at;
            }
            from = at + 1;
        }
        self.bytes.len()
    }

    fn is_proven(&self, at: usize, type_id: u8) -> bool {
        let known = self.known(type_id);
        if at + known.size > self.bytes.len() {
            return false;
        }
        self.goes_on_at(at + known.size)
            || self.is_near_in_time(at, known)
            || self.defines_soundly(at, type_id)
    }

    /// Whether a `FMT` message agrees with itself: the size that it claims is the sum of its fields.
    /// What follows cannot be asked, since it may be of the type that is defined here.
    fn defines_soundly(&self, at: usize, type_id: u8) -> bool {
        type_id == FMT_TYPE
            && self
                .bytes
                .get(at..at + FMT_SIZE)
                .and_then(definition)
                .is_some_and(|definition| definition.layout.is_some())
    }

    fn is_near_in_time(&self, at: usize, known: Known) -> bool {
        if known.stamp == 0 || self.last_stamp == 0 {
            return false;
        }
        match (self.word(at + known.stamp), self.word(self.last_stamp)) {
            (Some(stamp), Some(last)) => stamp.abs_diff(last) <= NEAR_US,
            _ => false,
        }
    }

    fn word(&self, at: usize) -> Option<u64> {
        let bytes = self.bytes.get(at..at.checked_add(8)?)?;
        Some(u64::from_le_bytes(bytes.try_into().ok()?))
    }

    // Called in two places, of which one sees nearly every message: the compiler, not knowing that,
    // would make it a call.
    #[inline(always)]
    fn accept(&mut self, at: usize, stop: usize, type_id: u8) {
        let known = self.known(type_id);
        match self.offsets.get_mut(known.table) {
            Some(offsets) => offsets.push(at),
            None => {
                self.skip(at, stop, SkipReason::BadDefinition(type_id));
                return;
            }
        }
        if known.stamp > 0 {
            self.last_stamp = at + known.stamp;
        }
        if type_id == FMT_TYPE {
            self.define(at);
        }
    }

    /// Take over what a `FMT` message says.
    #[cold]
    fn define(&mut self, at: usize) {
        let Some(message) = self.bytes.get(at..at + FMT_SIZE) else {
            return;
        };
        let Some(definition) = definition(message) else {
            return;
        };
        // What FMT says of FMT is known already; another size would lose the way to all others.
        if definition.type_id == FMT_TYPE {
            return;
        }
        match definition.layout {
            Some(layout) => self.adopt(layout),
            None if definition.size >= HEADER_SIZE => {
                self.known[usize::from(definition.type_id)] =
                    Known { size: definition.size, table: NO_TABLE, stamp: 0 };
            }
            None => {}
        }
    }

    /// Give a layout its table: the present one where it says the same again, as logs do.
    fn adopt(&mut self, layout: Layout) {
        let slot = usize::from(layout.type_id);
        let stamp = match layout.stamp() {
            Some(field) if field.name == "TimeUS" && field.kind.size() == 8 => field.offset,
            _ => 0,
        };
        let same = |table: &Table| table.layout.agrees_with(&layout);
        let present = self.known[slot].table;
        let table = if self.tables.get(present).is_some_and(same) {
            present
        } else {
            let moved = self.tables.iter().position(same);
            moved.unwrap_or(self.tables.len())
        };
        self.known[slot] = Known { size: layout.size, table, stamp };
        if table == self.tables.len() && table < MAXIMUM_TABLES {
            self.tables.push(Table { layout, offsets: Places::default() });
            self.offsets.push(Places::default());
        }
    }

    fn reason_without_header(&self, start: usize, stop: usize) -> SkipReason {
        match self.bytes.get(start..stop) {
            Some([HEADER_1, HEADER_2, type_id, ..]) if self.known(*type_id).size == 0 => {
                SkipReason::UnknownType(*type_id)
            }
            Some([HEADER_1] | [HEADER_1, HEADER_2]) if stop == self.bytes.len() => {
                SkipReason::EndsInHeader
            }
            Some([first, rest @ ..]) if rest.iter().all(|byte| byte == first) => {
                SkipReason::Filling(*first)
            }
            _ => SkipReason::NoHeader,
        }
    }

    /// Report a range, joined to the one before where both have the same reason.
    #[cold]
    fn skip(&mut self, start: usize, stop: usize, reason: SkipReason) {
        if start >= stop {
            return;
        }
        match self.skipped.last_mut() {
            Some(last) if last.stop == start && last.reason == reason => last.stop = stop,
            _ => self.skipped.push(Skipped { start, stop, reason }),
        }
    }
}
