//! A least-squares problem with bounds, as a fit states it and as a solver answers it.

use crate::error::CoreError;

/// A sum of squares: the residuals and their exact Jacobian.
pub trait Problem {
    /// Number of variables.
    fn n_parameters(&self) -> usize;
    /// Number of residuals.
    fn n_residuals(&self) -> usize;
    /// Residuals at `x`. An error at a trial point shortens the step.
    ///
    /// # Errors
    /// Where the residuals have no value at `x`.
    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError>;
    /// Jacobian at `x`, (n_residuals × n_parameters), row-major.
    ///
    /// # Errors
    /// Where the derivatives have no value at `x`.
    fn jacobian(&mut self, x: &[f64], jacobian: &mut [f64]) -> Result<(), CoreError>;
    /// Whether `both` makes residuals beside the Jacobian for what that takes alone.
    fn makes_both(&self) -> bool {
        false
    }
    /// Residuals and Jacobian at `x`.
    ///
    /// # Errors
    /// Where either has no value at `x`.
    fn both(
        &mut self,
        x: &[f64],
        residuals: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), CoreError> {
        self.residuals(x, residuals)?;
        self.jacobian(x, jacobian)
    }
    /// Triangle of [Jacobian | residuals] at `x`, (n + 1 × n + 1), column-major, from a problem that
    /// makes it without keeping its long Jacobian; false: take the Jacobian.
    ///
    /// # Errors
    /// Where the derivatives have no value at `x`.
    fn triangle(&mut self, _x: &[f64], _triangle: &mut [f64]) -> Result<bool, CoreError> {
        Ok(false)
    }
    /// Move a trial point to where the residuals have a value.
    fn project(&self, _x: &mut [f64]) {}
}

/// A sum of squares seen through its value and the triangle of its Jacobian. Its weights may move
/// with the point of linearisation, as long as a step that lowers the sum for fixed weights is good.
pub trait Objective {
    /// Number of variables.
    fn n_parameters(&self) -> usize;
    /// Sum of squares at `x`, with the weights of the last linearisation. An error shortens the step.
    ///
    /// # Errors
    /// Where there is no value at `x`.
    fn cost(&mut self, x: &[f64]) -> Result<f64, CoreError>;
    /// Called once, at the start, in place of `cost`.
    ///
    /// # Errors
    /// Where there is no value at `x`.
    fn begin(&mut self, x: &[f64]) -> Result<(), CoreError>;
    /// Move `x` to where the objective has its values, as `Problem::project`.
    fn project(&self, _x: &mut [f64]) {}
    /// Linearise at `x`, for which `begin` or `cost` was called last.
    ///
    /// # Errors
    /// Where there are no derivatives at `x`.
    fn linearise(&mut self, x: &[f64], point: &mut Point) -> Result<(), CoreError>;
}

/// An objective linearised at a point.
#[derive(Debug, Clone, Default)]
pub struct Point {
    /// Sum of squares with the weights of this point.
    pub cost: f64,
    /// Reduction that is to be had beside the variables, by nuisance that follows them.
    pub beside: f64,
    /// Triangle R of the Jacobian (n × n), columns contiguous.
    pub triangle: Vec<f64>,
    /// Qᵀr (n).
    pub projected: Vec<f64>,
}

impl Point {
    /// Zeros for `n` variables.
    pub fn new(n: usize) -> Self {
        Self { triangle: vec![0.0; n * n], projected: vec![0.0; n], ..Self::default() }
    }
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Most accepted or rejected steps.
    pub maximum_iterations: usize,
    /// Largest cosine between residuals and a free column of the Jacobian at a minimum.
    pub gradient_tolerance: f64,
    /// Smallest relative step.
    pub step_tolerance: f64,
    /// Smallest relative reduction of the sum of squares.
    pub cost_tolerance: f64,
    /// Whether the point that the last of the most steps reaches is linearised: where nobody asks for
    /// its slopes, a search of few steps saves one Jacobian of them.
    pub last_slopes: bool,
    /// Damping of the first step, as a share of the columns' squares.
    pub first_damping: f64,
    /// Whether little that a damped step took away ends a search where an undamped one promises more,
    /// as in a flat valley. Of variables without bounds.
    pub undamped_end: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            maximum_iterations: 200,
            gradient_tolerance: 1e-10,
            step_tolerance: 1e-12,
            cost_tolerance: 1e-15,
            last_slopes: true,
            first_damping: 1e-3,
            undamped_end: false,
        }
    }
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// The residuals are orthogonal to every free direction.
    Gradient,
    /// The relative step fell below its tolerance.
    Step,
    /// The relative reduction of the cost fell below its tolerance.
    Cost,
    /// The residuals vanish.
    Zero,
    /// Every variable is held by its bounds.
    Bounds,
    /// The most iterations were used.
    Iterations,
    /// No step lowers the cost although the gradient is not zero.
    Stalled,
    /// The caller asked to stop.
    Interrupted,
}

impl Termination {
    /// Whether the end point is a minimum to the tolerances.
    pub fn is_converged(self) -> bool {
        !matches!(self, Self::Iterations | Self::Stalled | Self::Interrupted)
    }

    /// Stable name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gradient => "gradient",
            Self::Step => "step",
            Self::Cost => "cost",
            Self::Zero => "zero",
            Self::Bounds => "bounds",
            Self::Iterations => "iterations",
            Self::Stalled => "stalled",
            Self::Interrupted => "interrupted",
        }
    }
}

/// Where the iteration ended.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// Variables.
    pub x: Vec<f64>,
    /// Sum of squared residuals.
    pub cost: f64,
    /// Residuals at `x`; empty where that was not linearised.
    pub residuals: Vec<f64>,
    /// Jacobian at `x`, row-major; empty from a problem that makes the triangle itself, and where `x`
    /// was not linearised.
    pub jacobian: Vec<f64>,
    /// Triangle R of the Jacobian at `x`, (n × n), column-major; empty where `x` was not linearised.
    pub triangle: Vec<f64>,
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub termination: Termination,
}

/// State that the callback sees after each step.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Steps tried.
    pub iteration: usize,
    /// Sum of squares now.
    pub cost: f64,
    /// Variables now.
    pub x: &'a [f64],
}
