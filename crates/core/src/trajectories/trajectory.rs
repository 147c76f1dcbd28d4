//! A run along a trajectory that is known, as its derivatives are taken.

use std::ops::Range;

use crate::state_space::ode_model::OdeModel;
use crate::trajectories::runge_kutta::Setting;

/// One run to be differentiated.
#[derive(Debug, Clone)]
pub struct Trajectory<'a> {
    /// The model.
    pub ode: &'a OdeModel,
    /// Parameters and record.
    pub setting: &'a Setting,
    /// Its samples.
    pub range: Range<usize>,
    /// Its states, from `Setting::run`.
    pub states: &'a [f64],
    /// What was added to the inputs.
    pub shift: &'a [f64],
}

impl Trajectory<'_> {
    /// State at the beginning of a step of the record.
    pub(crate) fn state(&self, step: usize) -> &[f64] {
        let n = self.ode.n_states;
        let place = (step - self.range.start * self.setting.substeps) * n;
        // Lanes beyond the last step repeat the last state; nothing is taken from them.
        let place = place.min(self.states.len().saturating_sub(n));
        &self.states[place..place + n]
    }
}
