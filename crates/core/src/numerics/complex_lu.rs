//! Triangular factors of a small dense complex matrix, kept for many right-hand sides.

use num_complex::Complex64;

use crate::error::CoreError;

/// P·A = L·U with row pivoting, in one array.
///
/// Reference: Golub & Van Loan, *Matrix Computations*, 4th ed., algorithm 3.4.1.
#[derive(Debug, Clone, PartialEq)]
pub struct ComplexLu {
    n: usize,
    factors: Vec<Complex64>,
    pivots: Vec<usize>,
}

/// Size by which pivots are compared; cheaper than the norm and as good for the choice.
fn size(value: Complex64) -> f64 {
    value.re.abs() + value.im.abs()
}

impl ComplexLu {
    /// Factor an n × n matrix, row-major.
    ///
    /// # Errors
    /// `Shape` for a length that is not n², `Singular` where a pivot is zero or not finite.
    pub fn new(mut matrix: Vec<Complex64>, n: usize) -> Result<Self, CoreError> {
        if matrix.len() != n * n {
            let (found, needed) = (matrix.len(), n * n);
            return Err(CoreError::Shape { what: "entries of a matrix", found, needed });
        }
        let mut pivots = Vec::with_capacity(n);
        for k in 0..n {
            let mut best = k;
            for row in k + 1..n {
                if size(matrix[row * n + k]) > size(matrix[best * n + k]) {
                    best = row;
                }
            }
            if best != k {
                for column in 0..n {
                    matrix.swap(k * n + column, best * n + column);
                }
            }
            pivots.push(best);
            let pivot = matrix[k * n + k];
            if !(pivot.is_finite() && size(pivot) > 0.0) {
                return Err(CoreError::Singular { what: "jωM − F" });
            }
            let inverse = pivot.inv();
            let (above, below) = matrix.split_at_mut((k + 1) * n);
            let pivot_row = &above[k * n + k + 1..];
            for row in below.chunks_exact_mut(n) {
                if size(row[k]) == 0.0 {
                    continue;
                }
                let factor = row[k] * inverse;
                row[k] = factor;
                for (entry, &value) in row[k + 1..].iter_mut().zip(pivot_row) {
                    *entry -= factor * value;
                }
            }
        }
        Ok(Self { n, factors: matrix, pivots })
    }

    fn row(&self, row: usize) -> &[Complex64] {
        &self.factors[row * self.n..(row + 1) * self.n]
    }

    /// Replace b by A⁻¹ b.
    pub fn solve(&self, b: &mut [Complex64]) {
        for (k, &other) in self.pivots.iter().enumerate() {
            b.swap(k, other);
        }
        for k in 1..self.n {
            let sum: Complex64 = self.row(k)[..k].iter().zip(b.iter()).map(|(l, x)| l * x).sum();
            b[k] -= sum;
        }
        for k in (0..self.n).rev() {
            let row = self.row(k);
            let sum: Complex64 = row[k + 1..].iter().zip(&b[k + 1..]).map(|(u, x)| u * x).sum();
            b[k] = (b[k] - sum) / row[k];
        }
    }

    /// Replace b by A⁻ᵀ b (transposed, not conjugated).
    pub fn solve_transposed(&self, b: &mut [Complex64]) {
        for k in 0..self.n {
            let row = self.row(k);
            b[k] /= row[k];
            let value = b[k];
            for (entry, u) in b[k + 1..].iter_mut().zip(&row[k + 1..]) {
                *entry -= u * value;
            }
        }
        for k in (1..self.n).rev() {
            let value = b[k];
            for (entry, l) in b[..k].iter_mut().zip(&self.row(k)[..k]) {
                *entry -= l * value;
            }
        }
        for (k, &other) in self.pivots.iter().enumerate().rev() {
            b.swap(k, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_has_no_inverse_is_refused() {
        let ones = vec![Complex64::new(1.0, 0.0); 4];
        assert!(matches!(ComplexLu::new(ones, 2), Err(CoreError::Singular { .. })));
        assert!(matches!(ComplexLu::new(Vec::new(), 2), Err(CoreError::Shape { .. })));
        let nan = vec![Complex64::new(f64::NAN, 0.0)];
        assert!(matches!(ComplexLu::new(nan, 1), Err(CoreError::Singular { .. })));
    }

    proptest! {
        #[test]
        fn both_solutions_satisfy_their_equations(
            n in 1_usize..7,
            numbers in prop::collection::vec(-1.0_f64..1.0, 2 * 49 + 14),
        ) {
            let pick = |i: usize| Complex64::new(numbers[2 * i], numbers[2 * i + 1]);
            let mut a: Vec<_> = (0..n * n).map(pick).collect();
            // A zero leading entry forces a pivot; the shifts keep the condition moderate.
            for k in 0..n {
                a[k * n + (k + 1) % n] += 3.0;
            }
            let b: Vec<_> = (0..n).map(|i| pick(49 + i)).collect();
            let lu = ComplexLu::new(a.clone(), n).unwrap();
            let (mut x, mut y) = (b.clone(), b.clone());
            lu.solve(&mut x);
            lu.solve_transposed(&mut y);
            for i in 0..n {
                let plain: Complex64 = (0..n).map(|j| a[i * n + j] * x[j]).sum();
                let across: Complex64 = (0..n).map(|j| a[j * n + i] * y[j]).sum();
                prop_assert!((plain - b[i]).norm() < 1e-10 && (across - b[i]).norm() < 1e-10);
            }
        }
    }
}
