//! Residuals of a model against frequency responses, for the Levenberg–Marquardt. (Python side:
//! identification/frequency_domain/fit.py)
//!
//! Two costs: the coherence-weighted sum of squared decibels and degrees (Tischler & Remple, eq.
//! 11.4 and 12.24), with weights that the caller prepares; and the whitened complex error
//! (generalised least squares, which is maximum likelihood for Gaussian errors of known covariance).

use num_complex::Complex64;
use rayon::prelude::*;

use crate::error::CoreError;
use crate::fits::least_squares::{Minimum, Options, Problem, Progress};
use crate::fits::levenberg_marquardt::minimise;
use crate::frequency_domain::response_model::ResponseModel;

const DECIBEL: f64 = 20.0 / std::f64::consts::LN_10;
const DEGREE: f64 = 180.0 / std::f64::consts::PI;

/// One measured response on the frequencies of the fit.
#[derive(Debug, Clone)]
pub struct Measured {
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Response.
    pub response: Vec<Complex64>,
    /// Square root of the weight of a squared decibel.
    pub weight_db: Vec<f64>,
    /// Square root of the weight of a squared degree.
    pub weight_deg: Vec<f64>,
}

/// Whitening of a run of consecutive responses: an m × m matrix W (row-major), or the m numbers of its
/// diagonal, applied to the errors stacked as all real parts, then all imaginary parts, in the order
/// of the responses.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// First response of the run.
    pub first: usize,
    /// Number of responses in it.
    pub count: usize,
    /// W, with WᵀW the inverse of the covariance; of m numbers, its diagonal.
    pub matrix: Vec<f64>,
}

/// What is minimised.
#[derive(Debug, Clone)]
pub enum Cost {
    /// Weighted decibels and degrees.
    DecibelPhase,
    /// Whitened complex errors; the runs cover every response once, in order.
    Whitened(Vec<Whitening>),
}

/// A fit of one model to several responses.
#[derive(Debug, Clone)]
pub struct FrequencyFit<'a, M> {
    model: M,
    data: &'a [Measured],
    cost: &'a Cost,
    errors: Vec<f64>,
    slopes: Vec<f64>,
    values: Vec<Complex64>,
    gradients: Vec<Complex64>,
}

impl<'a, M: ResponseModel> FrequencyFit<'a, M> {
    /// Check that data, weights and model belong together.
    ///
    /// # Errors
    /// `Shape` or `NotFinite`.
    pub fn new(model: M, data: &'a [Measured], cost: &'a Cost) -> Result<Self, CoreError> {
        same("measured responses", data.len(), model.n_responses())?;
        for each in data {
            let needed = each.omega.len();
            same("response values", each.response.len(), needed)?;
            same("decibel weights", each.weight_db.len(), needed)?;
            same("degree weights", each.weight_deg.len(), needed)?;
            let bad = each.response.iter().position(|h| !(h.is_finite() && h.norm_sqr() > 0.0));
            if let Some(index) = bad {
                return Err(CoreError::NotFinite { what: "log of a measured response", index });
            }
        }
        if let Cost::Whitened(runs) = cost {
            let mut next = 0;
            for run in runs {
                same("first response of a whitening", run.first, next)?;
                next += run.count;
                same("responses of a whitening", next.min(data.len()), next)?;
                let m = 2 * points(&data[run.first..next]);
                let needed = if run.matrix.len() == m { m } else { m * m };
                same("entries of a whitening", run.matrix.len(), needed)?;
            }
            same("whitened responses", next, data.len())?;
        }
        let (errors, slopes) = (Vec::new(), Vec::new());
        let most = data.iter().map(|each| each.omega.len()).max().unwrap_or(0);
        let values = vec![Complex64::default(); most];
        let gradients = vec![Complex64::default(); most * model.n_free()];
        Ok(Self { model, data, cost, errors, slopes, values, gradients })
    }

    /// Values of one response at its frequencies, and gradients where wanted.
    fn evaluate(&mut self, index: usize, with_gradient: bool) {
        let omega = &self.data[index].omega;
        let values = &mut self.values[..omega.len()];
        let gradients = &mut self.gradients[..omega.len() * self.model.n_free()];
        self.model.responses(index, omega, values, with_gradient.then_some(gradients));
    }

    fn decibel_phase(&mut self, residuals: Option<&mut [f64]>, jacobian: Option<&mut [f64]>) {
        let n = self.model.n_free();
        let mut residuals = residuals.unwrap_or_default().chunks_exact_mut(2);
        let mut jacobian = jacobian.unwrap_or_default().chunks_exact_mut((2 * n).max(1));
        for (index, each) in self.data.iter().enumerate() {
            self.evaluate(index, jacobian.len() > 0);
            for k in 0..each.omega.len() {
                let ratio = self.values[k] / each.response[k];
                let (db, deg) = (each.weight_db[k] * DECIBEL, each.weight_deg[k] * DEGREE);
                if let Some(pair) = residuals.next() {
                    // The angle of the ratio is the phase difference, already wrapped to ±180°.
                    pair[0] = db * ratio.norm().ln();
                    pair[1] = deg * ratio.arg();
                }
                if let Some(rows) = jacobian.next() {
                    let (above, below) = rows.split_at_mut(n);
                    let slopes = &self.gradients[k * n..(k + 1) * n];
                    for ((gain, phase), slope) in above.iter_mut().zip(below).zip(slopes) {
                        (*gain, *phase) = (db * slope.re, deg * slope.im);
                    }
                }
            }
        }
    }

    /// Stacked complex errors (and slopes) of a run, then W times them.
    fn whitened(
        &mut self,
        run: &Whitening,
        residuals: Option<&mut [f64]>,
        jacobian: Option<&mut [f64]>,
    ) {
        let n = self.model.n_free();
        let data = &self.data[run.first..run.first + run.count];
        let half = points(data);
        let wants_slopes = jacobian.is_some();
        self.errors.resize(2 * half, 0.0);
        self.slopes.resize(2 * half * n, 0.0);
        let mut place = 0;
        for (offset, each) in data.iter().enumerate() {
            self.evaluate(run.first + offset, wants_slopes);
            for k in 0..each.omega.len() {
                let value = self.values[k];
                let error = value - each.response[k];
                (self.errors[place], self.errors[half + place]) = (error.re, error.im);
                if wants_slopes {
                    let gradient = &self.gradients[k * n..(k + 1) * n];
                    for (column, slope) in gradient.iter().enumerate() {
                        let slope = value * slope;
                        self.slopes[place * n + column] = slope.re;
                        self.slopes[(half + place) * n + column] = slope.im;
                    }
                }
                place += 1;
            }
        }
        if let Some(residuals) = residuals {
            multiply(&run.matrix, &self.errors, 1, residuals);
        }
        if let Some(jacobian) = jacobian {
            multiply(&run.matrix, &self.slopes, n, jacobian);
        }
    }

    fn fill(&mut self, mut residuals: Option<&mut [f64]>, mut jacobian: Option<&mut [f64]>) {
        let cost = self.cost;
        let Cost::Whitened(runs) = cost else {
            return self.decibel_phase(residuals, jacobian);
        };
        let n = self.model.n_free();
        let mut start = 0;
        for run in runs {
            let end = start + 2 * points(&self.data[run.first..run.first + run.count]);
            let rows = residuals.as_deref_mut().map(|all| &mut all[start..end]);
            let slopes = jacobian.as_deref_mut().map(|all| &mut all[start * n..end * n]);
            self.whitened(run, rows, slopes);
            start = end;
        }
    }
}

fn points(data: &[Measured]) -> usize {
    data.iter().map(|each| each.omega.len()).sum()
}

fn same(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

/// result (m × n) = a (m × m) · b (m × n), all row-major; of an a of m numbers, its diagonal.
fn multiply(a: &[f64], b: &[f64], n: usize, result: &mut [f64]) {
    result.fill(0.0);
    if n == 0 {
        return;
    }
    let m = b.len() / n;
    if a.len() == m {
        for ((out, line), factor) in result.chunks_exact_mut(n).zip(b.chunks_exact(n)).zip(a) {
            out.iter_mut().zip(line).for_each(|(entry, value)| *entry = factor * value);
        }
        return;
    }
    for (row, out) in result.chunks_exact_mut(n).enumerate() {
        for (&factor, line) in a[row * m..(row + 1) * m].iter().zip(b.chunks_exact(n)) {
            for (entry, &value) in out.iter_mut().zip(line) {
                *entry += factor * value;
            }
        }
    }
}

impl<M: ResponseModel> Problem for FrequencyFit<'_, M> {
    fn n_parameters(&self) -> usize {
        self.model.n_free()
    }

    fn n_residuals(&self) -> usize {
        2 * points(self.data)
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError> {
        self.model.prepare(x, false)?;
        self.fill(Some(residuals), None);
        require_finite(residuals)
    }

    fn makes_both(&self) -> bool {
        true
    }

    fn both(
        &mut self,
        x: &[f64],
        residuals: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), CoreError> {
        self.model.prepare(x, true)?;
        self.fill(Some(residuals), Some(jacobian));
        require_finite(residuals)
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut [f64]) -> Result<(), CoreError> {
        self.model.prepare(x, true)?;
        self.fill(None, Some(jacobian));
        Ok(())
    }
}

fn require_finite(residuals: &[f64]) -> Result<(), CoreError> {
    match residuals.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "the model's response", index }),
        None => Ok(()),
    }
}

/// Minimise from several starts, in parallel, until `stop` says true; the answers keep the order of
/// the starts. One start runs on the calling thread.
pub fn minimise_from<P: Problem + Clone + Sync>(
    problem: &P,
    starts: &[Vec<f64>],
    lower: &[f64],
    upper: &[f64],
    options: &Options,
    stop: &(dyn Fn() -> bool + Sync),
) -> Vec<Result<Minimum, CoreError>> {
    let one = |start: &Vec<f64>| {
        let proceed = &mut |_: &Progress<'_>| !stop();
        minimise(&mut problem.clone(), start, lower, upper, options, proceed)
    };
    match starts {
        [only] => vec![one(only)],
        _ => starts.par_iter().map(one).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::multiply;

    #[test]
    fn a_diagonal_weighs_as_its_whole_matrix_does() {
        let (diagonal, b) = ([2.0, -0.5, 3.0], [1.0, 4.0, -2.0, 8.0, 0.25, 5.0]);
        let whole = [2.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 3.0];
        let (mut short, mut long) = ([9.0; 6], [9.0; 6]);
        multiply(&diagonal, &b, 2, &mut short);
        multiply(&whole, &b, 2, &mut long);
        assert_eq!(short, long);
        assert_eq!(short, [2.0, 8.0, 1.0, -4.0, 0.75, 15.0]);
    }
}
