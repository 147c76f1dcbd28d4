//! Prediction of a NARX model: a sum of products of lags and of radial functions of all lags, run one
//! step, k steps or freely. (Python side: models/narx/model.py)
//!
//! Reference: Billings, *Nonlinear System Identification*, Wiley 2013, sections 2.2 and 12.4.

use rayon::prelude::*;

use crate::black_box::radial_basis::{Radial, require_finite};
use crate::error::CoreError;

/// One entry of the regressor vector: a channel (0 is the output, 1 the first input) and its lag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lag {
    /// 0 for the output, i for input i − 1.
    pub channel: usize,
    /// Samples back; at least 1 for the output.
    pub lag: usize,
}

/// A weighted product of regressors to powers; without factors it is the constant.
#[derive(Debug, Clone)]
pub struct Monomial {
    /// Weight.
    pub weight: f64,
    /// Index into the regressor vector, and its power.
    pub factors: Vec<(usize, i32)>,
}

/// The model, in the units of its data (normally scaled to unit deviation).
#[derive(Debug, Clone)]
pub struct Narx<'a> {
    /// Regressor vector.
    pub lags: Vec<Lag>,
    /// Constant, linear and polynomial terms.
    pub monomials: Vec<Monomial>,
    /// Radial functions of the whole regressor vector.
    pub radial: Radial<'a>,
    /// Their weights.
    pub radial_weights: &'a [f64],
    /// Lowest and highest output that a prediction may take; beyond it is held and flagged.
    pub bounds: (f64, f64),
}

/// Predicted output and the first sample at which the guard held it.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// One value for each sample; the first `start` are the measured ones.
    pub output: Vec<f64>,
    /// Samples that only initialise the lags.
    pub start: usize,
    /// First sample at which a prediction left the bounds.
    pub diverged_at: Option<usize>,
}

impl Narx<'_> {
    /// Longest lag: the samples that initialise a run.
    pub fn start(&self) -> usize {
        self.lags.iter().map(|lag| lag.lag).max().unwrap_or(0)
    }

    fn check(&self, measured: &[f64], inputs: &[f64]) -> Result<usize, CoreError> {
        let n = measured.len();
        let start = self.start();
        if n <= start {
            let what = "samples for a prediction, beyond the longest lag";
            return Err(CoreError::Shape { what, found: n, needed: start + 1 });
        }
        let n_inputs = self.lags.iter().map(|lag| lag.channel).max().unwrap_or(0);
        if !inputs.len().is_multiple_of(n) || inputs.len() / n < n_inputs {
            let (found, needed) = (inputs.len(), n_inputs * n);
            return Err(CoreError::Shape { what: "input samples", found, needed });
        }
        if self.radial_weights.len() != self.radial.len()
            || self.radial.dimension != self.lags.len()
        {
            let (found, needed) = (self.radial_weights.len(), self.radial.len());
            return Err(CoreError::Shape { what: "radial weights", found, needed });
        }
        if self.lags.iter().any(|lag| lag.channel == 0 && lag.lag == 0) {
            let needed = "at least 1: an output cannot predict itself";
            return Err(CoreError::Range { what: "an output lag", found: 0.0, needed });
        }
        let factors = self.monomials.iter().flat_map(|monomial| &monomial.factors);
        if let Some(&(found, _)) = factors.into_iter().find(|factor| factor.0 >= self.lags.len()) {
            let needed = self.lags.len();
            return Err(CoreError::Shape { what: "the regressor of a factor", found, needed });
        }
        require_finite("the measured output", measured)?;
        require_finite("the inputs", inputs)?;
        let weights: Vec<f64> = self.monomials.iter().map(|monomial| monomial.weight).collect();
        require_finite("the weights", &weights)?;
        require_finite("the radial weights", self.radial_weights)?;
        let (low, high) = self.bounds;
        if !(low.is_finite() && high.is_finite() && low < high) {
            let needed = "a finite lower below a finite upper bound";
            return Err(CoreError::Range { what: "the guard", found: high - low, needed });
        }
        Ok(start)
    }

    /// The sum of all terms; the flag tells that the guard held it.
    fn evaluate(&self, x: &[f64]) -> (f64, bool) {
        let mut sum = 0.0;
        for monomial in &self.monomials {
            let mut product = monomial.weight;
            for &(index, power) in &monomial.factors {
                product *= if power == 1 { x[index] } else { x[index].powi(power) };
            }
            sum += product;
        }
        sum = self.radial.add_weighted(sum, self.radial_weights, x);
        let (low, high) = self.bounds;
        if !sum.is_finite() {
            // ∞ − ∞ has no side: hold the middle.
            return (0.5 * (low + high), true);
        }
        (sum.clamp(low, high), sum < low || sum > high)
    }

    /// Free run: the model's own past outputs feed its lags after the measured start.
    ///
    /// `inputs` is (n_inputs × n_samples), row-major.
    ///
    /// # Errors
    /// Too few samples, lengths that disagree, values that are not finite.
    pub fn free_run(&self, measured: &[f64], inputs: &[f64]) -> Result<Prediction, CoreError> {
        let start = self.check(measured, inputs)?;
        let n = measured.len();
        let mut output = measured.to_vec();
        let mut x = vec![0.0; self.lags.len()];
        let mut diverged_at = None;
        for t in start..n {
            for (entry, lag) in x.iter_mut().zip(&self.lags) {
                let past = t - lag.lag;
                *entry = match lag.channel {
                    0 => output[past],
                    channel => inputs[(channel - 1) * n + past],
                };
            }
            let (value, held) = self.evaluate(&x);
            output[t] = value;
            if held && diverged_at.is_none() {
                diverged_at = Some(t);
            }
        }
        Ok(Prediction { output, start, diverged_at })
    }

    /// Prediction of each sample from outputs measured at least `horizon` samples before it.
    ///
    /// # Errors
    /// As `free_run`, and a horizon of zero.
    pub fn ahead(
        &self,
        measured: &[f64],
        inputs: &[f64],
        horizon: usize,
    ) -> Result<Prediction, CoreError> {
        let start = self.check(measured, inputs)?;
        if horizon == 0 {
            let needed = "at least 1 sample";
            return Err(CoreError::Range { what: "the horizon", found: 0.0, needed });
        }
        let n = measured.len();
        let found: Vec<(f64, bool)> = (start..n)
            .into_par_iter()
            .map_init(
                || (vec![0.0; self.lags.len()], Vec::new()),
                |(x, run), t| {
                    run.clear();
                    let first = start.max((t + 1).saturating_sub(horizon));
                    let mut held = false;
                    for s in first..=t {
                        for (entry, lag) in x.iter_mut().zip(&self.lags) {
                            let past = s - lag.lag;
                            *entry = match lag.channel {
                                0 if past >= first => run[past - first],
                                0 => measured[past],
                                channel => inputs[(channel - 1) * n + past],
                            };
                        }
                        let (value, guarded) = self.evaluate(x);
                        held |= guarded;
                        run.push(value);
                    }
                    (run[t - first], held)
                },
            )
            .collect();
        let diverged_at = found.iter().position(|sample| sample.1).map(|index| index + start);
        let mut output = measured[..start].to_vec();
        output.extend(found.iter().map(|sample| sample.0));
        Ok(Prediction { output, start, diverged_at })
    }
}

#[cfg(test)]
#[path = "tests/narx_prediction.rs"]
mod tests;
