//! Formulas flattened to tapes of operations, their derivatives, and tapes ready to run.

pub(crate) mod assembly;
pub(crate) mod derivative_tape;
pub mod expression_tape;
pub(crate) mod fused_steps;
pub(crate) mod operation;
pub(crate) mod tape_program;
