//! Numerics of flightid.
//!
//! Conventions, for every module: slices in, owned values out; SI units and radians; matrices are
//! row-major; spectra are one-sided; frequencies are in rad/s; random numbers come from a seed that
//! is an argument; results have the same bits for any number of threads. Nothing here knows Python,
//! files, channel names or printing.

pub mod ardupilot_mixer;
pub mod ardupilot_mode;
pub mod ardupilot_pid;
mod boundary_system;
mod candidates;
pub mod chirp;
pub mod closed_loop;
pub mod complex_lu;
mod dense_problem;
pub mod digital_filter;
pub mod discretisation;
pub mod dual;
pub mod equation_step;
pub mod error;
pub mod expression;
mod expression_parser;
pub mod frequency_fit;
pub mod gram;
mod gram_schmidt;
pub mod gyro_filter;
pub mod held_input;
pub mod hold_integrals;
pub mod householder;
pub mod joint_objective;
pub mod kinematics;
pub mod lanes;
pub mod least_squares;
pub mod levenberg_marquardt;
pub mod linear_family;
pub mod linear_output_error;
pub mod linear_recursion;
pub mod linear_simulation;
pub mod local_regularisation;
mod look_ahead;
pub mod lookup_table;
pub mod loop_simulation;
pub mod matrix_exponential;
pub mod model_curvature;
pub mod model_samples;
pub mod model_tape;
pub mod motion;
pub mod narx;
pub mod nonlinear_output_error;
pub mod normal_triangle;
pub mod notch_filter;
pub mod one_pole;
pub mod order_scan;
pub mod orthogonal_least_squares;
pub mod output_error;
pub mod output_error_weights;
pub mod polynomial;
pub mod polynomial_fit;
pub mod polynomial_normal;
pub mod polynomial_predictor;
pub mod polynomial_roots;
pub mod px4_rate_control;
pub mod quadrotor;
pub mod quadrotor_flight;
pub mod radial_basis;
pub mod random;
pub mod rational;
pub mod record_pass;
pub mod runge_kutta;
pub mod shooting;
pub mod slew_limiter;
pub mod sparse_lu;
pub mod state_space_fit;
pub mod stop_rule;
pub mod tangent;
pub mod tangent_pattern;
pub mod tape;
mod tape_assembly;
mod tape_derivative;
pub mod tape_listing;
mod tape_program;
pub mod transfer;
pub mod turbulence;
pub mod twin_rotor;
pub mod walk;

pub use error::CoreError;
