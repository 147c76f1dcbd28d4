//! Models as frequency responses, and their fit to measured ones.

pub(crate) mod bin_chunks;
pub mod bordered_normal;
pub mod composite;
pub mod frequency_fit;
pub mod rational_bins;
pub mod response_model;
pub mod state_space_response;
pub mod transfer;
pub mod transfer_polynomials;
