//! A column as it grows: numbers, times or text.

use std::borrow::Cow;
use std::collections::HashMap;

use super::cell;
use super::date;
use super::fault::Fault;
use super::windows;

/// What a text takes beside its letters, bytes.
const TEXT_BYTES: usize = 96;

/// A column that is read.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// NaN where nothing stands; times as s from the first of them.
    Numbers(Vec<f64>),
    /// Each text once, and its place in them by row.
    Texts {
        /// By row.
        codes: Vec<u32>,
        /// In order of appearance.
        texts: Vec<String>,
    },
}

#[derive(Default)]
enum Kind {
    #[default]
    Numbers,
    Dates,
    Texts,
    /// Text below numbers: a second pass makes text of all of it.
    Mixed,
    /// Of the first pass, and not looked at in the second.
    Done,
}

/// A column that is being read.
#[derive(Default)]
pub struct Growing {
    kind: Kind,
    has_number: bool,
    numbers: Vec<f64>,
    /// ns since 1970; the smallest integer where nothing stands.
    dates: Vec<i64>,
    codes: Vec<u32>,
    known: HashMap<Box<str>, u32>,
    letters: usize,
}

impl Growing {
    /// Whether a number may be handed over by `number`.
    pub fn takes_numbers(&self) -> bool {
        matches!(self.kind, Kind::Numbers | Kind::Done | Kind::Mixed)
    }

    /// Add a number.
    pub fn number(&mut self, value: f64) {
        if matches!(self.kind, Kind::Numbers) {
            self.has_number = true;
            self.numbers.push(value);
        }
    }

    /// Add a cell.
    pub fn cell(
        &mut self,
        content: &[u8],
        delimiter: u8,
        point: &mut Option<u8>,
    ) -> Result<(), Fault> {
        match self.kind {
            Kind::Numbers => {
                if let Some(value) = cell::number(content, delimiter, point) {
                    self.has_number |= !value.is_nan();
                    self.numbers.push(value);
                } else if !self.has_number && date::nanoseconds(content).is_some() {
                    self.kind = Kind::Dates;
                    self.dates = vec![i64::MIN; self.numbers.len()];
                    return self.cell(content, delimiter, point);
                } else if self.numbers.is_empty() {
                    self.kind = Kind::Texts;
                    return self.cell(content, delimiter, point);
                } else {
                    self.kind = Kind::Mixed;
                }
            }
            Kind::Dates => {
                let is_nothing =
                    cell::number(content, delimiter, &mut None).is_some_and(f64::is_nan);
                match date::nanoseconds(content) {
                    Some(value) => self.dates.push(value),
                    None if is_nothing => self.dates.push(i64::MIN),
                    None => self.kind = Kind::Mixed,
                }
            }
            Kind::Texts => return self.text(content),
            Kind::Mixed | Kind::Done => {}
        }
        Ok(())
    }

    fn text(&mut self, content: &[u8]) -> Result<(), Fault> {
        let text = match std::str::from_utf8(content) {
            Ok(text) => Cow::Borrowed(text),
            Err(_) => Cow::Owned(windows::text(content).ok_or(Fault::NotText)?),
        };
        let text = text.trim();
        let code = if let Some(&code) = self.known.get(text) {
            code
        } else {
            let code = u32::try_from(self.known.len()).map_err(|_| Fault::NotText)?;
            self.letters += text.len();
            self.known.insert(text.into(), code);
            code
        };
        self.codes.push(code);
        Ok(())
    }

    /// What texts take, bytes.
    pub fn text_bytes(&self) -> usize {
        2 * self.letters + TEXT_BYTES * self.known.len()
    }

    /// Whether a second pass must make text of it.
    pub fn wants_text(&self) -> bool {
        matches!(self.kind, Kind::Mixed)
    }

    /// Prepare for the second pass.
    pub fn begin_again(&mut self) {
        if self.wants_text() {
            *self = Self { kind: Kind::Texts, ..Self::default() };
        } else if !self.dates.is_empty() {
            self.numbers = date::seconds(&std::mem::take(&mut self.dates));
            self.kind = Kind::Done;
        } else if !matches!(self.kind, Kind::Texts) {
            self.kind = Kind::Done;
        } else {
            // Read once more: its codes are few bytes, and its letters are known.
            self.codes.clear();
        }
    }

    /// The column.
    pub fn finished(self) -> Column {
        match self.kind {
            Kind::Texts => {
                let mut texts = vec![String::new(); self.known.len()];
                for (text, code) in self.known {
                    texts[code as usize] = text.into();
                }
                Column::Texts { codes: self.codes, texts }
            }
            Kind::Dates => Column::Numbers(date::seconds(&self.dates)),
            _ => Column::Numbers(self.numbers),
        }
    }
}
