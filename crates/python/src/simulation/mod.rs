//! Systems, equations and loops run in time.

pub mod closed_response;
pub mod drift_errors;
pub mod extended_kalman;
pub mod linear_recursion;
pub mod linear_simulation;
pub mod loop_simulation;
pub mod nonlinear_simulation;
pub mod predictor_products;
pub mod recursive_filter;
pub mod slope_recursion;
pub mod vehicle_loop;
