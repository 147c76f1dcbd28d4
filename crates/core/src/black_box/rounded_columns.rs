//! Candidate terms in single precision, by whose products most of them are ruled out.
//! (Python side: identification/narx/fit.py)
//!
//! Reading the candidates from memory is what a selection takes its time for; in single precision it
//! takes half. What rounding removed of a column, e, is measured when it is rounded: a product with a
//! unit vector q that is summed in double precision misses qᵀe, which is at most ‖e‖.

use rayon::prelude::*;

use crate::black_box::candidates::Candidates;
use crate::black_box::remainder::Remainder;
use crate::numerics::gram_schmidt::dot;
use crate::numerics::widest::widest;

/// Columns that meet a vector at one reading of it.
const ROWS: usize = 4;
/// Partial sums of a product.
const LANES: usize = 8;
/// Groups of columns of one parallel task.
const GROUPS: usize = 4;

/// Rounded columns, each over a power of two so that none leaves the range of single precision.
pub(crate) struct RoundedColumns {
    values: Vec<f32>,
    scales: Vec<f64>,
    n_samples: usize,
}

impl RoundedColumns {
    /// The candidates rounded, and what is left of each beside no term.
    pub fn of(candidates: &Candidates<'_>, y: &[f64], penalties: &[f64]) -> (Self, Vec<Remainder>) {
        let (count, n_samples) = (candidates.len(), candidates.n_samples);
        let mut values = vec![0.0_f32; count * n_samples];
        let mut scales = vec![1.0; count];
        let rounded = values.par_chunks_exact_mut(n_samples).zip(&mut scales).enumerate();
        let start = |scratch: &mut Vec<f64>, (index, (values, scale)): (usize, (&mut [f32], _))| {
            let column = candidates.column(index, scratch);
            let penalty = *penalties.get(index).unwrap_or(&0.0);
            let mut rest = Remainder::whole(dot(column, column), dot(column, y), penalty);
            if rest.open {
                rest.missed = round(column, rest.length, values, scale);
            }
            rest
        };
        let remainders = rounded.map_init(Vec::new, start).collect();
        (Self { values, scales, n_samples }, remainders)
    }

    /// Products of a vector with every column; zero where none of a group is open.
    pub fn products(&self, vector: &[f64], open: impl Fn(usize) -> bool + Sync) -> Vec<f64> {
        let mut found = vec![0.0; self.scales.len()];
        let task = GROUPS * ROWS;
        let columns = self.values.par_chunks(task * self.n_samples);
        found.par_chunks_mut(task).zip(columns).enumerate().for_each(|(part, (sums, columns))| {
            let groups = sums.chunks_mut(ROWS).zip(columns.chunks(ROWS * self.n_samples));
            for (group, (sums, columns)) in groups.enumerate() {
                let first = part * task + group * ROWS;
                if (first..first + sums.len()).any(&open) {
                    self.group(first, columns, vector, sums);
                }
            }
        });
        found
    }

    fn group(&self, first: usize, columns: &[f32], vector: &[f64], sums: &mut [f64]) {
        let n = self.n_samples;
        // A group that is not full meets its last column again.
        let row = |place: usize| {
            let start = place.min(sums.len() - 1) * n;
            &columns[start..start + n]
        };
        let found = products([row(0), row(1), row(2), row(3)], vector);
        for (place, (sum, value)) in sums.iter_mut().zip(found).enumerate() {
            *sum = self.scales[first + place] * value;
        }
    }

    /// All columns to be written in parallel, with their powers of two.
    pub fn each_mut(&mut self) -> impl IndexedParallelIterator<Item = (&mut [f32], &mut f64)> {
        self.values.par_chunks_exact_mut(self.n_samples).zip(&mut self.scales)
    }

    /// Column `index` to be written, with its power of two.
    pub fn column_mut(&mut self, index: usize) -> (&mut [f32], &mut f64) {
        let places = index * self.n_samples..(index + 1) * self.n_samples;
        (&mut self.values[places], &mut self.scales[index])
    }
}

/// Round a column of the given squared length; returns how far a product of the rounded column with a
/// unit vector may be from that of the column, rounding of the sum included.
pub(crate) fn round(column: &[f64], length: f64, rounded: &mut [f32], scale: &mut f64) -> f64 {
    let norm = length.sqrt();
    // The power of two of the length: no entry is beyond two of it.
    *scale = f64::from_bits(norm.to_bits() & f64::INFINITY.to_bits());
    let missed = widest(
        #[inline(always)]
        || rounding_of(column, 1.0 / *scale, rounded),
    );
    let of_sums = (column.len() / LANES + 2 * LANES) as f64 * f64::EPSILON;
    *scale * missed.sqrt() * (1.0 + of_sums) + of_sums * norm
}

/// Write rounded entries; squared length of what they miss.
#[inline(always)]
fn rounding_of(column: &[f64], factor: f64, rounded: &mut [f32]) -> f64 {
    let mut sums = [0.0; LANES];
    let (whole, tail) = rounded.split_at_mut(rounded.len() / LANES * LANES);
    let parts = column.chunks_exact(LANES);
    let rest = parts.remainder();
    for (entries, values) in whole.chunks_exact_mut(LANES).zip(parts) {
        for lane in 0..LANES {
            let scaled = values[lane] * factor;
            entries[lane] = scaled as f32;
            let missed = scaled - f64::from(entries[lane]);
            sums[lane] += missed * missed;
        }
    }
    for (entry, value) in tail.iter_mut().zip(rest) {
        *entry = (value * factor) as f32;
        sums[0] += (value * factor - f64::from(*entry)).powi(2);
    }
    sums.iter().sum()
}

fn products(columns: [&[f32]; ROWS], vector: &[f64]) -> [f64; ROWS] {
    widest(
        #[inline(always)]
        || sums_of_products(columns, vector),
    )
}

#[inline(always)]
fn sums_of_products(columns: [&[f32]; ROWS], vector: &[f64]) -> [f64; ROWS] {
    let mut sums = [[0.0; LANES]; ROWS];
    let whole = vector.len() / LANES * LANES;
    for (part, values) in vector.chunks_exact(LANES).enumerate() {
        let places = part * LANES..(part + 1) * LANES;
        for (sums, column) in sums.iter_mut().zip(columns) {
            add_products(sums, &column[places.clone()], values);
        }
    }
    let mut found = sums.map(|each| each.iter().sum::<f64>());
    for (sum, column) in found.iter_mut().zip(columns) {
        let rest = column[whole..].iter().zip(&vector[whole..]);
        *sum += rest.map(|(x, v)| f64::from(*x) * v).sum::<f64>();
    }
    found
}

#[inline(always)]
fn add_products(sums: &mut [f64; LANES], column: &[f32], vector: &[f64]) {
    for (sum, (x, v)) in sums.iter_mut().zip(column.iter().zip(vector)) {
        *sum += f64::from(*x) * v;
    }
}

#[cfg(test)]
#[path = "tests/rounded_columns.rs"]
mod tests;
