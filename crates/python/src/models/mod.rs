//! Models as Python holds them: formulas, tables, structures and their fits.

pub mod equation_records;
pub mod expression;
pub mod lookup_table;
pub mod narx_models;
pub mod polynomial_models;
pub mod rational_bins;
pub mod state_space;
pub mod transfer;
