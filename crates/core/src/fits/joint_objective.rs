//! Two sums of squares of the same variables as one, so that a fit may weigh different kinds of data
//! by their likelihoods. (Python side: identification/joint/fit.py)

use crate::error::CoreError;
use crate::fits::least_squares::{Objective, Point};
use crate::numerics::householder::triangularise;

/// Sum of two objectives of the same variables.
pub struct Joint<'a, A, B> {
    first: &'a mut A,
    second: &'a mut B,
    other: Point,
    work: Vec<f64>,
}

impl<'a, A: Objective, B: Objective> Joint<'a, A, B> {
    /// Add two objectives.
    ///
    /// # Errors
    /// `Shape` where they do not have the same variables.
    pub fn new(first: &'a mut A, second: &'a mut B) -> Result<Self, CoreError> {
        let (needed, found) = (first.n_parameters(), second.n_parameters());
        if found != needed {
            return Err(CoreError::Shape { what: "variables of a joint fit", found, needed });
        }
        Ok(Self { first, second, other: Point::new(needed), work: Vec::new() })
    }
}

impl<A: Objective, B: Objective> Objective for Joint<'_, A, B> {
    fn n_parameters(&self) -> usize {
        self.first.n_parameters()
    }

    fn cost(&mut self, x: &[f64]) -> Result<f64, CoreError> {
        Ok(self.first.cost(x)? + self.second.cost(x)?)
    }

    fn begin(&mut self, x: &[f64]) -> Result<(), CoreError> {
        self.first.begin(x)?;
        self.second.begin(x)
    }

    fn project(&self, x: &mut [f64]) {
        self.first.project(x);
        self.second.project(x);
    }

    /// The triangle of two triangles, one on top of the other.
    fn linearise(&mut self, x: &[f64], point: &mut Point) -> Result<(), CoreError> {
        self.first.linearise(x, point)?;
        self.second.linearise(x, &mut self.other)?;
        point.cost += self.other.cost;
        point.beside += self.other.beside;
        let n = x.len();
        let m = 2 * n;
        self.work.clear();
        for (upper, lower) in
            point.triangle.chunks_exact(n.max(1)).zip(self.other.triangle.chunks_exact(n.max(1)))
        {
            self.work.extend_from_slice(upper);
            self.work.extend_from_slice(lower);
        }
        self.work.extend_from_slice(&point.projected);
        self.work.extend_from_slice(&self.other.projected);
        triangularise(&mut self.work, m, n);
        for j in 0..n {
            point.triangle[j * n..(j + 1) * n].copy_from_slice(&self.work[j * m..j * m + n]);
        }
        point.projected.copy_from_slice(&self.work[m * n..m * n + n]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fits::dense_problem::Dense;
    use crate::fits::least_squares::{Options, Problem};
    use crate::fits::levenberg_marquardt::search;

    /// Residuals w (a·x − b) of two variables, one row.
    struct Line {
        weight: f64,
        a: [f64; 2],
        b: f64,
    }

    impl Problem for Line {
        fn n_parameters(&self) -> usize {
            2
        }
        fn n_residuals(&self) -> usize {
            1
        }
        fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError> {
            residuals[0] = self.weight * (self.a[0] * x[0] + self.a[1] * x[1] - self.b);
            Ok(())
        }
        fn jacobian(&mut self, _: &[f64], jacobian: &mut [f64]) -> Result<(), CoreError> {
            jacobian.copy_from_slice(&[self.weight * self.a[0], self.weight * self.a[1]]);
            Ok(())
        }
    }

    #[test]
    fn what_neither_decides_alone_both_do() {
        let (mut one, mut two) = (
            Line { weight: 3.0, a: [1.0, 1.0], b: 5.0 },
            Line { weight: 0.1, a: [1.0, -2.0], b: -4.0 },
        );
        let (mut one, mut two) = (Dense::new(&mut one), Dense::new(&mut two));
        let mut joint = Joint::new(&mut one, &mut two).unwrap();
        let bounds = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]);
        let options = Options::default();
        let found =
            search(&mut joint, &[0.0, 0.0], &bounds.0, &bounds.1, &options, &mut |_| true).unwrap();
        assert!((found.x[0] - 2.0).abs() < 1e-9 && (found.x[1] - 3.0).abs() < 1e-9, "{found:?}");
        // RᵀR = Σ w² a aᵀ, to rounding.
        let r = &found.triangle;
        let corner = r[2] * r[2] + r[3] * r[3];
        assert!((r[0] * r[0] - 9.01).abs() < 1e-12 && (corner - 9.04).abs() < 1e-12, "{r:?}");
    }

    #[test]
    fn different_variables_are_refused() {
        struct None;
        impl Problem for None {
            fn n_parameters(&self) -> usize {
                0
            }
            fn n_residuals(&self) -> usize {
                0
            }
            fn residuals(&mut self, _: &[f64], _: &mut [f64]) -> Result<(), CoreError> {
                Ok(())
            }
            fn jacobian(&mut self, _: &[f64], _: &mut [f64]) -> Result<(), CoreError> {
                Ok(())
            }
        }
        let (mut one, mut two) = (Line { weight: 1.0, a: [1.0, 1.0], b: 0.0 }, None);
        let (mut one, mut two) = (Dense::new(&mut one), Dense::new(&mut two));
        assert!(Joint::new(&mut one, &mut two).is_err());
    }
}
