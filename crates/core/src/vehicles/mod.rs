//! Simulated vehicles in gusts, with sensors, autopilots and pilots.

pub mod quadrotor;
pub mod quadrotor_flight;
pub mod turbulence;
pub mod twin_rotor;
pub mod vehicle_loop;
