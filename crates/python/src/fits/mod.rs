//! Fits that every kind of model shares: frequency responses, records, residuals of the caller.

pub mod frequency_fit;
pub mod lagged_forms;
pub mod least_squares;
pub mod output_error;
pub mod shown_disturbances;
