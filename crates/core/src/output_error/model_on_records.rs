//! What output error asks of a model: its outputs on every record, and their derivatives, row by row.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;

/// Which derivatives a run must give beside the outputs.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// By every free parameter.
    pub theta: bool,
    /// By these entries of the initial state.
    pub initial: &'a [usize],
    /// By the shifts of these inputs.
    pub shift: &'a [usize],
}

/// Columns of one row of a run are a multiple of this; those beyond `Wanted::columns` are zero.
pub const LANES: usize = 4;

impl Wanted<'_> {
    /// Columns in use: the output, then its derivatives by θ, initial state and shifts.
    pub fn columns(&self, n_theta: usize) -> usize {
        1 + if self.theta { n_theta } else { 0 } + self.initial.len() + self.shift.len()
    }

    /// Length of a row.
    pub fn stride(&self, n_theta: usize) -> usize {
        self.columns(n_theta).next_multiple_of(LANES)
    }
}

/// One model on all records, linear or not.
pub trait Trajectories: Sync {
    /// What all records share at one θ, for example matrices.
    type Shared: Send + Sync;

    /// Number of outputs.
    fn n_outputs(&self) -> usize;
    /// Number of free parameters θ.
    fn n_parameters(&self) -> usize;
    /// Length of the vector of input shifts.
    fn n_shifts(&self) -> usize;
    /// Samples of each record.
    fn record_lengths(&self) -> &[usize];
    /// Length of the initial state of a record.
    fn n_initial(&self, record: usize) -> usize;
    /// Whether outputs are affine in initial state and shifts.
    fn is_affine(&self) -> bool;
    /// Prepare a θ for all records, with derivatives if asked.
    ///
    /// # Errors
    /// Where the model has no value at θ.
    fn share(&self, theta: &[f64], with_slopes: bool) -> Result<Self::Shared, CoreError>;
    /// Run one record and hand its rows, block by block, to `sink`: first sample of the block, then
    /// the rows (sample, then output; `Wanted::stride` columns), which the sink may overwrite.
    /// `scratch` is reused from call to call.
    ///
    /// # Errors
    /// Where the run has no value. Values that are not finite may be handed on as they are.
    #[allow(clippy::too_many_arguments)]
    fn run(
        &self,
        shared: &Self::Shared,
        record: usize,
        initial: &[f64],
        shift: &[f64],
        wanted: &Wanted<'_>,
        scratch: &mut Vec<f64>,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError>;
}

/// A model whose derivatives may be asked along one step of θ alone.
pub trait Directed: Trajectories {
    /// What `share` gave with slopes, its derivatives by θ the single one along a step: a run then has
    /// one column by θ.
    fn along(&self, shared: &Self::Shared, step: &[f64]) -> Self::Shared;
}
