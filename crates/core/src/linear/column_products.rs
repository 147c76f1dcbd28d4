//! Products of columns with each other, summed over blocks of samples. (Python side: none)

use crate::linear::block_recursion::BLOCK;

const LANES: usize = 16;

/// Columns of one block, and the sums of their products.
#[derive(Debug, Clone)]
pub struct ColumnProducts {
    columns: Vec<[f64; BLOCK]>,
    sums: Vec<f64>,
}

impl ColumnProducts {
    /// Of so many columns, of zeros.
    pub fn new(count: usize) -> Self {
        Self { columns: vec![[0.0; BLOCK]; count], sums: vec![0.0; count * count] }
    }

    /// A column of the block.
    #[inline(always)]
    pub fn column(&mut self, at: usize) -> &mut [f64; BLOCK] {
        &mut self.columns[at]
    }

    /// A column becomes the block of a row from a place on; zeros after its end.
    #[inline(always)]
    pub fn take(&mut self, at: usize, row: &[f64], first: usize) {
        let (part, column) = (&row[first..row.len().min(first + BLOCK)], &mut self.columns[at]);
        column[..part.len()].copy_from_slice(part);
        column[part.len()..].fill(0.0);
    }

    /// Add products of all columns.
    #[inline(always)]
    pub fn add(&mut self) {
        self.add_first(self.columns.len());
    }

    /// Add products of the first columns alone.
    #[inline(always)]
    pub fn add_first(&mut self, count: usize) {
        let width = self.columns.len();
        for i in 0..count {
            for j in i..count {
                self.sums[i * width + j] += product(&self.columns[i], &self.columns[j]);
            }
        }
    }

    /// Sums of the products of all columns with all, row-major.
    pub fn filled(self) -> Vec<f64> {
        let (width, mut sums) = (self.columns.len(), self.sums);
        for i in 0..width {
            for j in 0..i {
                sums[i * width + j] = sums[j * width + i];
            }
        }
        sums
    }
}

#[inline(always)]
fn product(a: &[f64; BLOCK], b: &[f64; BLOCK]) -> f64 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_whole_columns() {
        let rows: [Vec<f64>; 3] =
            std::array::from_fn(|i| (0..150).map(|k| ((i * 31 + k * 7) as f64).sin()).collect());
        let mut of = ColumnProducts::new(3);
        for first in (0..150).step_by(BLOCK) {
            rows.iter().enumerate().for_each(|(at, row)| of.take(at, row, first));
            of.add();
        }
        let found = of.filled();
        for (i, a) in rows.iter().enumerate() {
            for (j, b) in rows.iter().enumerate() {
                let wanted: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!((found[i * 3 + j] - wanted).abs() < 1e-12);
            }
        }
    }
}
