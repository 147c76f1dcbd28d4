//! A least-squares problem whose residuals and Jacobian are held whole, as the search sees it.
//! (Python side: identification/)

use crate::error::CoreError;
use crate::fits::least_squares::{Objective, Point, Problem};
use crate::fits::normal_triangle::triangle_of;
use crate::numerics::householder::dot;

/// Entries that are looked at together.
const CHUNK: usize = 256;

/// A problem whose residuals and Jacobian are held whole.
pub(crate) struct Dense<'a, P> {
    problem: &'a mut P,
    pub(crate) residuals: Vec<f64>,
    trial: Vec<f64>,
    pub(crate) jacobian: Vec<f64>,
    work: Vec<f64>,
    /// Whether the Jacobian is that of the point where the trial residuals are.
    together: bool,
}

impl<'a, P: Problem> Dense<'a, P> {
    pub(crate) fn new(problem: &'a mut P) -> Self {
        let m = problem.n_residuals();
        let (residuals, trial) = (vec![0.0; m], vec![0.0; m]);
        let (jacobian, work, together) = (Vec::new(), Vec::new(), false);
        Self { problem, residuals, trial, jacobian, work, together }
    }
}

impl<P: Problem> Objective for Dense<'_, P> {
    fn n_parameters(&self) -> usize {
        self.problem.n_parameters()
    }

    fn cost(&mut self, x: &[f64]) -> Result<f64, CoreError> {
        self.problem.residuals(x, &mut self.trial)?;
        Ok(dot(&self.trial, &self.trial))
    }

    fn begin(&mut self, x: &[f64]) -> Result<(), CoreError> {
        self.together = self.problem.makes_both();
        if self.together {
            self.jacobian.resize(self.trial.len() * x.len(), 0.0);
            self.problem.both(x, &mut self.trial, &mut self.jacobian)?;
        } else {
            self.problem.residuals(x, &mut self.trial)?;
        }
        match self.trial.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "the residuals at the start", index }),
            None => Ok(()),
        }
    }

    fn project(&self, x: &mut [f64]) {
        self.problem.project(x);
    }

    fn linearise(&mut self, x: &[f64], point: &mut Point) -> Result<(), CoreError> {
        std::mem::swap(&mut self.residuals, &mut self.trial);
        point.cost = dot(&self.residuals, &self.residuals);
        point.beside = 0.0;
        let n = x.len();
        self.work.clear();
        self.work.resize((n + 1) * (n + 1), 0.0);
        if self.together || !self.problem.triangle(x, &mut self.work)? {
            return self.triangularise_jacobian(x, point);
        }
        if let Some(index) = self.work.iter().position(|value| !value.is_finite()) {
            return Err(CoreError::NotFinite { what: "the triangle of the Jacobian", index });
        }
        for j in 0..n {
            let column = &self.work[j * (n + 1)..j * (n + 1) + n];
            point.triangle[j * n..(j + 1) * n].copy_from_slice(column);
        }
        point.projected.copy_from_slice(&self.work[n * (n + 1)..n * (n + 1) + n]);
        Ok(())
    }
}

impl<P: Problem> Dense<'_, P> {
    fn triangularise_jacobian(&mut self, x: &[f64], point: &mut Point) -> Result<(), CoreError> {
        let (n, m) = (x.len(), self.residuals.len());
        if !std::mem::take(&mut self.together) {
            self.jacobian.resize(m * n, 0.0);
            self.problem.jacobian(x, &mut self.jacobian)?;
        }
        if let Some(index) = first_not_finite(&self.jacobian) {
            return Err(CoreError::NotFinite { what: "the Jacobian", index });
        }
        let (triangle, projected) = (&mut point.triangle, &mut point.projected);
        triangle_of(&self.jacobian, &self.residuals, n, &mut self.work, triangle, projected);
        Ok(())
    }
}

/// Place of the first entry that is not finite; whole chunks are looked at without branches.
fn first_not_finite(values: &[f64]) -> Option<usize> {
    let bad = |chunk: &[f64]| chunk.iter().fold(false, |bad, value| bad | !value.is_finite());
    let chunk = values.chunks(CHUNK).position(bad)?;
    values.iter().skip(chunk * CHUNK).position(|v| !v.is_finite()).map(|k| chunk * CHUNK + k)
}
