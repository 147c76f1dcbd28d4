//! Formulas of model files: their grammar, tables, and polynomials in s.

pub mod expression;
pub mod laplace_polynomial;
pub mod lookup_table;
pub(crate) mod parser;
pub mod syntax;
