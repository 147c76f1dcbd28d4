//! Controllers and filters of ArduPilot and PX4, as their firmware computes them.

pub mod ardupilot_chirp;
pub mod ardupilot_mixer;
pub mod ardupilot_mode;
pub mod ardupilot_pid;
pub mod gyro_filter;
pub mod notch_filter;
pub mod one_pole;
pub mod px4_rate_control;
pub mod slew_limiter;
