//! What the stamps of a table say: span and usual interval.

use super::column::BLOCK;
use super::format::Field;
use super::log_index::Dataflash;
use super::message_table::Table;

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
        let field = table.layout.stamp()?;
        let (first_s, last_s) = self.extremes(table, field)?;
        let lowest = match instances {
            [lowest, _, ..] => Some(*lowest),
            _ => None,
        };
        let interval_s = self.median_step(table, lowest, field);
        Some(Stamps { first_s, last_s, interval_s })
    }

    /// Least and greatest number of a field.
    fn extremes(&self, table: &Table, field: &Field) -> Option<(f64, f64)> {
        let mut values = Vec::with_capacity(BLOCK);
        let mut ends = (f64::NAN, f64::NAN);
        self.each_block(table, None, |block| {
            values.clear();
            self.append(&mut values, block, field);
            ends = values.iter().fold(ends, |(low, high), &each| (low.min(each), high.max(each)));
        });
        (!table.is_empty()).then_some(ends)
    }

    fn median_step(&self, table: &Table, instance: Option<i64>, field: &Field) -> Option<f64> {
        let stride = (self.rows(table, instance) / STEPS).max(1);
        let places = self.places(table, instance);
        let steps = places.clone().zip(places.skip(1)).step_by(stride);
        let pairs: Vec<usize> = steps.flat_map(|(from, to)| [from, to]).collect();
        let mut stamps = Vec::with_capacity(pairs.len());
        self.append(&mut stamps, &pairs, field);
        let mut steps: Vec<f64> = stamps
            .chunks_exact(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|step| *step > 0.0)
            .collect();
        let middle = steps.len() / 2;
        (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}
