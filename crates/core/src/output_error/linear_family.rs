//! Linear systems that depend on free parameters, with their derivatives by these.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::linear::discretisation::StateSpace;

/// A linear system with derivatives by the free parameters, row-major.
#[derive(Debug, Clone, Default)]
pub struct LinearPoint {
    /// n × n.
    pub a: Vec<f64>,
    /// n × m.
    pub b: Vec<f64>,
    /// p × n.
    pub c: Vec<f64>,
    /// p × m.
    pub d: Vec<f64>,
    /// m delays, s.
    pub delays_s: Vec<f64>,
    /// By each free parameter, in the same shapes.
    pub slopes: Vec<LinearPoint>,
}

impl LinearPoint {
    /// The system, as the discretisation takes it.
    pub(crate) fn view(&self, n_outputs: usize) -> StateSpace<'_> {
        let Self { a, b, c, d, delays_s, .. } = self;
        StateSpace { a, b, c, d, delays_s, n_outputs }
    }
}

/// Linear systems that depend on free parameters.
pub trait LinearFamily: Sync {
    /// Number of states.
    fn n_states(&self) -> usize;
    /// Number of outputs.
    fn n_outputs(&self) -> usize;
    /// Number of measured inputs.
    fn n_inputs(&self) -> usize;
    /// Number of free parameters.
    fn n_parameters(&self) -> usize;
    /// Measured input behind each column of B; None for a constant 1.
    fn columns(&self) -> &[Option<usize>];
    /// The system at θ.
    ///
    /// # Errors
    /// Where it has no value there.
    fn at(&self, theta: &[f64], with_slopes: bool) -> Result<LinearPoint, CoreError>;
}

/// Parameter values of which some vary.
#[derive(Debug, Clone)]
pub(crate) struct Values {
    pub(crate) all: Vec<f64>,
    pub(crate) free: Vec<usize>,
}

impl Values {
    pub(crate) fn new(all: &[f64], free: &[usize], needed: usize) -> Result<Self, CoreError> {
        let found = all.len();
        if found != needed {
            return Err(CoreError::Shape { what: "parameter values", found, needed });
        }
        if let Some(&found) = free.iter().find(|&&index| index >= needed) {
            return Err(CoreError::Shape { what: "index of a free parameter", found, needed });
        }
        Ok(Self { all: all.to_vec(), free: free.to_vec() })
    }

    /// All values, the free ones at θ.
    pub(crate) fn at(&self, theta: &[f64]) -> Vec<f64> {
        let mut values = self.all.clone();
        self.free.iter().zip(theta).for_each(|(&place, &value)| values[place] = value);
        values
    }
}
