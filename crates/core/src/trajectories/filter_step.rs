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
    own: Followed<S>,
    all: Followed<S>,
    /// Innovations of the sample that was measured.
    pub(crate) innovation: Vec<S>,
    /// Derivatives of the outputs by states and constants.
    pub(crate) observed: Vec<Factor<S>>,
    /// Those of the next state by states and shifts (n × inner).
    pub(crate) transition: Vec<S>,
}

/// What follows rates over an interval: where it stands, is moved to, goes, and the stages' sum.
#[derive(Debug, Clone)]
struct Followed<S> {
    at: Vec<S>,
    moved: Vec<S>,
    rate: Vec<S>,
    sum: Vec<S>,
}

impl<S> Default for Followed<S> {
    fn default() -> Self {
        Self { at: Vec::new(), moved: Vec::new(), rate: Vec::new(), sum: Vec::new() }
    }
}

impl<S: Scalar> Followed<S> {
    fn start(&mut self, from: impl Iterator<Item = S>) {
        self.at.clear();
        self.at.extend(from);
        self.rate.resize(self.at.len(), S::constant(0.0));
    }

    /// Go to a stage of a step.
    fn stage(&mut self, stage: usize, by: f64) {
        self.moved.clone_from(&self.at);
        if stage == 0 {
            self.sum.clear();
            self.sum.resize(self.at.len(), S::constant(0.0));
        } else {
            add(&mut self.moved, &self.rate, by);
        }
    }

    /// Take the stage's rate into account, at the last one move.
    fn staged(&mut self, stage: usize, step: f64) {
        add(&mut self.sum, &self.rate, WEIGHTS[stage]);
        if stage + 1 == WEIGHTS.len() {
            add(&mut self.at, &self.sum, step / 6.0);
        }
    }
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
            own: Followed::default(),
            all: Followed::default(),
            innovation: Vec::new(),
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
            let moved = (delay - S::constant(delay.real())).times(by_delay);
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
    ) -> Result<(), CoreError> {
        let n = self.equations.tapes.n_states;
        let inner = n + self.shifted.len();
        self.drive(state, |held| held.samples[sample]);
        let mut observed = std::mem::take(&mut self.observed);
        let outputs = self.equations.measure(&state[..n], &self.driven, &mut observed)?;
        let left = seen.iter().zip(outputs).map(|(&seen, &output)| S::constant(seen) - output);
        self.innovation.clear();
        self.innovation.extend(left);
        observed.retain_mut(|each| {
            let shift = self.shifted.iter().position(|input| n + input == each.column);
            let kept = each.column < n || shift.is_some();
            each.column = shift.map_or(each.column, |k| n + k);
            kept
        });
        for (k, &row) in self.biased.iter().enumerate() {
            observed.push(Factor { row, column: inner + k, value: S::constant(1.0) });
            self.innovation[row] = self.innovation[row] - state[inner + k];
        }
        self.observed = observed;
        Ok(())
    }

    /// Transition over a sample interval from a state.
    pub(crate) fn differentiate(&mut self, sample: usize, state: &[S]) -> Result<(), CoreError> {
        let n = self.equations.tapes.n_states;
        let inner = n + self.shifted.len();
        let (mut own, mut all) = (std::mem::take(&mut self.own), std::mem::take(&mut self.all));
        own.start(state[..n].iter().copied());
        let one = |place: usize| f64::from(u8::from(place / inner == place % inner));
        all.start((0..n * inner).map(|place| S::constant(one(place))));
        for part in sample * self.substeps..(sample + 1) * self.substeps {
            for (stage, (place, share)) in STAGES.into_iter().enumerate() {
                self.drive(state, |held| held.steps[part].at(place));
                own.stage(stage, share * self.step);
                all.stage(stage, share * self.step);
                self.equations.differentiate(&own.moved, &self.driven)?;
                own.rate.copy_from_slice(&self.equations.rate);
                self.slope(&all.moved, &mut all.rate);
                own.staged(stage, self.step);
                all.staged(stage, self.step);
            }
        }
        self.transition.clone_from(&all.at);
        (self.own, self.all) = (own, all);
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
        let mut own = std::mem::take(&mut self.own);
        own.start(state[..n].iter().copied());
        for part in sample * self.substeps..(sample + 1) * self.substeps {
            for (stage, (place, share)) in STAGES.into_iter().enumerate() {
                self.drive(state, |held| held.steps[part].at(place));
                own.stage(stage, share * self.step);
                self.equations.evaluate(&own.moved, &self.driven)?;
                own.rate.copy_from_slice(&self.equations.rate);
                own.staged(stage, self.step);
            }
        }
        state[..n].copy_from_slice(&own.at);
        self.own = own;
        Ok(())
    }
}

fn add<S: Scalar>(to: &mut [S], what: &[S], share: f64) {
    for (to, &what) in to.iter_mut().zip(what) {
        *to = *to + what.times(share);
    }
}
