//! Candidate terms in sixteen bits, by whose products most of them are ruled out.
//! (Python side: identification/narx/fit.py)
//!
//! Reading the candidates from memory is what a selection takes its time for; in sixteen bits it takes
//! a quarter. A vector that they meet is rounded too, to two digits of ten bits, so that products are
//! sums of whole numbers, which no order of addition changes. What rounding removed of a column, e, and
//! of a unit vector, d, is measured: a product misses at most ‖e‖ + ‖p‖‖d‖.

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
/// Largest number of sixteen bits that a column has.
const LARGEST: f64 = 32_767.0;
/// Samples whose products, of numbers so large and digits so large, thirty-two bits hold.
const BLOCK: usize = 64;
const LARGEST_DIGIT: f64 = 1_023.0;
/// Steps of the second digit in one of the first.
const DIGITS_APART: f64 = 1_024.0;
/// Whole numbers of some samples.
pub(crate) type Whole = [i16; BLOCK];

/// Rounded columns, each over a power of two, so that whole numbers are exact.
pub(crate) struct RoundedColumns {
    values: Vec<Whole>,
    scales: Vec<f64>,
    n_blocks: usize,
}

/// A vector as two digits for each sample.
struct Digits {
    high: Vec<Whole>,
    low: Vec<Whole>,
    step: f64,
    /// Length of what they miss.
    missed: f64,
}

impl Digits {
    fn of(vector: &[f64]) -> Self {
        let n_blocks = vector.len().div_ceil(BLOCK);
        let mut digits = Self {
            high: vec![[0; BLOCK]; n_blocks],
            low: vec![[0; BLOCK]; n_blocks],
            step: step_of(vector, LARGEST_DIGIT),
            missed: 0.0,
        };
        let fine = digits.step / DIGITS_APART;
        let places = digits.high.iter_mut().flatten().zip(digits.low.iter_mut().flatten());
        let mut missed = 0.0;
        for (value, (high, low)) in vector.iter().zip(places) {
            let first = nearest(value / digits.step);
            let rest = value - digits.step * first;
            let second = nearest(rest / fine);
            (*high, *low) = (first as i32 as i16, second as i32 as i16);
            missed += (rest - fine * second).powi(2);
        }
        digits.missed = missed.sqrt() * (1.0 + vector.len() as f64 * f64::EPSILON);
        digits
    }

    fn value(&self, [high, low]: [i64; 2]) -> f64 {
        self.step * (high as f64 + low as f64 / DIGITS_APART)
    }
}

impl RoundedColumns {
    /// The candidates rounded, and what is left of each beside no term.
    pub fn of(candidates: &Candidates<'_>, y: &[f64], penalties: &[f64]) -> (Self, Vec<Remainder>) {
        let count = candidates.len();
        let n_blocks = candidates.n_samples.div_ceil(BLOCK);
        let mut values = vec![[0; BLOCK]; count * n_blocks];
        let mut scales = vec![1.0; count];
        let rounded = values.par_chunks_exact_mut(n_blocks).zip(&mut scales).enumerate();
        let start = |scratch: &mut Vec<f64>,
                     (index, (values, scale)): (usize, (&mut [Whole], _))| {
            let column = candidates.column(index, scratch);
            let penalty = *penalties.get(index).unwrap_or(&0.0);
            let mut rest = Remainder::whole(dot(column, column), dot(column, y), penalty);
            if rest.open {
                rest.missed = round(column, rest.length, values, scale);
            }
            rest
        };
        let remainders = rounded.map_init(Vec::new, start).collect();
        (Self { values, scales, n_blocks }, remainders)
    }

    /// Products of a vector with every column, zero where none of a group is open; and what rounding
    /// took from the vector.
    pub fn products(&self, vector: &[f64], open: impl Fn(usize) -> bool + Sync) -> (Vec<f64>, f64) {
        let digits = Digits::of(vector);
        let mut found = vec![0.0; self.scales.len()];
        let task = GROUPS * ROWS;
        let columns = self.values.par_chunks(task * self.n_blocks);
        found.par_chunks_mut(task).zip(columns).enumerate().for_each(|(part, (sums, columns))| {
            let groups = sums.chunks_mut(ROWS).zip(columns.chunks(ROWS * self.n_blocks));
            for (group, (sums, columns)) in groups.enumerate() {
                let first = part * task + group * ROWS;
                if (first..first + sums.len()).any(&open) {
                    self.group(first, columns, &digits, sums);
                }
            }
        });
        (found, digits.missed)
    }

    fn group(&self, first: usize, columns: &[Whole], digits: &Digits, sums: &mut [f64]) {
        // A group that is not full meets its last column again.
        let row = |place: usize| {
            let start = place.min(sums.len() - 1) * self.n_blocks;
            &columns[start..start + self.n_blocks]
        };
        let rows = [row(0), row(1), row(2), row(3)];
        let found = widest(
            #[inline(always)]
            || products(rows, digits),
        );
        for (place, (sum, value)) in sums.iter_mut().zip(found).enumerate() {
            *sum = self.scales[first + place] * digits.value(value);
        }
    }

    /// All columns to be written in parallel, with their steps.
    pub fn each_mut(&mut self) -> impl IndexedParallelIterator<Item = (&mut [Whole], &mut f64)> {
        self.values.par_chunks_exact_mut(self.n_blocks).zip(&mut self.scales)
    }

    /// Column `index` to be written, with its step.
    pub fn column_mut(&mut self, index: usize) -> (&mut [Whole], &mut f64) {
        let places = index * self.n_blocks..(index + 1) * self.n_blocks;
        (&mut self.values[places], &mut self.scales[index])
    }
}

/// Round a column of the given squared length; returns how far a product of the rounded column with a
/// unit vector may be from that of the column, rounding of the sum included.
pub(crate) fn round(column: &[f64], length: f64, rounded: &mut [Whole], scale: &mut f64) -> f64 {
    let norm = length.sqrt();
    let missed = widest(
        #[inline(always)]
        || {
            *scale = step_of(column, LARGEST);
            rounding_of(column, *scale, rounded)
        },
    );
    let of_sums = (column.len() / LANES + 2 * LANES) as f64 * f64::EPSILON;
    missed.sqrt() * (1.0 + of_sums) + of_sums * norm
}

/// A power of two that takes the largest entry to the largest number, or to half of it; one for zeros.
#[inline(always)]
fn step_of(column: &[f64], largest: f64) -> f64 {
    let mut most = [0.0_f64; LANES];
    let parts = column.chunks_exact(LANES);
    let rest = parts.remainder().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    for values in parts {
        for lane in 0..LANES {
            let size = values[lane].abs();
            most[lane] = if size > most[lane] { size } else { most[lane] };
        }
    }
    let least = most.iter().copied().fold(rest, f64::max) / largest;
    if least < f64::MIN_POSITIVE {
        return 1.0;
    }
    2.0 * f64::from_bits(least.to_bits() & f64::INFINITY.to_bits())
}

/// Write rounded entries; squared length of what they miss.
#[inline(always)]
fn rounding_of(column: &[f64], step: f64, rounded: &mut [Whole]) -> f64 {
    let mut sums = [0.0; LANES];
    let factor = 1.0 / step;
    let (whole, tail) = column.split_at(column.len() / BLOCK * BLOCK);
    for (entries, values) in rounded.iter_mut().zip(whole.chunks_exact(BLOCK)) {
        let parts = entries.chunks_exact_mut(LANES).zip(values.chunks_exact(LANES));
        for (entries, values) in parts {
            for lane in 0..LANES {
                let nearest = nearest(values[lane] * factor);
                entries[lane] = nearest as i32 as i16;
                let missed = values[lane] - step * nearest;
                sums[lane] += missed * missed;
            }
        }
    }
    let entries = rounded.iter_mut().skip(whole.len() / BLOCK).flatten();
    for (entry, value) in entries.zip(tail) {
        let nearest = nearest(value * factor);
        *entry = nearest as i32 as i16;
        sums[0] += (value - step * nearest).powi(2);
    }
    sums.iter().sum()
}

/// The nearest whole number of a small one: beyond 2⁵² a number has no fraction left.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    const HIGH: f64 = 6_755_399_441_055_744.0;
    (value + HIGH) - HIGH
}

/// Sums of products of columns with both digits.
#[inline(always)]
fn products(columns: [&[Whole]; ROWS], digits: &Digits) -> [[i64; 2]; ROWS] {
    let mut sums = [[0; 2]; ROWS];
    for (place, (high, low)) in digits.high.iter().zip(&digits.low).enumerate() {
        for (sums, column) in sums.iter_mut().zip(columns) {
            if let Some(values) = column.get(place) {
                sums[0] += i64::from(sum_of_products(values, high));
                sums[1] += i64::from(sum_of_products(values, low));
            }
        }
    }
    sums
}

/// Thirty-two bits hold it: 64 · 32,767 · 1,023 < 2³¹.
#[inline(always)]
fn sum_of_products(column: &Whole, digits: &Whole) -> i32 {
    let each = column.iter().zip(digits).map(|(x, v)| i32::from(*x) * i32::from(*v));
    each.fold(0, i32::wrapping_add)
}

#[cfg(test)]
#[path = "tests/rounded_columns.rs"]
mod tests;
