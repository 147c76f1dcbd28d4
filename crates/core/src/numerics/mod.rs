//! Linear algebra, dual numbers and random numbers: no flight, no models.

pub mod complex_lanes;
pub mod complex_lu;
pub(crate) mod decay;
pub(crate) mod died_away;
pub mod dual;
pub mod folded_frames;
pub mod folded_rows;
pub(crate) mod gram_schmidt;
pub mod half_band;
pub mod householder;
pub mod lagged_forms;
pub mod lagged_rows;
pub mod levinson;
pub mod matrix_exponential;
pub mod polynomial_roots;
pub mod random;
pub mod rank_bounds;
pub mod ranks;
pub mod recursive_filter;
pub mod running_median;
pub mod sample_signs;
pub mod slow_drift;
pub mod span_hashes;
pub mod sparse_lu;
pub(crate) mod widest;
pub mod windowed_sinc;
