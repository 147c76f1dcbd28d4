//! Linear simulation with exact hold discretisation (Python side: `simulation/simulate.py`). Before
//! the first sample an input is taken to have had the value of that sample.

use crate::error::CoreError;
use crate::linear::discretisation::{Hold, Sampled, StateSpace, discretise_each, split_delay};
use crate::numerics::householder::dot;

/// A discretised system with what turns its state into outputs.
#[derive(Debug, Clone)]
pub struct Discrete {
    n: usize,
    m: usize,
    p: usize,
    discrete: Sampled,
    /// Whole samples in the delay of each input.
    lags: Vec<usize>,
    c: Vec<f64>,
}

/// Sample `k + ahead` of an input; the first and last samples are held beyond the ends.
pub fn sample(input: &[f64], k: usize, ahead: isize) -> f64 {
    input[k.saturating_add_signed(ahead).min(input.len() - 1)]
}

impl Discrete {
    /// Discretise at a sample time (s).
    ///
    /// # Errors
    /// As `discretise`.
    pub fn new(system: &StateSpace<'_>, sample_s: f64, hold: Hold) -> Result<Self, CoreError> {
        Self::with_holds(system, sample_s, &vec![hold; system.delays_s.len()])
    }

    /// As `new`, with what each input does between samples.
    ///
    /// # Errors
    /// As `discretise_each`.
    pub fn with_holds(
        system: &StateSpace<'_>,
        sample_s: f64,
        holds: &[Hold],
    ) -> Result<Self, CoreError> {
        let (discrete, _) = discretise_each(system, &[], sample_s, holds)?;
        let (n, m) = (system.a.len().isqrt(), system.delays_s.len());
        let lags = system.delays_s.iter().map(|&delay| split_delay(delay, sample_s).0).collect();
        Ok(Self { n, m, p: system.n_outputs, discrete, lags, c: system.c.to_vec() })
    }

    /// Run from an initial state over inputs (m × n_samples); returns states and outputs, time last.
    ///
    /// # Errors
    /// `Shape` where the inputs or the state do not fit, `NotFinite` where the run diverges.
    pub fn run(
        &self,
        inputs: &[f64],
        n_samples: usize,
        initial: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
        require("inputs of the simulation", inputs.len(), self.m * n_samples)?;
        require("initial state", initial.len(), self.n)?;
        let mut states = vec![0.0; self.n * n_samples];
        let mut outputs = vec![0.0; self.p * n_samples];
        let mut x = initial.to_vec();
        let mut next = vec![0.0; self.n];
        let mut y = vec![0.0; self.p];
        for k in 0..n_samples {
            for (row, value) in x.iter().enumerate() {
                states[row * n_samples + k] = *value;
            }
            self.outputs_at(inputs, n_samples, k, &x, &mut y);
            for (row, value) in y.iter().enumerate() {
                outputs[row * n_samples + k] = *value;
            }
            self.advance(inputs, n_samples, k, &x, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
        match outputs.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "simulated output", index }),
            None => Ok((states, outputs)),
        }
    }

    /// Outputs at sample `k`, from inputs (m × n_samples) up to that sample.
    pub fn outputs_at(&self, inputs: &[f64], n_samples: usize, k: usize, x: &[f64], y: &mut [f64]) {
        for (row, out) in y.iter_mut().enumerate() {
            *out = dot(&self.c[row * self.n..(row + 1) * self.n], x);
        }
        for tap in &self.discrete.taps {
            let input = &inputs[tap.input * n_samples..(tap.input + 1) * n_samples];
            let u = sample(input, k, tap.ahead);
            y.iter_mut().zip(&tap.output).for_each(|(out, weight)| *out += weight * u);
        }
    }

    /// State at sample `k + 1` from that at `k`: inputs (m × n_samples) up to `k + 1` less the
    /// whole samples of each delay.
    pub fn advance(&self, inputs: &[f64], n_samples: usize, k: usize, x: &[f64], next: &mut [f64]) {
        for (row, out) in next.iter_mut().enumerate() {
            *out = dot(&self.discrete.transition[row * self.n..(row + 1) * self.n], x);
        }
        for tap in &self.discrete.taps {
            let input = &inputs[tap.input * n_samples..(tap.input + 1) * n_samples];
            let u = sample(input, k, tap.ahead);
            next.iter_mut().zip(&tap.state).for_each(|(out, weight)| *out += weight * u);
        }
    }

    /// Whether the newest sample of an input changes the state, or one of some outputs, at that sample.
    #[must_use]
    pub fn acts_at_once(&self, input: usize, outputs: &[usize]) -> bool {
        self.discrete.taps.iter().filter(|tap| tap.input == input).any(|tap| {
            (tap.ahead > 0 && tap.state.iter().any(|weight| *weight != 0.0))
                || (tap.ahead == 0 && outputs.iter().any(|&output| tap.output[output] != 0.0))
        })
    }

    /// Whole samples in the shortest delay; the largest number there is without inputs.
    #[must_use]
    pub fn shortest_lag(&self) -> usize {
        self.lags.iter().copied().min().unwrap_or(usize::MAX)
    }

    /// Numbers of states, inputs and outputs.
    #[must_use]
    pub fn size(&self) -> (usize, usize, usize) {
        (self.n, self.m, self.p)
    }
}

fn require(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn integrator(delays_s: &[f64]) -> StateSpace<'_> {
        StateSpace { a: &[0.0], b: &[1.0], c: &[1.0], d: &[0.0], delays_s, n_outputs: 1 }
    }

    #[test]
    fn an_integrator_sums_a_delayed_staircase() {
        let delays = [0.25];
        let model = Discrete::new(&integrator(&delays), 1.0, Hold::Zero).unwrap();
        let (_, y) = model.run(&[0.0, 1.0, 1.0, 0.0], 4, &[2.0]).unwrap();
        assert_eq!(y, [2.0, 2.0, 2.75, 3.75]);
    }

    #[test]
    fn an_integrator_sums_a_delayed_ramp() {
        let delays = [0.5];
        let model = Discrete::new(&integrator(&delays), 1.0, Hold::First).unwrap();
        let (_, y) = model.run(&[0.0, 1.0, 2.0, 3.0], 4, &[0.0]).unwrap();
        for (k, found) in y.iter().enumerate() {
            let t = (k as f64 - 0.5).max(0.0);
            assert!((found - 0.5 * t * t).abs() < 1e-14);
        }
    }

    #[test]
    fn feedthrough_sees_the_delayed_input() {
        let delays = [0.5];
        let gain =
            StateSpace { a: &[], b: &[], c: &[], d: &[3.0], delays_s: &delays, n_outputs: 1 };
        let model = Discrete::new(&gain, 1.0, Hold::First).unwrap();
        let (_, y) = model.run(&[0.0, 2.0, 4.0], 3, &[]).unwrap();
        assert_eq!(y, [0.0, 3.0, 9.0]);
    }

    #[test]
    fn refuses_what_does_not_fit() {
        assert!(Discrete::new(&integrator(&[-0.1]), 1.0, Hold::Zero).is_err());
        assert!(Discrete::new(&integrator(&[0.0]), 0.0, Hold::Zero).is_err());
        assert!(Discrete::new(&integrator(&[0.0, 0.0]), 1.0, Hold::Zero).is_err());
        let delays = [0.0];
        let model = Discrete::new(&integrator(&delays), 1.0, Hold::Zero).unwrap();
        assert!(model.run(&[0.0; 3], 4, &[0.0]).is_err());
        assert!(model.run(&[0.0; 4], 4, &[]).is_err());
    }
}
