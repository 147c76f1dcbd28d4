//! Differential equations integrated in time, sensitivities, shooting, loops.

pub(crate) mod boundary_system;
pub mod equation_step;
pub mod extended_kalman;
pub(crate) mod filter_step;
pub mod held_input;
pub mod kinematics;
pub mod loop_simulation;
pub mod runge_kutta;
pub(crate) mod scalar_equations;
pub mod sensitivity;
pub(crate) mod sensitivity_columns;
pub(crate) mod sensitivity_flow;
pub mod sensitivity_pattern;
pub mod shooting;
pub(crate) mod state_covariance;
pub(crate) mod step_map;
pub mod trajectory;
