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
        let (first_s, last_s) = self.extremes(&table.offsets, field)?;
        let lowest = match instances {
            [lowest, _, ..] => Some(*lowest),
            _ => None,
        };
        let interval_s = self.median_step(&self.places(table, lowest), field);
        Some(Stamps { first_s, last_s, interval_s })
    }

    /// Least and greatest number of a field.
    fn extremes(&self, places: &[usize], field: &Field) -> Option<(f64, f64)> {
        let mut values = Vec::with_capacity(BLOCK);
        let blocks = places.chunks(BLOCK).map(|block| {
            values.clear();
            self.append(&mut values, block, field);
            let least = values.iter().copied().fold(f64::NAN, f64::min);
            (least, values.iter().copied().fold(f64::NAN, f64::max))
        });
        blocks.reduce(|all, block| (all.0.min(block.0), all.1.max(block.1)))
    }

    fn median_step(&self, places: &[usize], field: &Field) -> Option<f64> {
        let stride = (places.len() / STEPS).max(1);
        let pairs: Vec<usize> = places.windows(2).step_by(stride).flatten().copied().collect();
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
