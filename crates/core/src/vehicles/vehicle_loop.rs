//! A linear vehicle with a controller or pilot in the loop (Python side: `vehicles/vehicle_loop.py`).
//!
//! Each of the two is discretised exactly (`linear_simulation.rs`). The controller's outputs at a
//! sample may depend on measurements up to the sample before, so that the loop has no circle within
//! a sample and a first-order hold of the vehicle's inputs stays causal.

use crate::error::CoreError;
use crate::linear::linear_simulation::Discrete;
use crate::numerics::random::Random;
use crate::vehicles::turbulence::Markov;

/// What moves an input by itself: a first-order Gauss–Markov process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Standard deviation, in the input's unit.
    pub deviation: f64,
    /// Correlation time, s; zero for white noise.
    pub time_s: f64,
}

/// Vehicle, controller, and how they hang together.
#[derive(Debug, Clone, Copy)]
pub struct ClosedLoop<'a> {
    /// The vehicle.
    pub vehicle: &'a Discrete,
    /// The controller or pilot, each of its inputs delayed by a sample or more.
    pub controller: &'a Discrete,
    /// Vehicle output that each controller input measures.
    pub watched: &'a [usize],
    /// Vehicle input that each controller output adds to.
    pub driven: &'a [usize],
    /// One for each vehicle input.
    pub disturbances: &'a [Disturbance],
    /// Standard deviation of the white noise of each vehicle output.
    pub noise: &'a [f64],
}

impl ClosedLoop<'_> {
    /// Fly over what is added to the inputs from outside (m × n_samples).
    ///
    /// Returns the inputs as the vehicle saw them and the outputs with their noise, time last.
    /// Disturbances and noise have streams of their own: a change of one leaves the other alone.
    ///
    /// # Errors
    /// `Shape` where something does not fit, `NotFinite` where the flight diverges.
    pub fn fly(
        &self,
        added: &[f64],
        n_samples: usize,
        sample_s: f64,
        seed: u64,
    ) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
        self.check(added, n_samples)?;
        let (n, _, p) = self.vehicle.size();
        let (n_controller, n_watched, n_driven) = self.controller.size();
        let mut inputs = added.to_vec();
        self.disturb(&mut inputs, n_samples, sample_s, seed);
        let mut noise = Random::new(!seed);
        let mut measured = vec![0.0; p * n_samples];
        let mut seen = vec![0.0; n_watched * n_samples];
        let (mut x, mut next) = (vec![0.0; n], vec![0.0; n]);
        let (mut s, mut later) = (vec![0.0; n_controller], vec![0.0; n_controller]);
        let (mut y, mut feedback) = (vec![0.0; p], vec![0.0; n_driven]);
        for k in 0..n_samples {
            self.vehicle.outputs_at(&inputs, n_samples, k, &x, &mut y);
            for (row, value) in y.iter().enumerate() {
                measured[row * n_samples + k] = value + self.noise[row] * noise.normal();
            }
            if k + 1 == n_samples {
                break;
            }
            for (row, &output) in self.watched.iter().enumerate() {
                seen[row * n_samples + k] = measured[output * n_samples + k];
            }
            self.controller.advance(&seen, n_samples, k, &s, &mut later);
            std::mem::swap(&mut s, &mut later);
            self.controller.outputs_at(&seen, n_samples, k + 1, &s, &mut feedback);
            for (value, &input) in feedback.iter().zip(self.driven) {
                inputs[input * n_samples + k + 1] += value;
            }
            self.vehicle.advance(&inputs, n_samples, k, &x, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
        match measured.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "output of the closed loop", index }),
            None => Ok((inputs, measured)),
        }
    }

    fn disturb(&self, inputs: &mut [f64], n_samples: usize, sample_s: f64, seed: u64) {
        let mut random = Random::new(seed);
        for (row, each) in inputs.chunks_exact_mut(n_samples).zip(self.disturbances) {
            if each.deviation > 0.0 {
                let mut process =
                    Markov::<1>::new(each.deviation, each.time_s, sample_s, &mut random);
                for value in row {
                    *value += process.value[0];
                    process.advance(&mut random);
                }
            }
        }
    }

    fn check(&self, added: &[f64], n_samples: usize) -> Result<(), CoreError> {
        let (_, m, p) = self.vehicle.size();
        let (_, n_watched, n_driven) = self.controller.size();
        require("what is added to the inputs", added.len(), m * n_samples)?;
        require("disturbances", self.disturbances.len(), m)?;
        require("noise deviations", self.noise.len(), p)?;
        require("watched outputs", self.watched.len(), n_watched)?;
        require("driven inputs", self.driven.len(), n_driven)?;
        for (what, places, size) in
            [("watched outputs", self.watched, p), ("driven inputs", self.driven, m)]
        {
            if let Some(&found) = places.iter().find(|&&place| place >= size) {
                return Err(CoreError::Shape { what, found, needed: size });
            }
        }
        if self.controller.shortest_lag() == 0 {
            return Err(CoreError::Range {
                what: "delay of the controller in samples",
                found: 0.0,
                needed: "one sample or more",
            });
        }
        Ok(())
    }
}

fn require(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::discretisation::{Hold, StateSpace};

    const STILL: [Disturbance; 1] = [Disturbance { deviation: 0.0, time_s: 1.0 }];

    fn gain(value: &[f64], delays_s: &[f64]) -> Discrete {
        let system = StateSpace { a: &[], b: &[], c: &[], d: value, delays_s, n_outputs: 1 };
        Discrete::new(&system, 0.1, Hold::First).unwrap()
    }

    fn integrator() -> Discrete {
        let system = StateSpace {
            a: &[0.0],
            b: &[1.0],
            c: &[1.0],
            d: &[0.0],
            delays_s: &[0.0],
            n_outputs: 1,
        };
        Discrete::new(&system, 0.1, Hold::First).unwrap()
    }

    #[test]
    fn an_integrator_under_delayed_feedback_follows_its_recursion() {
        let (vehicle, controller) = (integrator(), gain(&[-2.0], &[0.2]));
        let plant = ClosedLoop {
            vehicle: &vehicle,
            controller: &controller,
            watched: &[0],
            driven: &[0],
            disturbances: &STILL,
            noise: &[0.0],
        };
        let n = 40;
        let (u, y) = plant.fly(&vec![1.0; n], n, 0.1, 1).unwrap();
        for k in 0..n - 1 {
            let expected = 1.0 - 2.0 * if k + 1 >= 2 { y[k - 1] } else { 0.0 };
            assert!((u[k + 1] - expected).abs() < 1e-14);
            assert!((y[k + 1] - y[k] - 0.05 * (u[k] + u[k + 1])).abs() < 1e-14);
        }
    }

    #[test]
    fn noise_and_disturbance_have_the_deviations_asked_for_and_their_own_streams() {
        let (vehicle, controller) = (gain(&[3.0], &[0.0]), gain(&[0.0], &[0.1]));
        let plant = ClosedLoop {
            vehicle: &vehicle,
            controller: &controller,
            watched: &[0],
            driven: &[0],
            disturbances: &[Disturbance { deviation: 0.5, time_s: 0.3 }],
            noise: &[0.2],
        };
        let n = 100_000;
        let (u, y) = plant.fly(&vec![0.0; n], n, 0.1, 4).unwrap();
        let power = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / n as f64;
        let noise: Vec<f64> = u.iter().zip(&y).map(|(u, y)| y - 3.0 * u).collect();
        assert!((power(&u) / 0.25 - 1.0).abs() < 0.05);
        assert!((power(&noise) / 0.04 - 1.0).abs() < 0.02);
        let quiet = ClosedLoop { noise: &[0.0], ..plant };
        assert_eq!(quiet.fly(&vec![0.0; n], n, 0.1, 4).unwrap().0, u);
    }

    #[test]
    fn refuses_a_controller_without_delay_and_places_that_are_not_there() {
        let (vehicle, at_once, late) = (integrator(), gain(&[-1.0], &[0.0]), gain(&[-1.0], &[0.1]));
        let plant = ClosedLoop {
            vehicle: &vehicle,
            controller: &late,
            watched: &[0],
            driven: &[0],
            disturbances: &STILL,
            noise: &[0.0],
        };
        assert!(plant.fly(&[0.0; 3], 3, 0.1, 0).is_ok());
        assert!(plant.fly(&[0.0; 2], 3, 0.1, 0).is_err());
        assert!(ClosedLoop { controller: &at_once, ..plant }.fly(&[0.0; 3], 3, 0.1, 0).is_err());
        assert!(ClosedLoop { driven: &[1], ..plant }.fly(&[0.0; 3], 3, 0.1, 0).is_err());
        assert!(ClosedLoop { noise: &[], ..plant }.fly(&[0.0; 3], 3, 0.1, 0).is_err());
    }
}
