//! Linear systems in time: exact hold discretisation, simulation and recursions.

pub(crate) mod block_recursion;
pub mod closed_response;
pub(crate) mod column_products;
pub mod discretisation;
pub mod drift_errors;
pub mod hold_integrals;
pub mod input_products;
pub mod linear_outputs;
pub mod linear_recursion;
pub mod linear_response;
pub mod linear_simulation;
pub mod noise_answers;
pub mod slope_products;
pub mod slope_recursion;
pub mod smooth_input;
