//! Output error: models on records, the records' own numbers, weights and sums.

pub(crate) mod bias_sums;
pub mod likelihood;
pub mod linear_family;
pub mod linear_output_error;
pub(crate) mod linear_sensitivities;
pub mod model_on_records;
pub mod nonlinear_output_error;
pub mod normal_equations;
pub mod output_error_weights;
pub mod output_sums;
pub mod record_data;
pub mod record_pass;
pub mod shown_disturbances;
pub mod slope_sums;
pub mod state_space_family;
pub mod transfer_family;
