//! Least squares with bounds: the problem, its solver, and problems joined.

pub(crate) mod dense_problem;
pub mod joint_objective;
pub mod least_squares;
pub mod levenberg_marquardt;
pub mod normal_triangle;
pub mod settled_starts;
