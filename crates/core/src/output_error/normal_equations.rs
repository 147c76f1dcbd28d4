//! Normal equations of many rows in few columns: gathered in tiles that stay in registers, one
//! record's own columns eliminated, and the triangle of what is left.
//! (Python side: identification/output_error/fit.py)
//!
//! Reference: Golub & Van Loan, *Matrix Computations*, 4th ed., §4.2.9 and §5.3.

use crate::numerics::widest::widest;
use crate::output_error::model_on_records::LANES;

/// Below this share of its square a column counts as a combination of those before it. Sums of
/// thousands of samples leave 1e-13 of one that repeats another; a step along that goes anywhere.
const DEPENDENT: f64 = 1e-11;

/// gram += rowsᵀ rows on and above the diagonal of tiles, over the first of each `every` rows;
/// `stride` is a multiple of `LANES`.
pub fn add_rows(gram: &mut [f64], rows: &[f64], stride: usize, every: usize) {
    widest(
        #[inline(always)]
        || add_rows_here(gram, rows, stride, every),
    );
}

#[inline(always)]
fn add_rows_here(gram: &mut [f64], rows: &[f64], stride: usize, every: usize) {
    for first in (0..stride).step_by(LANES) {
        let mut second = first;
        while second + 2 * LANES <= stride {
            add_tile::<{ 2 * LANES }>(gram, rows, (stride, every), first, second);
            second += 2 * LANES;
        }
        if second < stride {
            add_tile::<LANES>(gram, rows, (stride, every), first, second);
        }
    }
}

/// A few columns times a few more, the sums in registers.
#[inline(always)]
fn add_tile<const W: usize>(
    gram: &mut [f64],
    rows: &[f64],
    (stride, every): (usize, usize),
    first: usize,
    second: usize,
) {
    let mut tile = [[0.0; W]; LANES];
    for row in rows.chunks(every * stride) {
        let (Some(left), Some(right)) =
            (row[first..].first_chunk::<LANES>(), row[second..].first_chunk::<W>())
        else {
            continue;
        };
        for (line, factor) in tile.iter_mut().zip(left) {
            for (entry, value) in line.iter_mut().zip(right) {
                *entry += factor * value;
            }
        }
    }
    for (offset, line) in tile.iter().enumerate() {
        let start = (first + offset) * stride + second;
        for (entry, value) in gram[start..start + W].iter_mut().zip(line) {
            *entry += value;
        }
    }
}

/// What the elimination of the first columns of normal equations leaves.
#[derive(Debug, Clone, Default)]
pub struct Elimination {
    /// Rows of the triangle of the eliminated columns, (own × width), row-major.
    pub rows: Vec<f64>,
    /// Whether a column is no combination of those before it.
    pub kept: Vec<bool>,
    /// Normal equations of the others, (rest × rest), row-major.
    pub rest: Vec<f64>,
    /// Share of the last diagonal that the elimination took.
    pub beside: f64,
}

/// Eliminate the first `own` of `width` columns; the last column is the residual.
pub fn eliminate(gram: &mut [f64], own: usize, width: usize) -> Elimination {
    let mut found = Elimination { kept: vec![true; own], ..Elimination::default() };
    let original: Vec<f64> = (0..own).map(|k| gram[k * (width + 1)]).collect();
    for k in 0..own {
        let pivot = gram[k * (width + 1)];
        if pivot > DEPENDENT * original[k] && pivot.is_normal() {
            let root = pivot.sqrt();
            found.rows.extend(gram[k * width..(k + 1) * width].iter().map(|value| value / root));
        } else {
            found.kept[k] = false;
            found.rows.extend(std::iter::repeat_n(0.0, width));
        }
        let row = &found.rows[k * width..(k + 1) * width];
        for i in k + 1..width {
            for j in i..width {
                gram[i * width + j] -= row[i] * row[j];
            }
        }
        found.beside += row[width - 1] * row[width - 1];
    }
    let rest = width - own;
    found.rest = (0..rest * rest)
        .map(|place| {
            let (i, j) = (place / rest, place % rest);
            gram[(own + i.min(j)) * width + own + i.max(j)]
        })
        .collect();
    found
}

impl Elimination {
    /// −R⁻¹(share · q + S · change): where the eliminated numbers go when the others move.
    pub fn step(&self, change: &[f64], share: f64) -> Vec<f64> {
        let own = self.kept.len();
        let width = own + change.len() + 1;
        let mut step = vec![0.0; own];
        for k in (0..own).rev().filter(|&k| self.kept[k]) {
            let row = &self.rows[k * width..(k + 1) * width];
            let moved: f64 = row[own..].iter().zip(change).map(|(r, d)| r * d).sum();
            let later: f64 = (k + 1..own).map(|j| row[j] * step[j]).sum();
            step[k] = -(share * row[width - 1] + moved + later) / row[k];
        }
        step
    }
}

/// Triangle R (columns contiguous) and Qᵀr from normal equations of n columns and the residual.
pub fn triangle(gram: &[f64], n: usize, triangle: &mut [f64], projected: &mut [f64]) {
    let mut work = gram.to_vec();
    let found = eliminate(&mut work, n, n + 1);
    for i in 0..n {
        for j in 0..n {
            triangle[j * n + i] = if j < i { 0.0 } else { found.rows[i * (n + 1) + j] };
        }
        projected[i] = found.rows[i * (n + 1) + n];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of [1, x, x² | y] with y = 2 + 3x + x², padded to the lanes.
    fn rows() -> Vec<f64> {
        (0..7)
            .flat_map(|k| {
                let x = f64::from(k) / 3.0;
                [1.0, x, x * x, 2.0 + 3.0 * x + x * x]
            })
            .collect()
    }

    #[test]
    fn elimination_and_triangle_solve_least_squares() {
        let mut gram = vec![0.0; 16];
        add_rows(&mut gram, &rows(), 4, 1);
        let found = eliminate(&mut gram.clone(), 1, 4);
        let (mut r, mut q) = (vec![0.0; 4], vec![0.0; 2]);
        triangle(&found.rest, 2, &mut r, &mut q);
        let second = -q[1] / r[3];
        let first = -(q[0] + r[2] * second) / r[0];
        let own = found.step(&[first, second], 1.0);
        for (value, expected) in [own[0], first, second].iter().zip([-2.0, -3.0, -1.0]) {
            assert!((value - expected).abs() < 1e-11, "{value} {expected}");
        }
    }

    #[test]
    fn what_rounding_leaves_of_a_copy_is_no_column() {
        for (left, kept) in [(5e-13, false), (1e-9, true)] {
            let mut gram = vec![1.0, 1.0, 0.3, 1.0, 1.0 + left, 0.3 + 1e-9, 0.3, 0.3 + 1e-9, 1.0];
            let found = eliminate(&mut gram, 2, 3);
            assert_eq!(found.kept, [true, kept]);
            assert_eq!(found.step(&[], 1.0)[1] != 0.0, kept);
        }
    }

    #[test]
    fn a_copy_of_a_column_is_left_alone() {
        let double: Vec<f64> =
            rows().chunks_exact(4).flat_map(|row| [row[1], row[1], row[0], row[3]]).collect();
        let mut gram = vec![0.0; 16];
        add_rows(&mut gram, &double, 4, 1);
        let found = eliminate(&mut gram, 2, 4);
        assert_eq!(found.kept, [true, false]);
        assert_eq!(found.step(&[0.0], 1.0)[1], 0.0);
    }
}
