//! Linear simulation with exact hold discretisation (Python side: `simulation/simulate.py`).
//!
//! ẋ = A x + B u(t − τ), y = C x + D u(t − τ), one delay for each input, sampled at t = k T. Between
//! samples the input is constant (zero-order hold) or linear (first-order hold), and a delay that is
//! no multiple of T moves the corners of that input between the samples. Both are integrated without
//! approximation: each step is cut at the corner and each piece is advanced with the exponential of
//! the augmented matrix [A b 0; 0 0 1; 0 0 0] (Franklin, Powell & Workman, *Digital Control of Dynamic
//! Systems*, 3rd ed., sections 4.3.3 and 6.3; Van Loan 1978). Before the first sample an input is
//! taken to have had the value of that sample.

use crate::error::CoreError;
use crate::matrix_exponential::exponential;

/// What an input does between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// Constant until the next sample.
    Zero,
    /// Linear to the next sample.
    First,
}

/// Continuous state space, row-major, with one delay (s) for each input.
#[derive(Debug, Clone, Copy)]
pub struct StateSpace<'a> {
    /// n × n.
    pub a: &'a [f64],
    /// n × m.
    pub b: &'a [f64],
    /// p × n.
    pub c: &'a [f64],
    /// p × m.
    pub d: &'a [f64],
    /// m delays, s.
    pub delays_s: &'a [f64],
    /// Number of outputs p.
    pub n_outputs: usize,
}

/// The discretised system. For each input three neighbouring samples act on a step: those at
/// k − lag − 1, k − lag and k − lag + 1, with whole-sample lag `lag`.
#[derive(Debug, Clone)]
pub struct Discrete {
    n: usize,
    m: usize,
    p: usize,
    transition: Vec<f64>,
    /// For each input: lag, state weights of the three samples (3 × n), value weights of the three.
    inputs: Vec<InputWeights>,
    c: Vec<f64>,
    d: Vec<f64>,
}

#[derive(Debug, Clone)]
struct InputWeights {
    lag: usize,
    state: [Vec<f64>; 3],
    value: [f64; 3],
}

/// Responses over `duration` to the state, to a constant input and to a unit ramp: e^{Ah}, ∫, ∫∫.
struct Piece {
    transition: Vec<f64>,
    constant: Vec<f64>,
    ramp: Vec<f64>,
}

fn piece(a: &[f64], b: &[f64], n: usize, duration: f64) -> Result<Piece, CoreError> {
    let size = n + 2;
    let mut augmented = vec![0.0; size * size];
    for i in 0..n {
        for j in 0..n {
            augmented[i * size + j] = a[i * n + j] * duration;
        }
        augmented[i * size + n] = b[i] * duration;
    }
    augmented[n * size + n + 1] = duration;
    let e = exponential(&augmented, size)?;
    let column = |j: usize| (0..n).map(|i| e[i * size + j]).collect();
    let transition = (0..n * n).map(|k| e[(k / n) * size + k % n]).collect();
    Ok(Piece { transition, constant: column(n), ramp: column(n + 1) })
}

fn times(matrix: &[f64], vector: &[f64], n: usize) -> Vec<f64> {
    matrix
        .chunks_exact(n.max(1))
        .map(|row| row.iter().zip(vector).map(|(x, y)| x * y).sum())
        .collect()
}

impl InputWeights {
    /// Weights of one input with column `b` and a delay of (lag + fraction) sample times.
    fn new(
        a: &[f64],
        b: &[f64],
        n: usize,
        sample_s: f64,
        delay_s: f64,
        hold: Hold,
    ) -> Result<Self, CoreError> {
        let in_samples = delay_s / sample_s;
        // A delay that is a whole number of samples but for rounding must not make an empty piece.
        let nearest = in_samples.round();
        let in_samples = if (in_samples - nearest).abs() < 1e-9 { nearest } else { in_samples };
        let lag = in_samples.floor();
        let fraction = in_samples - lag;
        let early = piece(a, b, n, fraction * sample_s)?;
        let late = piece(a, b, n, (1.0 - fraction) * sample_s)?;
        let carry = |v: &[f64]| times(&late.transition, v, n);
        let (constant, ramp) = (carry(&early.constant), carry(&early.ramp));
        let state = match hold {
            Hold::Zero => [constant, late.constant, vec![0.0; n]],
            Hold::First => {
                let slope = 1.0 / sample_s;
                let sum = |f: &dyn Fn(usize) -> f64| (0..n).map(f).collect::<Vec<f64>>();
                [
                    sum(&|i| fraction * constant[i] - slope * ramp[i]),
                    sum(&|i| {
                        (1.0 - fraction) * constant[i] + slope * ramp[i] + late.constant[i]
                            - slope * late.ramp[i]
                    }),
                    sum(&|i| slope * late.ramp[i]),
                ]
            }
        };
        let value = match hold {
            Hold::Zero if fraction > 0.0 => [1.0, 0.0, 0.0],
            Hold::Zero => [0.0, 1.0, 0.0],
            Hold::First => [fraction, 1.0 - fraction, 0.0],
        };
        Ok(Self { lag: lag as usize, state, value })
    }

    /// The three samples that act at step `k`; the first and last samples are held beyond the ends.
    fn samples(&self, u: &[f64], k: usize) -> [f64; 3] {
        let at = |shift: usize| u[(k + shift).saturating_sub(self.lag + 1).min(u.len() - 1)];
        [at(0), at(1), at(2)]
    }
}

impl Discrete {
    /// Discretise at a sample time (s).
    ///
    /// # Errors
    /// `Shape` where matrices disagree, `Range` for a sample time or delay without meaning,
    /// `NotFinite` where an entry or the exponential is not finite.
    pub fn new(system: &StateSpace<'_>, sample_s: f64, hold: Hold) -> Result<Self, CoreError> {
        let (n, m, p) = check(system, sample_s)?;
        let inputs = (0..m)
            .map(|j| {
                let column: Vec<f64> = (0..n).map(|i| system.b[i * m + j]).collect();
                InputWeights::new(system.a, &column, n, sample_s, system.delays_s[j], hold)
            })
            .collect::<Result<_, _>>()?;
        let scaled: Vec<f64> = system.a.iter().map(|v| v * sample_s).collect();
        Ok(Self {
            n,
            m,
            p,
            transition: exponential(&scaled, n)?,
            inputs,
            c: system.c.to_vec(),
            d: system.d.to_vec(),
        })
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
        for (j, weights) in self.inputs.iter().enumerate() {
            let u = weights.samples(&inputs[j * n_samples..(j + 1) * n_samples], k);
            let delayed = dot(&weights.value, &u);
            for (row, out) in y.iter_mut().enumerate() {
                *out += self.d[row * self.m + j] * delayed;
            }
        }
    }

    /// State at sample `k + 1` from that at `k`: inputs (m × n_samples) up to `k + 1` less the
    /// whole samples of each delay.
    pub fn advance(&self, inputs: &[f64], n_samples: usize, k: usize, x: &[f64], next: &mut [f64]) {
        for (row, out) in next.iter_mut().enumerate() {
            *out = dot(&self.transition[row * self.n..(row + 1) * self.n], x);
        }
        for (j, weights) in self.inputs.iter().enumerate() {
            let u = weights.samples(&inputs[j * n_samples..(j + 1) * n_samples], k);
            for (weight, value) in weights.state.iter().zip(u) {
                for (out, w) in next.iter_mut().zip(weight) {
                    *out += w * value;
                }
            }
        }
    }

    /// Whole samples in the shortest delay; the largest number there is without inputs.
    #[must_use]
    pub fn shortest_lag(&self) -> usize {
        self.inputs.iter().map(|weights| weights.lag).min().unwrap_or(usize::MAX)
    }

    /// Numbers of states, inputs and outputs.
    #[must_use]
    pub fn size(&self) -> (usize, usize, usize) {
        (self.n, self.m, self.p)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn require(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

fn check(system: &StateSpace<'_>, sample_s: f64) -> Result<(usize, usize, usize), CoreError> {
    let n = system.a.len().isqrt();
    let (m, p) = (system.delays_s.len(), system.n_outputs);
    require("matrix A", system.a.len(), n * n)?;
    require("matrix B", system.b.len(), n * m)?;
    require("matrix C", system.c.len(), p * n)?;
    require("matrix D", system.d.len(), p * m)?;
    if !(sample_s > 0.0 && sample_s.is_finite()) {
        return Err(CoreError::Range {
            what: "sample time",
            found: sample_s,
            needed: "positive seconds",
        });
    }
    if let Some(&found) = system.delays_s.iter().find(|&&d| !(d >= 0.0 && d / sample_s < 1e9)) {
        return Err(CoreError::Range {
            what: "input delay",
            found,
            needed: "zero or positive seconds",
        });
    }
    Ok((n, m, p))
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
