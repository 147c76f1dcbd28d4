//! What an extended filter needs of a model on one record, sample by sample, on any scalar: outputs, the
//! next state, and the derivatives of both by state and constants. (Python side: none)

use crate::error::CoreError;
use crate::numerics::dual::Scalar;
use crate::trajectories::held_input::HeldInput;
use crate::trajectories::runge_kutta::{Course, STAGES, WEIGHTS};
use crate::trajectories::scalar_equations::{EquationTapes, Factor, ScalarEquations};

/// Channels with constants.
#[derive(Debug, Clone, Copy)]
pub struct Constants<'a> {
    /// Inputs with a constant.
    pub shifted: &'a [usize],
    /// Outputs with a constant.
    pub biased: &'a [usize],
}

/// Equations on one record.
pub(crate) struct Step<'a, S> {
    equations: ScalarEquations<'a, S>,
    held: Vec<HeldInput>,
    substeps: usize,
    step: f64,
    shifted: &'a [usize],
    biased: &'a [usize],
    driven: Vec<S>,
    /// Derivatives of the outputs by states and constants.
    pub(crate) observed: Vec<Factor<S>>,
    /// Those of the next state by states and shifts (n × inner).
    pub(crate) transition: Vec<S>,
}

impl<'a, S: Scalar> Step<'a, S> {
    pub(crate) fn new(
        tapes: &'a EquationTapes,
        course: &Course<'_>,
        constants: &Constants<'a>,
        parameters: &[S],
    ) -> Result<Self, CoreError> {
        let equations = ScalarEquations::new(tapes, parameters);
        let mut held = vec![HeldInput::default(); tapes.n_inputs];
        for (input, (held, delay)) in held.iter_mut().zip(&equations.delays).enumerate() {
            let samples = &course.inputs[input * course.n_samples..][..course.n_samples];
            held.follow(samples, delay.real(), course.sample_s, course.substeps, course.hold)?;
        }
        Ok(Self {
            equations,
            held,
            substeps: course.substeps,
            step: course.sample_s / course.substeps as f64,
            shifted: constants.shifted,
            biased: constants.biased,
            driven: vec![S::constant(0.0); tapes.n_inputs],
            observed: Vec::new(),
            transition: Vec::new(),
        })
    }

    /// Inputs, from values and their derivatives by the delays.
    fn drive(&mut self, state: &[S], at: impl Fn(&HeldInput) -> (f64, f64)) {
        for (input, held) in self.held.iter().enumerate() {
            let (value, by_delay) = at(held);
            let delay = self.equations.delays[input];
            // A number whose value is zero and whose derivatives are those of the delay.
            let moved = (delay - S::constant(delay.real())) * S::constant(by_delay);
            self.driven[input] = S::constant(value) + moved;
        }
        let n = self.equations.tapes.n_states;
        for (k, &input) in self.shifted.iter().enumerate() {
            self.driven[input] = self.driven[input] + state[n + k];
        }
    }

    /// Innovation of a sample, and how state and constants show in it.
    pub(crate) fn measure(
        &mut self,
        sample: usize,
        state: &[S],
        seen: &[f64],
    ) -> Result<Vec<S>, CoreError> {
        let n = self.equations.tapes.n_states;
        let inner = n + self.shifted.len();
        self.drive(state, |held| held.samples[sample]);
        let mut observed = std::mem::take(&mut self.observed);
        let outputs = self.equations.measure(&state[..n], &self.driven, &mut observed)?;
        let mut innovation: Vec<S> =
            seen.iter().zip(outputs).map(|(&seen, &output)| S::constant(seen) - output).collect();
        observed.retain_mut(|each| {
            let shift = self.shifted.iter().position(|input| n + input == each.column);
            let kept = each.column < n || shift.is_some();
            each.column = shift.map_or(each.column, |k| n + k);
            kept
        });
        for (k, &row) in self.biased.iter().enumerate() {
            observed.push(Factor { row, column: inner + k, value: S::constant(1.0) });
            innovation[row] = innovation[row] - state[inner + k];
        }
        self.observed = observed;
        Ok(innovation)
    }

    /// Transition over a sample interval from a state.
    pub(crate) fn differentiate(&mut self, sample: usize, state: &[S]) -> Result<(), CoreError> {
        let n = self.equations.tapes.n_states;
        let inner = n + self.shifted.len();
        let zero = S::constant(0.0);
        let mut x = state[..n].to_vec();
        let mut made = vec![zero; n * inner];
        (0..n).for_each(|i| made[i * inner + i] = S::constant(1.0));
        let (mut x_rate, mut rate) = (vec![zero; n], vec![zero; n * inner]);
        let (mut x_moved, mut moved) = (x.clone(), made.clone());
        for part in sample * self.substeps..(sample + 1) * self.substeps {
            let (mut x_sum, mut sum) = (vec![zero; n], vec![zero; n * inner]);
            for (stage, (place, share)) in STAGES.into_iter().enumerate() {
                self.drive(state, |held| held.steps[part].at(place));
                if stage > 0 {
                    ahead(&mut x_moved, &x, &x_rate, share * self.step);
                    ahead(&mut moved, &made, &rate, share * self.step);
                } else {
                    x_moved.copy_from_slice(&x);
                    moved.copy_from_slice(&made);
                }
                self.equations.differentiate(&x_moved, &self.driven)?;
                x_rate.copy_from_slice(&self.equations.rate);
                self.slope(&moved, &mut rate);
                add(&mut x_sum, &x_rate, WEIGHTS[stage]);
                add(&mut sum, &rate, WEIGHTS[stage]);
            }
            add(&mut x, &x_sum, self.step / 6.0);
            add(&mut made, &sum, self.step / 6.0);
        }
        self.transition = made;
        Ok(())
    }

    /// Derivatives of ẋ by state and shifts, from those of x.
    fn slope(&self, moved: &[S], rate: &mut [S]) {
        let n = self.equations.tapes.n_states;
        let inner = n + self.shifted.len();
        rate.fill(S::constant(0.0));
        for each in &self.equations.slopes {
            let row = &mut rate[each.row * inner..][..inner];
            if each.column < n {
                let from = &moved[each.column * inner..][..inner];
                for (entry, &from) in row.iter_mut().zip(from) {
                    *entry = *entry + each.value * from;
                }
            } else if let Some(k) = self.shifted.iter().position(|&i| n + i == each.column) {
                row[n + k] = row[n + k] + each.value;
            }
        }
    }

    /// Move a state over a sample interval.
    pub(crate) fn advance(&mut self, sample: usize, state: &mut [S]) -> Result<(), CoreError> {
        let n = self.equations.tapes.n_states;
        let zero = S::constant(0.0);
        let (mut rate, mut moved) = (vec![zero; n], state[..n].to_vec());
        for part in sample * self.substeps..(sample + 1) * self.substeps {
            let mut sum = vec![zero; n];
            for (stage, (place, share)) in STAGES.into_iter().enumerate() {
                self.drive(state, |held| held.steps[part].at(place));
                match stage {
                    0 => moved.copy_from_slice(&state[..n]),
                    _ => ahead(&mut moved, &state[..n], &rate, share * self.step),
                }
                self.equations.evaluate(&moved, &self.driven)?;
                rate.copy_from_slice(&self.equations.rate);
                add(&mut sum, &rate, WEIGHTS[stage]);
            }
            add(&mut state[..n], &sum, self.step / 6.0);
        }
        Ok(())
    }
}

fn ahead<S: Scalar>(to: &mut [S], from: &[S], rate: &[S], step: f64) {
    for ((to, &from), &rate) in to.iter_mut().zip(from).zip(rate) {
        *to = from + S::constant(step) * rate;
    }
}

fn add<S: Scalar>(to: &mut [S], what: &[S], share: f64) {
    for (to, &what) in to.iter_mut().zip(what) {
        *to = *to + S::constant(share) * what;
    }
}
