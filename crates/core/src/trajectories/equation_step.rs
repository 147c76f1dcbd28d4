//! Equations of a model advanced one sample at a time, for loops whose next input is not known yet.
//! (Python side: `control/loops/simulation.py`)

use crate::error::CoreError;
use crate::linear::discretisation::Hold;
use crate::state_space::model_tape::ModelTape;
use crate::state_space::ode_model::OdeModel;
use crate::trajectories::held_input::Line;
use crate::trajectories::runge_kutta::{Course, Setting, expect};

/// A model with the values of its parameters, ready to step.
#[derive(Debug, Clone)]
pub struct EquationStep {
    ode: OdeModel,
    setting: Setting,
    substeps: usize,
    still: Vec<f64>,
}

impl EquationStep {
    /// Take a model apart for steps of `sample_s` seconds, each in `substeps` parts.
    ///
    /// # Errors
    /// As `OdeModel::new` and `Setting::prepare`.
    pub fn new(
        model: &ModelTape,
        parameters: &[f64],
        sample_s: f64,
        substeps: usize,
    ) -> Result<Self, CoreError> {
        let ode = OdeModel::new(model)?;
        let still = vec![0.0; model.n_inputs()];
        let course = Course { inputs: &still, n_samples: 1, sample_s, hold: Hold::First, substeps };
        let mut setting = Setting::default();
        setting.prepare(&ode, parameters, &course)?;
        Ok(Self { ode, setting, substeps, still })
    }

    /// Advance a state while the inputs go in straight lines from one sample to the next. Delays of
    /// the model are the caller's.
    ///
    /// # Errors
    /// `Shape` where something does not fit, `Singular` as in `Setting::run`.
    pub fn advance(
        &mut self,
        from: &[f64],
        to: &[f64],
        state: &mut [f64],
    ) -> Result<(), CoreError> {
        expect("inputs of a step", from.len(), self.still.len())?;
        expect("inputs of a step", to.len(), self.still.len())?;
        expect("state of a step", state.len(), self.ode.n_states)?;
        let parts = self.substeps as f64;
        for (held, (from, to)) in self.setting.held.iter_mut().zip(from.iter().zip(to)) {
            held.steps.clear();
            held.steps.extend((0..self.substeps).map(|part| {
                let at = |place: usize| from + (to - from) * place as f64 / parts;
                Line { start: at(part), end: at(part + 1), start_slope: 0.0, end_slope: 0.0 }
            }));
        }
        for step in 0..self.substeps {
            self.setting.advance(&self.ode, step, &self.still, state)?;
        }
        Ok(())
    }

    /// Outputs at a state and inputs.
    ///
    /// # Errors
    /// `Shape` where something does not fit, `Singular` as in `Setting::run`.
    pub fn observe(
        &mut self,
        inputs: &[f64],
        state: &[f64],
        outputs: &mut [f64],
    ) -> Result<(), CoreError> {
        expect("inputs of a step", inputs.len(), self.still.len())?;
        expect("outputs of a step", outputs.len(), self.ode.n_outputs)?;
        for (held, &value) in self.setting.held.iter_mut().zip(inputs) {
            held.samples.clear();
            held.samples.push((value, 0.0));
        }
        self.setting.measure(&self.ode, 0, state, &self.still, outputs, 1)
    }

    /// Numbers of states, inputs and outputs.
    #[must_use]
    pub fn size(&self) -> (usize, usize, usize) {
        (self.ode.n_states, self.ode.n_inputs, self.ode.n_outputs)
    }
}
