//! Simulated vehicles, their autopilots, and what their sensors saw.

pub mod ardupilot_chirp;
pub mod autopilot_controllers;
pub mod kinematics;
pub mod quadrotor;
pub mod twin_rotor;
