//! The triangle of a tall Jacobian from its normal equations where they keep enough digits, else by
//! reflections. (Python side: none)
//!
//! Reference: Golub & Van Loan, *Matrix Computations*, 4th ed., §5.3.2 (normal equations) and 4.2.3.

use crate::numerics::householder::triangularise;
use crate::numerics::widest::widest;

/// Smallest diagonal of the triangle, of columns scaled to unit length, at which the squared
/// condition of the normal equations leaves a step ten good digits.
const LEAST_DIAGONAL: f64 = 1e-3;
/// Rows that are added to the normal equations at a time.
const ROWS: usize = 4;

/// Triangle R (n × n, columns contiguous) and Qᵀr (n) of a row-major Jacobian (m × n).
pub fn triangle_of(
    jacobian: &[f64],
    residuals: &[f64],
    n: usize,
    work: &mut Vec<f64>,
    triangle: &mut [f64],
    projected: &mut [f64],
) {
    triangle.fill(0.0);
    projected.fill(0.0);
    let m = residuals.len();
    if n == 0 || m == 0 {
        return;
    }
    if m <= 2 * n || !by_normal_equations(jacobian, residuals, n, work, triangle, projected) {
        by_reflections(jacobian, residuals, n, work, triangle, projected);
    }
}

fn by_reflections(
    jacobian: &[f64],
    residuals: &[f64],
    n: usize,
    work: &mut Vec<f64>,
    triangle: &mut [f64],
    projected: &mut [f64],
) {
    let m = residuals.len();
    work.clear();
    work.resize(m * (n + 1), 0.0);
    for (row, entries) in jacobian.chunks_exact(n).enumerate() {
        for (column, &entry) in entries.iter().enumerate() {
            work[column * m + row] = entry;
        }
    }
    work[m * n..].copy_from_slice(residuals);
    triangularise(work, m, n);
    triangle.fill(0.0);
    projected.fill(0.0);
    let rows = n.min(m);
    for j in 0..n {
        triangle[j * n..j * n + rows].copy_from_slice(&work[j * m..j * m + rows]);
    }
    projected[..rows].copy_from_slice(&work[m * n..m * n + rows]);
}

/// Cholesky factor of JᵀJ; false where too few digits are left.
fn by_normal_equations(
    jacobian: &[f64],
    residuals: &[f64],
    n: usize,
    work: &mut Vec<f64>,
    triangle: &mut [f64],
    projected: &mut [f64],
) -> bool {
    work.clear();
    work.resize(n * n + n, 0.0);
    let (gram, right) = work.split_at_mut(n * n);
    widest(
        #[inline(always)]
        || gather(jacobian, residuals, n, gram, right),
    );
    let length: Vec<f64> = (0..n).map(|j| gram[j * n + j].sqrt()).collect();
    // Zero columns, overflow and underflow belong to the reflections.
    if !length.iter().all(|&l| (1e-100..1e100).contains(&l)) {
        return false;
    }
    for j in 0..n {
        for i in 0..=j {
            let head = (0..i).map(|k| triangle[i * n + k] * triangle[j * n + k]).sum::<f64>();
            let left = gram[i * n + j] - head;
            if i < j {
                triangle[j * n + i] = left / triangle[i * n + i];
            } else if left.sqrt() >= LEAST_DIAGONAL * length[j] {
                triangle[j * n + j] = left.sqrt();
            } else {
                return false;
            }
        }
    }
    for j in 0..n {
        let head = (0..j).map(|k| triangle[j * n + k] * projected[k]).sum::<f64>();
        projected[j] = (right[j] - head) / triangle[j * n + j];
    }
    true
}

/// Upper half of JᵀJ, row-major, and Jᵀr.
#[inline(always)]
fn gather(jacobian: &[f64], residuals: &[f64], n: usize, gram: &mut [f64], right: &mut [f64]) {
    let (blocks, values) = (jacobian.chunks_exact(ROWS * n), residuals.chunks_exact(ROWS));
    let (rest, left) = (blocks.remainder(), values.remainder());
    for (block, value) in blocks.zip(values) {
        let (a, others) = block.split_at(n);
        let (b, others) = others.split_at(n);
        let (c, d) = others.split_at(n);
        for i in 0..n {
            let (fa, fb, fc, fd) = (a[i], b[i], c[i], d[i]);
            right[i] += fa * value[0] + fb * value[1] + (fc * value[2] + fd * value[3]);
            let row = &mut gram[i * n + i..(i + 1) * n];
            let columns = a[i..].iter().zip(&b[i..]).zip(c[i..].iter().zip(&d[i..]));
            for (entry, ((a, b), (c, d))) in row.iter_mut().zip(columns) {
                *entry += fa * a + fb * b + (fc * c + fd * d);
            }
        }
    }
    for (row, &value) in rest.chunks_exact(n).zip(left) {
        for i in 0..n {
            right[i] += row[i] * value;
            for (entry, other) in gram[i * n + i..(i + 1) * n].iter_mut().zip(&row[i..]) {
                *entry += row[i] * other;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(jacobian: &[f64], residuals: &[f64], n: usize) -> [(Vec<f64>, Vec<f64>); 2] {
        let mut work = Vec::new();
        let zeros = || (vec![0.0; n * n], vec![0.0; n]);
        let (mut one, mut other) = (zeros(), zeros());
        triangle_of(jacobian, residuals, n, &mut work, &mut one.0, &mut one.1);
        by_reflections(jacobian, residuals, n, &mut work, &mut other.0, &mut other.1);
        [one, other]
    }

    #[test]
    fn both_ways_give_one_triangle() {
        let n = 5;
        let wave = |k: usize| ((k * k + 3 * k) as f64 * 0.37).sin();
        let jacobian: Vec<f64> = (0..31 * n).map(wave).collect();
        let residuals: Vec<f64> = (0..31).map(|k| wave(7 * k + 1)).collect();
        let [(r, q), (s, p)] = both(&jacobian, &residuals, n);
        for i in 0..n {
            // Rows may differ in sign.
            let sign = (r[i * n + i] * s[i * n + i]).signum();
            assert!((q[i] - sign * p[i]).abs() < 1e-12);
            for j in i..n {
                assert!((r[j * n + i] - sign * s[j * n + i]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn near_copies_of_columns_keep_their_digits() {
        // The second column differs from the first by 1e-9: squared, the difference is lost.
        let jacobian: Vec<f64> = (0..20)
            .flat_map(|k| {
                let x = 1.0 + 0.1 * f64::from(k);
                [x, x + 1e-9 * (f64::from(k) - 9.5)]
            })
            .collect();
        let residuals = vec![1.0; 20];
        let [(r, _), (s, _)] = both(&jacobian, &residuals, 2);
        assert_eq!(r, s);
        assert!(r[3].abs() > 1e-9);
    }

    #[test]
    fn a_column_of_zeros_is_left_to_reflections() {
        let jacobian: Vec<f64> = (0..20).flat_map(|k| [f64::from(k), 0.0]).collect();
        let [(r, q), (s, p)] = both(&jacobian, &[1.0; 20], 2);
        assert_eq!((r, q), (s, p));
    }
}
