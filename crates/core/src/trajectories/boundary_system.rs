//! The linear equations of multiple shooting with conditions at both ends of a record.
//!
//! ```text
//! F δ₀ = f,   δ_{s+1} − A_s δ_s = d_s  (s = 0 … S−1),   B δ_S = b
//! ```
//! Growing modes are set at the end (B) and the others at the beginning (F), so the solution depends
//! on its data without growth however long the record is. Elimination with row pivots inside the
//! narrow band of nonzeros.
//!
//! Reference: Ascher, Mattheij & Russell, *Numerical Solution of Boundary Value Problems for Ordinary
//! Differential Equations*, §4.3 and §7.2.

use crate::error::CoreError;

/// Transition matrices of the segments and the conditions at the ends; F above B, n × n together.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoundarySystem<'a> {
    /// Number of states.
    pub n: usize,
    /// Rows of F; the rows of B follow.
    pub n_forward: usize,
    /// F, then B, row-major.
    pub ends: &'a [f64],
    /// A_s, each n × n, row-major.
    pub transitions: &'a [f64],
}

impl BoundarySystem<'_> {
    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.transitions.len() / self.n + self.n
    }

    /// Replace right sides by solutions: rows f, d_0, …, d_{S−1}, b become δ_0, …, δ_S. `sides` has
    /// `width` columns, row-major.
    ///
    /// # Errors
    /// `Singular` where the conditions leave a mode open.
    pub fn solve(&self, sides: &mut [f64], width: usize) -> Result<(), CoreError> {
        let (n, size) = (self.n, self.size());
        let mut matrix = vec![0.0; size * size];
        for row in 0..size {
            self.fill(row, &mut matrix[row * size..(row + 1) * size]);
        }
        for k in 0..size {
            // Column k reaches fewer than 2n rows below its diagonal, and a row swapped up from
            // there fewer than 4n columns to the right.
            let last = (k + 2 * n).min(size);
            let stop = (k + 4 * n).min(size);
            let size_of = |row: usize| matrix[row * size + k].abs();
            let best = (k..last).fold(k, |b, row| if size_of(row) > size_of(b) { row } else { b });
            let pivot = matrix[best * size + k];
            if !(pivot.is_finite() && pivot != 0.0) {
                return Err(CoreError::Singular {
                    what: "the boundary conditions of the segments",
                });
            }
            if best != k {
                (k..stop).for_each(|j| matrix.swap(k * size + j, best * size + j));
                (0..width).for_each(|j| sides.swap(k * width + j, best * width + j));
            }
            for row in k + 1..last {
                let factor = matrix[row * size + k] / pivot;
                if factor == 0.0 {
                    continue;
                }
                for j in k + 1..stop {
                    matrix[row * size + j] -= factor * matrix[k * size + j];
                }
                for j in 0..width {
                    sides[row * width + j] -= factor * sides[k * width + j];
                }
            }
        }
        for k in (0..size).rev() {
            let stop = (k + 4 * n).min(size);
            for j in 0..width {
                let known: f64 =
                    (k + 1..stop).map(|i| matrix[k * size + i] * sides[i * width + j]).sum();
                sides[k * width + j] = (sides[k * width + j] - known) / matrix[k * size + k];
            }
        }
        Ok(())
    }

    fn fill(&self, row: usize, line: &mut [f64]) {
        let (n, size, forward) = (self.n, self.size(), self.n_forward);
        if row < forward {
            line[..n].copy_from_slice(&self.ends[row * n..(row + 1) * n]);
        } else if row < size - (n - forward) {
            let (segment, state) = ((row - forward) / n, (row - forward) % n);
            let transition = &self.transitions[(segment * n + state) * n..][..n];
            for (entry, value) in line[segment * n..].iter_mut().zip(transition) {
                *entry = -value;
            }
            line[(segment + 1) * n + state] = 1.0;
        } else {
            let condition = forward + row - (size - (n - forward));
            line[size - n..].copy_from_slice(&self.ends[condition * n..(condition + 1) * n]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_growing_and_a_decaying_mode_over_hundreds_of_e_folds() {
        // x₊ = diag(0.5, 20) x over 200 segments: the first is set at the start, the second at the end.
        let n_segments = 200;
        let transitions = [0.5, 0.0, 0.0, 20.0].repeat(n_segments);
        let ends = [1.0, 0.0, 0.0, 1.0];
        let system = BoundarySystem { n: 2, n_forward: 1, ends: &ends, transitions: &transitions };
        let mut sides = vec![0.0; system.size()];
        (sides[0], sides[system.size() - 1]) = (3.0, 7.0);
        system.solve(&mut sides, 1).unwrap();
        for segment in 0..=n_segments {
            let wanted = [
                3.0 * 0.5_f64.powi(segment as i32),
                7.0 * 20.0_f64.powi(segment as i32 - n_segments as i32),
            ];
            for (found, wanted) in sides[2 * segment..].iter().zip(wanted) {
                assert!((found - wanted).abs() <= 1e-14 * wanted.abs(), "{segment}");
            }
        }
    }

    #[test]
    fn satisfies_its_equations_and_refuses_open_modes() {
        let n = 3;
        let number = |k: usize| ((k * 7919 % 101) as f64 - 50.0) / 50.0;
        let transitions: Vec<f64> = (0..4 * 9).map(number).collect();
        let ends: Vec<f64> = (40..49).map(number).collect();
        let system = BoundarySystem { n, n_forward: 2, ends: &ends, transitions: &transitions };
        let sides: Vec<f64> = (60..60 + 2 * system.size()).map(number).collect();
        let mut found = sides.clone();
        system.solve(&mut found, 2).unwrap();
        for row in 0..system.size() {
            let mut line = vec![0.0; system.size()];
            system.fill(row, &mut line);
            for column in 0..2 {
                let sum: f64 =
                    line.iter().enumerate().map(|(k, v)| v * found[k * 2 + column]).sum();
                assert!((sum - sides[row * 2 + column]).abs() < 1e-11);
            }
        }
        let closed = BoundarySystem { ends: &[0.0; 9], ..system };
        assert!(matches!(closed.solve(&mut found, 2), Err(CoreError::Singular { .. })));
    }
}
