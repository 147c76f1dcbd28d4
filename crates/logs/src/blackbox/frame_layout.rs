//! The fields of a kind of frame, as the header says them.

use super::encoding::{Bytes, Encoding};
use super::header::Header;
use super::predictor::{Known, Predictor};
use crate::error::LogError;

const MOST_FIELDS: usize = 256;

/// Fields of a kind of frame.
#[derive(Debug, Clone, Default)]
pub struct FrameLayout {
    /// Name of each field.
    pub names: Vec<String>,
    /// Whether each is signed.
    pub signed: Vec<bool>,
    rules: Vec<(Predictor, Encoding)>,
    version: i64,
}

impl FrameLayout {
    /// The layout of a letter; `named` is the letter whose names it shares (P has those of I).
    pub fn read(header: &Header, letter: char, named: char) -> Result<Self, LogError> {
        let list = |letter: char, what: &str| {
            let text = header.value(&format!("Field {letter} {what}")).unwrap_or("");
            text.split(',')
                .map(str::trim)
                .filter(|part| !part.is_empty())
                .map(String::from)
                .collect::<Vec<_>>()
        };
        let numbers = |letter: char, what: &str| {
            list(letter, what)
                .iter()
                .map(|part| part.parse::<i64>().unwrap_or(-1))
                .collect::<Vec<_>>()
        };
        let names = list(named, "name");
        let (predictors, encodings) = (numbers(letter, "predictor"), numbers(letter, "encoding"));
        let whole = predictors.len() == names.len() && encodings.len() == names.len();
        if !whole || names.len() > MOST_FIELDS {
            return Err(unsupported(format!(
                "a header with {} names, {} predictors and {} encodings of frame {letter}",
                names.len(),
                predictors.len(),
                encodings.len()
            )));
        }
        let mut signed: Vec<bool> =
            numbers(named, "signed").iter().map(|&sign| sign == 1).collect();
        signed.resize(names.len(), false);
        let mut homes = 0;
        let mut rules = Vec::with_capacity(names.len());
        for (&predictor, &encoding) in predictors.iter().zip(&encodings) {
            let rule =
                predictor_of(predictor, header, &mut homes).zip(Encoding::from_number(encoding));
            rules.push(rule.ok_or_else(|| {
                unsupported(format!("a field with predictor {predictor} and encoding {encoding}"))
            })?);
        }
        let version = header.number("Data version").unwrap_or(1);
        Ok(Self { names, signed, rules, version })
    }

    /// Place of a field.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known == name)
    }

    /// Read one frame; none where the bytes end inside it.
    pub fn frame(&self, bytes: &mut Bytes, known: Known, values: &mut Vec<i64>) -> Option<()> {
        values.clear();
        let mut raw = [0i64; 8];
        while let Some(&(_, encoding)) = self.rules.get(values.len()) {
            let first = values.len();
            let alike = self.rules[first..].iter().take(encoding.group());
            // Groups of fixed size hold as many fields as their tag serves, whatever follows.
            let count = match encoding {
                Encoding::Tag8 => alike.take_while(|(_, other)| *other == encoding).count(),
                _ => alike.count(),
            };
            encoding.read(bytes, count, self.version, &mut raw)?;
            for (place, &difference) in (first..).zip(raw.iter().take(count)) {
                let seen = Known { frames: [values, known.frames[1], known.frames[2]], ..known };
                let predictor = self.rules[place].0;
                let guess = predictor.value(place, &seen);
                let value =
                    if predictor == Predictor::Increment { guess } else { guess + difference };
                values.push(wrapped(value, self.signed[place]));
            }
        }
        Some(())
    }
}

/// The firmware counts in 32 bits.
fn wrapped(value: i64, signed: bool) -> i64 {
    if signed { i64::from(value as i32) } else { i64::from(value as u32) }
}

fn predictor_of(number: i64, header: &Header, homes: &mut usize) -> Option<Predictor> {
    let constant = |name: &str| Predictor::Constant(header.number(name).unwrap_or(0));
    Some(match number {
        0 => Predictor::Zero,
        1 => Predictor::Previous,
        2 => Predictor::StraightLine,
        3 => Predictor::Average,
        4 => constant("minthrottle"),
        5 => Predictor::FirstMotor,
        6 => Predictor::Increment,
        7 => {
            *homes += 1;
            Predictor::Home(*homes - 1)
        }
        8 => Predictor::Constant(1500),
        9 => constant("vbatref"),
        10 => Predictor::LastTime,
        11 => constant("motorOutput"),
        _ => return None,
    })
}

fn unsupported(what: String) -> LogError {
    LogError::Unsupported { what }
}
