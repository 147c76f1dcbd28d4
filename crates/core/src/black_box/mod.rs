//! Polynomial models and NARX: predictors, fits, scans of orders, choice of terms.

pub(crate) mod armax_newton;
pub(crate) mod armax_sums;
pub mod candidates;
pub mod digital_filter;
pub(crate) mod lane_rows;
pub mod local_regularisation;
pub(crate) mod look_ahead;
pub mod narx_prediction;
pub mod order_scan;
pub mod orthogonal_least_squares;
pub mod polynomial_fit;
pub mod polynomial_normal;
pub mod polynomial_orders;
pub mod polynomial_past;
pub mod polynomial_predictor;
pub mod radial_basis;
pub(crate) mod remainder;
pub(crate) mod rounded_columns;
pub(crate) mod steady_answers;
pub mod stop_rule;
