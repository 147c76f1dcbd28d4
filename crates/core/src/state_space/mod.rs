//! State-space models as equations, compiled: derivatives, samples, listings.

pub mod equation_listing;
pub mod model_curvature;
pub mod model_samples;
pub mod model_tape;
pub mod ode_model;
