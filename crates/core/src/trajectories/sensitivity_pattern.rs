//! Which derivatives of a model's rows meet which columns: sparse, found once for a run.

use crate::state_space::ode_model::OdeModel;
use crate::tape::derivative_tape::Entry;

/// Samples whose derivatives are known side by side.
pub(crate) const BLOCK: usize = 16;
/// A number at each sample of a block, whole lines of the cache.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Samples(pub(crate) [f64; BLOCK]);
/// Columns that fit a vector register.
pub(crate) const VECTOR: usize = 4;
/// Of them in a group.
pub(crate) const VECTORS: usize = 8;
/// Columns that are carried side by side: what is summed of them stays in registers.
pub(crate) const GROUP: usize = VECTOR * VECTORS;

/// By what a trajectory is differentiated; columns in this order.
#[derive(Debug, Clone, Copy)]
pub struct Directions<'a> {
    /// Indices of parameters.
    pub parameters: &'a [usize],
    /// Number of columns whose derivatives come in with the initial state alone.
    pub n_initial: usize,
    /// By the shifts of these inputs.
    pub shift: &'a [usize],
}

impl Directions<'_> {
    /// Number of columns.
    pub fn count(&self) -> usize {
        self.parameters.len() + self.n_initial + self.shift.len()
    }
}

/// What one derivative of one row adds without any state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Force {
    pub(crate) row: usize,
    pub(crate) column: usize,
    /// Place among the entries.
    pub(crate) entry: usize,
    pub(crate) factor: f64,
    /// Input whose rate by the delay multiplies it too.
    pub(crate) delayed: Option<usize>,
}

/// A row of residuals or outputs with the state or rate that it depends on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link {
    pub(crate) row: usize,
    pub(crate) from: usize,
    pub(crate) entry: usize,
}

/// Sparse derivatives of a set of rows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pattern {
    pub(crate) by_rate: Vec<Link>,
    /// Row after row.
    pub(crate) by_state: Vec<Link>,
    pub(crate) forces: Vec<Force>,
}

pub(crate) struct Seeds<'a> {
    pub(crate) ode: &'a OdeModel,
    pub(crate) directions: &'a Directions<'a>,
    pub(crate) leaf_slopes: &'a [f64],
}

impl Seeds<'_> {
    /// Where the derivatives of some rows go.
    pub(crate) fn pattern(&self, entries: &[Entry]) -> Pattern {
        let ode = self.ode;
        let (n, n_moving) = (ode.n_states, ode.n_moving());
        let count = self.directions.parameters.len();
        let first_shift = count + self.directions.n_initial;
        let mut pattern = Pattern::default();
        for (place, entry) in entries.iter().enumerate() {
            let link = |from| Link { row: entry.row, from, entry: place };
            match entry.column {
                column if column < n => pattern.by_rate.push(link(column)),
                column if column < 2 * n => pattern.by_state.push(link(column - n)),
                column if column < n_moving => {
                    let input = column - 2 * n;
                    if let Some(k) = self.directions.shift.iter().position(|&s| s == input) {
                        pattern.force(entry.row, place, first_shift + k, 1.0, None);
                    }
                    let delay = ode.n_leaves + input;
                    self.scatter(&mut pattern, entry.row, place, delay, Some(input));
                }
                column => self.scatter(&mut pattern, entry.row, place, column - n_moving, None),
            }
        }
        pattern
    }

    /// Columns of the parameters on which a leaf or delay depends.
    fn scatter(
        &self,
        pattern: &mut Pattern,
        row: usize,
        entry: usize,
        value: usize,
        delayed: Option<usize>,
    ) {
        let count = self.directions.parameters.len();
        for (column, &factor) in self.leaf_slopes[value * count..][..count].iter().enumerate() {
            if factor != 0.0 {
                pattern.force(row, entry, column, factor, delayed);
            }
        }
    }
}

impl Pattern {
    fn force(
        &mut self,
        row: usize,
        entry: usize,
        column: usize,
        factor: f64,
        delayed: Option<usize>,
    ) {
        self.forces.push(Force { row, column, entry, factor, delayed });
    }
}
