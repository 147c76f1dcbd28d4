//! Trajectories of a model by the classical Runge–Kutta method of fourth order with fixed steps.
//!
//! ```text
//! x₊ = x + h/6 (k₁ + 2 k₂ + 2 k₃ + k₄)
//! ```
//! Reference: Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., §II.1,
//! table 1.2. Derivatives of these trajectories: `sensitivity.rs`.

use std::ops::Range;

use crate::error::CoreError;
use crate::linear::discretisation::Hold;
use crate::numerics::matrix_exponential::solve;
use crate::state_space::ode_model::{Mass, OdeModel};
use crate::tape::derivative_tape::Entry;
use crate::tape::expression_tape::Registers;
use crate::tape::tape_program::Lanes;
use crate::trajectories::held_input::HeldInput;

/// A state beyond this size ends the run: SI quantities of a vehicle do not come near it.
pub const LARGEST_STATE: f64 = 1e30;
/// Most steps in a sample interval.
pub const MAXIMUM_SUBSTEPS: usize = 1000;
/// Where the three places of a step are visited by the four stages, and how far the state moves there.
pub(crate) const STAGES: [(usize, f64); 4] = [(0, 0.0), (1, 0.5), (1, 0.5), (2, 1.0)];
/// Weights of the stages, sixths.
pub(crate) const WEIGHTS: [f64; 4] = [1.0, 2.0, 2.0, 1.0];

/// The inputs of one record, and how they are followed.
#[derive(Debug, Clone, Copy)]
pub struct Course<'a> {
    /// n_inputs × n_samples, row-major.
    pub inputs: &'a [f64],
    /// Number of samples.
    pub n_samples: usize,
    /// Time between samples, s.
    pub sample_s: f64,
    /// What the inputs do between samples.
    pub hold: Hold,
    /// Steps in a sample interval.
    pub substeps: usize,
}

/// A model with the values of its parameters on the inputs of one record; buffers for its runs, to be
/// used for one record and model only.
#[derive(Debug, Clone, Default)]
pub struct Setting {
    pub(crate) leaves: Vec<f64>,
    pub(crate) delays: Vec<f64>,
    pub(crate) held: Vec<HeldInput>,
    pub(crate) inverse_mass: Vec<f64>,
    /// Its entries that are not zero: row, column, value.
    pub(crate) weights: Vec<(usize, usize, f64)>,
    pub(crate) n_samples: usize,
    pub(crate) substeps: usize,
    pub(crate) step_s: f64,
    /// Delays for which `held` was made.
    followed: Option<Vec<f64>>,
    rates: Lanes<1>,
    outputs: Lanes<1>,
    mass: Vec<f64>,
    registers: Registers,
    derivatives: [Vec<f64>; 4],
    moved: Vec<f64>,
    driven: Vec<f64>,
}

/// M⁻¹ from the entries of M.
pub(crate) fn inverse(
    entries: &[Entry],
    n: usize,
    value: impl Fn(usize) -> f64,
    scratch: &mut Vec<f64>,
    result: &mut [f64],
) -> Result<(), CoreError> {
    scratch.clear();
    scratch.resize(n * n, 0.0);
    for entry in entries {
        scratch[entry.row * n + entry.column] = value(entry.register);
    }
    result.fill(0.0);
    (0..n).for_each(|i| result[i * n + i] = 1.0);
    let what = "the matrix of the factors of the state derivatives";
    solve(scratch, result, n).map_err(|_| CoreError::Singular { what })?;
    match result.iter().all(|entry| entry.is_finite()) {
        true => Ok(()),
        false => Err(CoreError::Singular { what }),
    }
}

impl Setting {
    /// Take parameter values and a record; for the same record as before the inputs are followed
    /// again only where a delay changed.
    ///
    /// # Errors
    /// `Shape` or `Range` for what does not fit, `NotFinite` where a formula has no value, `Singular`
    /// where the equations do not give every state derivative.
    pub fn prepare(
        &mut self,
        ode: &OdeModel,
        parameters: &[f64],
        course: &Course<'_>,
    ) -> Result<(), CoreError> {
        check(ode.n_inputs, course)?;
        let mut values = std::mem::take(&mut self.leaves);
        values.clear();
        values.resize(ode.leaves.n_outputs(), 0.0);
        ode.leaves.evaluate(parameters, &mut self.registers, &mut values)?;
        self.delays.clear();
        self.delays.extend(values.drain(ode.n_leaves..));
        self.leaves = values;
        self.n_samples = course.n_samples;
        self.substeps = course.substeps;
        self.step_s = course.sample_s / course.substeps as f64;
        self.held.resize_with(ode.n_inputs, HeldInput::default);
        if self.followed.as_ref() != Some(&self.delays) {
            // Unset meanwhile: a delay that is refused must not leave half of the inputs as
            // followed.
            self.followed = None;
            for (input, held) in self.held.iter_mut().enumerate() {
                let samples = &course.inputs[input * course.n_samples..][..course.n_samples];
                let delay = self.delays[input];
                held.follow(samples, delay, course.sample_s, course.substeps, course.hold)?;
            }
            self.followed = Some(self.delays.clone());
        }
        let n_moving = ode.n_moving();
        ode.rates.prepare(n_moving, &self.leaves, &mut self.rates);
        ode.outputs.prepare(n_moving, &self.leaves, &mut self.outputs);
        let n = ode.n_states;
        self.inverse_mass.clear();
        self.inverse_mass.resize(n * n, 0.0);
        self.driven.resize(ode.n_inputs, 0.0);
        self.moved.resize(n, 0.0);
        self.derivatives.iter_mut().for_each(|k| k.resize(n, 0.0));
        if let Mass::Fixed(entries) = &ode.mass {
            let lanes = &self.rates;
            inverse(entries, n, |r| lanes[r][0], &mut self.mass, &mut self.inverse_mass)?;
            self.gather_weights(n);
        }
        Ok(())
    }

    fn gather_weights(&mut self, n: usize) {
        let entries = self.inverse_mass.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        self.weights.clear();
        self.weights.extend(entries.map(|(place, &weight)| (place / n, place % n, weight)));
    }

    /// ẋ at a state and the driven inputs.
    fn rate(&mut self, ode: &OdeModel, state: &[f64], result: &mut [f64]) -> Result<(), CoreError> {
        let n = ode.n_states;
        for (place, &value) in state.iter().enumerate() {
            ode.rates.load(n + place, [value], &mut self.rates);
        }
        for (place, &value) in self.driven.iter().enumerate() {
            ode.rates.load(2 * n + place, [value], &mut self.rates);
        }
        ode.rates.run(&mut self.rates);
        let lanes = &self.rates;
        if let Mass::Moving(entries) = &ode.mass {
            inverse(entries, n, |r| lanes[r][0], &mut self.mass, &mut self.inverse_mass)?;
            self.gather_weights(n);
        }
        let lanes = &self.rates;
        if ode.mass.is_one() {
            for (rate, &register) in result.iter_mut().zip(&ode.residuals) {
                // Residuals are left − right, so M ẋ = −r at ẋ = 0.
                *rate = -lanes[register][0];
            }
        } else {
            result.fill(0.0);
            for &(row, column, weight) in &self.weights {
                result[row] -= weight * lanes[ode.residuals[column]][0];
            }
        }
        Ok(())
    }

    /// Outputs at a sample.
    pub(crate) fn measure(
        &mut self,
        ode: &OdeModel,
        sample: usize,
        state: &[f64],
        shift: &[f64],
        outputs: &mut [f64],
        stride: usize,
    ) -> Result<(), CoreError> {
        let n = ode.n_states;
        for (input, shift) in shift.iter().enumerate() {
            self.driven[input] = self.held[input].samples[sample].0 + shift;
            ode.outputs.load(2 * n + input, [self.driven[input]], &mut self.outputs);
        }
        if ode.outputs_need_rates {
            let mut rates = std::mem::take(&mut self.moved);
            let found = self.rate(ode, state, &mut rates);
            for (place, &rate) in rates.iter().enumerate() {
                ode.outputs.load(place, [rate], &mut self.outputs);
            }
            self.moved = rates;
            found?;
        }
        for (place, &value) in state.iter().enumerate() {
            ode.outputs.load(n + place, [value], &mut self.outputs);
        }
        ode.outputs.run(&mut self.outputs);
        for (row, &register) in ode.measured.iter().enumerate() {
            outputs[row * stride] = self.outputs[register][0];
        }
        Ok(())
    }

    /// Advance a state by step number `step` of the record.
    pub(crate) fn advance(
        &mut self,
        ode: &OdeModel,
        step: usize,
        shift: &[f64],
        state: &mut [f64],
    ) -> Result<(), CoreError> {
        let mut slopes = std::mem::take(&mut self.derivatives);
        let mut moved = std::mem::take(&mut self.moved);
        let mut found = Ok(());
        for (stage, (place, share)) in STAGES.into_iter().enumerate() {
            for (input, shift) in shift.iter().enumerate() {
                self.driven[input] = self.held[input].steps[step].at(place).0 + shift;
            }
            let (before, now) = slopes.split_at_mut(stage);
            match before.last() {
                Some(last) => {
                    for ((moved, x), k) in moved.iter_mut().zip(state.iter()).zip(last) {
                        *moved = x + share * self.step_s * k;
                    }
                }
                None => moved.copy_from_slice(state),
            }
            found = self.rate(ode, &moved, &mut now[0]);
            if found.is_err() {
                break;
            }
        }
        // Also after a refused stage: the buffers must go back, and the caller drops the state.
        for (place, x) in state.iter_mut().enumerate() {
            let sum: f64 = WEIGHTS.iter().zip(&slopes).map(|(w, k)| w * k[place]).sum();
            *x += self.step_s / 6.0 * sum;
        }
        self.derivatives = slopes;
        self.moved = moved;
        found
    }

    /// Run over the samples of `range` from an initial state. `states` takes the state at the beginning
    /// of every step and after the last one (a state contiguous): one step fewer than samples where the
    /// range ends with the record. `outputs` (n_outputs × n_samples of the record), where asked for,
    /// gets the columns of the range.
    ///
    /// # Errors
    /// `Diverged` where a state or output grows beyond all bounds, `Singular` as in `prepare`.
    pub fn run(
        &mut self,
        ode: &OdeModel,
        range: Range<usize>,
        initial: &[f64],
        shift: &[f64],
        states: &mut Vec<f64>,
        mut outputs: Option<&mut [f64]>,
    ) -> Result<(), CoreError> {
        let (n, n_samples) = (ode.n_states, self.n_samples);
        expect("initial state", initial.len(), n)?;
        expect("input shifts", shift.len(), ode.n_inputs)?;
        if let Some(outputs) = &outputs {
            expect("outputs", outputs.len(), ode.n_outputs * n_samples)?;
        }
        if range.end > n_samples {
            let (found, needed) = (range.end, n_samples);
            return Err(CoreError::Shape { what: "samples of a run", found, needed });
        }
        states.clear();
        states.extend_from_slice(initial);
        let mut state = initial.to_vec();
        for sample in range {
            if let Some(outputs) = outputs.as_deref_mut() {
                self.measure(ode, sample, &state, shift, &mut outputs[sample..], n_samples)?;
                let found = outputs[sample..].iter().step_by(n_samples);
                if !found.copied().all(|v| v.abs() < LARGEST_STATE) {
                    return Err(CoreError::Diverged { sample });
                }
            }
            // Not "any beyond": NaN is not below either.
            if !state.iter().all(|v| v.abs() < LARGEST_STATE) {
                return Err(CoreError::Diverged { sample });
            }
            if sample + 1 == n_samples {
                break;
            }
            for step in sample * self.substeps..(sample + 1) * self.substeps {
                self.advance(ode, step, shift, &mut state)?;
                states.extend_from_slice(&state);
            }
        }
        match state.iter().all(|v| v.abs() < LARGEST_STATE) {
            true => Ok(()),
            false => Err(CoreError::Diverged { sample: n_samples.saturating_sub(1) }),
        }
    }

    /// States (n_states × n_samples) and outputs (n_outputs × n_samples) of the whole record.
    ///
    /// # Errors
    /// As `run`.
    pub fn simulate(
        &mut self,
        ode: &OdeModel,
        initial: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
        let (n, n_samples) = (ode.n_states, self.n_samples);
        let mut outputs = vec![0.0; ode.n_outputs * n_samples];
        let (shift, mut steps) = (vec![0.0; ode.n_inputs], Vec::new());
        self.run(ode, 0..n_samples, initial, &shift, &mut steps, Some(&mut outputs))?;
        let stride = n * self.substeps;
        let place = |k: usize| k % n_samples * stride + k / n_samples;
        Ok(((0..n * n_samples).map(|k| steps[place(k)]).collect(), outputs))
    }
}

pub(crate) fn check(n_inputs: usize, course: &Course<'_>) -> Result<(), CoreError> {
    expect("inputs of the record", course.inputs.len(), n_inputs * course.n_samples)?;
    if !(course.sample_s > 0.0 && course.sample_s.is_finite()) {
        let (found, needed) = (course.sample_s, "more than zero seconds");
        return Err(CoreError::Range { what: "sample time", found, needed });
    }
    if !(1..=MAXIMUM_SUBSTEPS).contains(&course.substeps) {
        let (found, needed) = (course.substeps as f64, "1 to 1000");
        return Err(CoreError::Range { what: "steps in a sample interval", found, needed });
    }
    match course.inputs.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "the inputs of a record", index }),
        None => Ok(()),
    }
}

pub(crate) fn expect(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

#[cfg(test)]
#[path = "tests/runge_kutta.rs"]
pub(crate) mod tests;
