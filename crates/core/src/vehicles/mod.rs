//! Simulated vehicles in gusts, with sensors, autopilots and pilots.

pub mod closed_loop;
pub mod quadrotor;
pub mod quadrotor_flight;
pub mod turbulence;
pub mod twin_rotor;
