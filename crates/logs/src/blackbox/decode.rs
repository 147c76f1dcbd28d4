//! The frames of a flight: to columns, with what was lost on the way.

use super::encoding::Bytes;
use super::frame_layout::FrameLayout;
use super::header::Header;
use super::predictor::Known;
use crate::error::LogError;

const LARGEST_FRAME: usize = 256;
/// A jump of the stamps above this, µs, is damage, as is one of the iterations above the other.
const LONGEST_JUMP_US: i64 = 10_000_000;
const LONGEST_JUMP: i64 = 500_000;
/// Values that a byte of the file may give: real logs give one or two, and a stranger's header may
/// claim hundreds of fields that take no bytes.
const VALUES_A_BYTE: usize = 16;
const END: &[u8] = b"End of log";
/// INAV says behind it why it was disarmed.
const LONGEST_END: usize = 40;
const WRAP: i64 = 1 << 32;

/// Rows of one kind of frame.
#[derive(Debug, Clone, Default)]
pub struct FrameTable {
    /// Name of each column.
    pub names: Vec<String>,
    /// Values by column.
    pub columns: Vec<Vec<i32>>,
    /// Whether a column is signed.
    pub signed: Vec<bool>,
    /// Stamp of each row, µs, without the clock's turning over; of the main frame before, where
    /// the frame has none of its own.
    pub stamps_us: Vec<i64>,
}

impl FrameTable {
    fn new(layout: &FrameLayout) -> Self {
        Self {
            names: layout.names.clone(),
            columns: vec![Vec::new(); layout.names.len()],
            signed: layout.signed.clone(),
            stamps_us: Vec::new(),
        }
    }

    fn push(&mut self, values: &[i64], stamp_us: i64) {
        for (column, &value) in self.columns.iter_mut().zip(values) {
            column.push(value as i32);
        }
        self.stamps_us.push(stamp_us);
    }

    /// Numbers of a column.
    pub fn numbers(&self, place: usize) -> Option<Vec<f64>> {
        let (column, &signed) = self.columns.get(place).zip(self.signed.get(place))?;
        let number = |&value: &i32| if signed { f64::from(value) } else { f64::from(value as u32) };
        Some(column.iter().map(number).collect())
    }
}

/// An event frame: its number, the stamp before it and up to two values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Stamp of the main frame before it, µs; none before the first.
    pub stamp_us: Option<i64>,
    /// Number of the kind of event.
    pub kind: u8,
    /// What it holds.
    pub values: [i64; 2],
}

/// Bytes that hold no frame, `start..stop`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Skipped {
    /// First byte.
    pub start: usize,
    /// First byte after.
    pub stop: usize,
    /// Why.
    pub reason: &'static str,
}

/// One flight, decoded.
#[derive(Debug, Clone, Default)]
pub struct Blackbox {
    /// Header.
    pub header: Header,
    /// Frames of the loop.
    pub main: FrameTable,
    /// Frames of slow changes: flight modes, failsafe.
    pub slow: FrameTable,
    /// Positions.
    pub gps: FrameTable,
    /// Events, in order.
    pub events: Vec<Event>,
    /// Bytes that hold no frame.
    pub skipped: Vec<Skipped>,
    /// Whether the logger ended the flight itself.
    pub ended: bool,
    /// Frames that were read but cannot be decoded: those before them were lost.
    pub undecodable: usize,
}

struct Layouts {
    intra: FrameLayout,
    inter: FrameLayout,
    slow: FrameLayout,
    gps: FrameLayout,
    home: FrameLayout,
    iteration: Option<usize>,
    time: usize,
    motor: Option<usize>,
    interval: i64,
    shown: (i64, i64),
}

impl Layouts {
    fn read(header: &Header) -> Result<Self, LogError> {
        let intra = FrameLayout::read(header, 'I', 'I')?;
        let time = intra.place("time").ok_or_else(|| LogError::Unsupported {
            what: "a blackbox log whose frames hold no time".to_string(),
        })?;
        Ok(Self {
            inter: FrameLayout::read(header, 'P', 'I')?,
            slow: FrameLayout::read(header, 'S', 'S')?,
            gps: FrameLayout::read(header, 'G', 'G')?,
            home: FrameLayout::read(header, 'H', 'H')?,
            iteration: intra.place("loopIteration"),
            motor: intra.place("motor[0]"),
            time,
            interval: header.number("I interval").unwrap_or(1).clamp(1, 1 << 20),
            shown: shown(header.value("P interval").unwrap_or("1/1")),
            intra,
        })
    }

    /// Frames left out on purpose after an iteration (`P interval`, a share or every how many).
    ///
    /// A frame is written where its place in the interval plus `part - 1`, modulo `whole`, is below
    /// `part`. The next one written begins a group of `whole` or an interval, whichever is nearer.
    fn left_out(&self, iteration: i64) -> i64 {
        let (part, whole) = self.shown;
        let place = (iteration + 1).rem_euclid(self.interval);
        let in_group = (place + part - 1) % whole;
        if in_group < part {
            return 0;
        }
        (whole - in_group).min(self.interval - place)
    }
}

fn shown(text: &str) -> (i64, i64) {
    let (part, whole) = text.split_once('/').unwrap_or(("1", text));
    let number = |text: &str| text.trim().parse::<i64>().ok().filter(|n| (1..=1 << 20).contains(n));
    match (number(part), number(whole)) {
        (Some(part), Some(whole)) if part <= whole => (part, whole),
        _ => (1, 1),
    }
}

/// What is remembered from frame to frame.
#[derive(Default)]
struct Memory {
    last: Vec<i64>,
    older: Vec<i64>,
    home: Vec<i64>,
    valid: bool,
    iteration: Option<i64>,
    time: Option<i64>,
    turns: i64,
}

impl Blackbox {
    /// Decode one flight of a file: the bytes from its first line to the next flight's.
    ///
    /// # Errors
    /// A header that does not say what frames hold; bytes and frames of more than `budget` bytes.
    pub fn decode(bytes: &[u8], budget: usize) -> Result<Self, LogError> {
        let header = Header::read(bytes, budget)?;
        let layouts = Layouts::read(&header)?;
        let mut log = Self {
            main: FrameTable::new(&layouts.intra),
            slow: FrameTable::new(&layouts.slow),
            gps: FrameTable::new(&layouts.gps),
            ..Self::default()
        };
        let mut memory = Memory::default();
        let mut left = bytes.len().saturating_mul(VALUES_A_BYTE);
        let (mut at, mut held) = (header.size, bytes.len() + header.held);
        let mut values = Vec::new();
        while at < bytes.len() && !log.ended {
            let mut reader = Bytes::new(bytes, at);
            match log.frame(&mut reader, &layouts, &mut memory, &mut values) {
                Some(n_values) if n_values <= left => {
                    left -= n_values;
                    held += size_of::<i32>() * n_values + size_of::<Event>();
                    at = reader.at;
                }
                Some(_) => {
                    log.skip(at, bytes.len(), "more values than the bytes could tell");
                    break;
                }
                None => {
                    memory.valid = false;
                    log.skip(at, at + 1, "no frame");
                    at += 1;
                }
            }
            let taken = held + size_of::<Skipped>() * log.skipped.len();
            if taken > budget {
                return Err(LogError::TooLarge { bytes: taken });
            }
        }
        log.header = header;
        Ok(log)
    }

    fn skip(&mut self, start: usize, stop: usize, reason: &'static str) {
        match self.skipped.last_mut() {
            Some(last) if last.stop == start && last.reason == reason => last.stop = stop,
            _ => self.skipped.push(Skipped { start, stop, reason }),
        }
    }

    /// One frame and how many values it held; none where there is no whole one here.
    fn frame(
        &mut self,
        bytes: &mut Bytes,
        layouts: &Layouts,
        memory: &mut Memory,
        values: &mut Vec<i64>,
    ) -> Option<usize> {
        let start = bytes.at;
        let letter = bytes.byte()?;
        if letter == b'E' {
            return self.event(bytes, memory).map(|()| 1);
        }
        let layout = match letter {
            b'I' => &layouts.intra,
            b'P' => &layouts.inter,
            b'S' => &layouts.slow,
            b'G' => &layouts.gps,
            b'H' => &layouts.home,
            _ => return None,
        };
        if layout.names.is_empty() {
            return None;
        }
        let in_line = letter == b'P';
        let known = Known {
            frames: [
                &[],
                if in_line { &memory.last } else { &[] },
                if in_line { &memory.older } else { &[] },
            ],
            skipped: if in_line { memory.iteration.map_or(0, |i| layouts.left_out(i)) } else { 0 },
            first_motor: layouts.motor,
            home: &memory.home,
            last_us: memory.time.unwrap_or(0),
        };
        layout.frame(bytes, known, values)?;
        let fits = bytes.at - start <= LARGEST_FRAME
            && bytes.peek().is_none_or(|next| b"IPSGHE".contains(&next));
        if !fits {
            return None;
        }
        self.keep(letter, values, layouts, memory);
        Some(values.len())
    }

    fn keep(&mut self, letter: u8, values: &[i64], layouts: &Layouts, memory: &mut Memory) {
        match letter {
            b'I' | b'P' => self.keep_main(letter == b'I', values, layouts, memory),
            b'H' => memory.home = values.to_vec(),
            _ => {
                let Some(now) = memory.time else { return };
                let table = if letter == b'S' { &mut self.slow } else { &mut self.gps };
                table.push(values, now + memory.turns * WRAP);
            }
        }
    }

    fn keep_main(&mut self, whole: bool, values: &[i64], layouts: &Layouts, memory: &mut Memory) {
        if !whole && !memory.valid {
            self.undecodable += 1;
            return;
        }
        let time = values[layouts.time];
        let iteration = layouts.iteration.map(|place| values[place]);
        if !memory.follows(time, iteration) {
            memory.valid = false;
            self.undecodable += 1;
            // A whole frame begins anew: the one after it is compared with it.
            if whole {
                memory.time = None;
                memory.iteration = None;
            }
            return;
        }
        if memory.time.is_some_and(|last| time < last) {
            memory.turns += 1;
        }
        memory.older = if whole { values.to_vec() } else { std::mem::take(&mut memory.last) };
        memory.last = values.to_vec();
        memory.valid = true;
        memory.time = Some(time);
        memory.iteration = iteration;
        self.main.push(values, time + memory.turns * WRAP);
    }

    fn event(&mut self, bytes: &mut Bytes, memory: &mut Memory) -> Option<()> {
        let kind = bytes.byte()?;
        let values = match kind {
            // A beep to line up a video, an arming whose reason is told, a fault of INAV's IMU.
            0 | 15 | 40 => [i64::from(bytes.unsigned()?), 0],
            13 => {
                let function = bytes.byte()?;
                if function & 0x80 != 0 {
                    for _ in 0..4 {
                        bytes.byte()?;
                    }
                    [i64::from(function), 0]
                } else {
                    [i64::from(function), bytes.signed()?]
                }
            }
            14 | 30 => [i64::from(bytes.unsigned()?), i64::from(bytes.unsigned()?)],
            255 => {
                if !bytes.take(END) || !bytes.skip_text(LONGEST_END) {
                    return None;
                }
                self.ended = true;
                [0, 0]
            }
            _ => return None,
        };
        if kind == 14 {
            memory.iteration = Some(values[0]);
            memory.time = Some(values[1]);
        }
        let stamp_us = memory.time.map(|time| time + memory.turns * WRAP);
        self.events.push(Event { stamp_us, kind, values });
        Some(())
    }
}

impl Memory {
    /// Whether a frame comes after the last one: a little later, or over the end of the clock.
    fn follows(&self, time: i64, iteration: Option<i64>) -> bool {
        let later = self.time.is_none_or(|last| {
            (0..=LONGEST_JUMP_US).contains(&(time - last))
                || (0..=LONGEST_JUMP_US).contains(&(time + WRAP - last))
        });
        let counted = match (iteration, self.iteration) {
            (Some(now), Some(last)) => (0..=LONGEST_JUMP).contains(&(now - last)),
            _ => true,
        };
        later && counted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_left_out_are_those_that_steps_count() -> Result<(), LogError> {
        let text = |interval: i64, part: i64, whole: i64| {
            format!(
                "H Product:Blackbox flight data recorder\nH Field I name:time\n\
                 H Field I signed:0\nH Field I predictor:0\nH Field I encoding:1\n\
                 H Field P predictor:0\nH Field P encoding:1\n\
                 H I interval:{interval}\nH P interval:{part}/{whole}\n"
            )
        };
        for interval in [1, 2, 7, 8, 32] {
            for whole in 1..=9 {
                for part in 1..=whole {
                    let header = Header::read(text(interval, part, whole).as_bytes(), 1 << 20)?;
                    let layouts = Layouts::read(&header)?;
                    for iteration in 0..70 {
                        let left_out =
                            |ahead| ((iteration + ahead) % interval + part - 1) % whole >= part;
                        let counted = (1..=interval).take_while(|&ahead| left_out(ahead)).count();
                        assert_eq!(layouts.left_out(iteration), counted as i64);
                    }
                }
            }
        }
        Ok(())
    }

    #[test]
    fn lines_of_a_header_keep_to_the_budget() {
        let text =
            format!("{}\n{}", "H Product:Blackbox flight data recorder", "H a:b\n".repeat(9999));
        assert!(Header::read(text.as_bytes(), 1 << 30).is_ok());
        assert!(matches!(Header::read(text.as_bytes(), 1 << 18), Err(LogError::TooLarge { .. })));
    }
}
