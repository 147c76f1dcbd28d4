//! What the stamps of a table say: span and usual interval.

use super::{Dataflash, Table};

/// Steps that the median is taken of: the rate of a table needs no more.
const STEPS: usize = 4096;

/// Span and interval of the stamps of a table, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamps {
    /// Earliest.
    pub first_s: f64,
    /// Latest.
    pub last_s: f64,
    /// Median of the positive steps from row to row of the lowest instance, or of `STEPS` of them
    /// spread evenly over the log; None below two rows.
    pub interval_s: Option<f64>,
}

impl<B: AsRef<[u8]>> Dataflash<B> {
    /// Describe the stamps of a table, given its instances; None without rows or stamps.
    pub fn describe(&self, table: &Table, instances: &[i64]) -> Option<Stamps> {
        let all = self.stamps(table, None)?;
        let first_s = all.iter().copied().reduce(f64::min)?;
        let last_s = all.iter().copied().reduce(f64::max)?;
        let interval_s = match instances {
            [lowest, _, ..] => median_step(&self.stamps(table, Some(*lowest))?),
            _ => median_step(&all),
        };
        Some(Stamps { first_s, last_s, interval_s })
    }
}

fn median_step(stamps: &[f64]) -> Option<f64> {
    let stride = (stamps.len() / STEPS).max(1);
    let pairs = stamps.windows(2).step_by(stride);
    let mut steps: Vec<f64> =
        pairs.map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}
