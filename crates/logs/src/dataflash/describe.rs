//! What the stamps of a table say: span and usual interval.

use super::{Dataflash, Table};

/// Span and interval of the stamps of a table, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamps {
    /// Earliest.
    pub first_s: f64,
    /// Latest.
    pub last_s: f64,
    /// Median interval between rows of the lowest instance that is positive; None below two rows.
    pub interval_s: Option<f64>,
}

impl<B: AsRef<[u8]>> Dataflash<B> {
    /// Describe the stamps of a table; None where it has no rows or no stamps.
    pub fn describe(&self, table: &Table) -> Option<Stamps> {
        let all = self.stamps(table, None)?;
        let first_s = all.iter().copied().reduce(f64::min)?;
        let last_s = all.iter().copied().reduce(f64::max)?;
        let one = match self.instances(table).first() {
            Some(&instance) => self.stamps(table, Some(instance))?,
            None => all,
        };
        let mut steps: Vec<f64> =
            one.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
        let middle = steps.len() / 2;
        let interval_s =
            (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1);
        Some(Stamps { first_s, last_s, interval_s })
    }
}
