//! Gusts as Gauss–Markov processes: Dryden's longitudinal spectrum at a fixed point.
//!
//! Reference: MIL-HDBK-1797, Dryden form, with correlation time L/V; the discretisation is exact.

use crate::numerics::random::Random;

/// Gusts as first-order Gauss–Markov processes (the shape of Dryden's longitudinal spectrum).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turbulence {
    /// Standard deviation of each velocity component, m/s.
    pub velocity_m_s: f64,
    /// Correlation time of the velocity, s.
    pub velocity_time_s: f64,
    /// Standard deviation of each rotation component, rad/s.
    pub rate_rad_s: f64,
    /// Correlation time of the rotation, s.
    pub rate_time_s: f64,
}

/// First-order Gauss–Markov vector, exact over a step.
#[derive(Debug, Clone)]
pub struct Markov<const N: usize> {
    keep: f64,
    drive: f64,
    /// Present value.
    pub value: [f64; N],
}

impl<const N: usize> Markov<N> {
    /// A process with a standard deviation and a correlation time (s), started in its steady state.
    pub fn new(sigma: f64, time_s: f64, dt: f64, random: &mut Random) -> Self {
        let keep = if time_s > 0.0 { (-dt / time_s).exp() } else { 0.0 };
        let value = random.normals(sigma);
        Self { keep, drive: sigma * (1.0 - keep * keep).sqrt(), value }
    }

    /// One step of `dt`.
    pub fn advance(&mut self, random: &mut Random) {
        if self.drive > 0.0 {
            let push: [f64; N] = random.normals(self.drive);
            self.value = std::array::from_fn(|i| self.keep * self.value[i] + push[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_and_correlation_are_those_asked_for() {
        let (mut random, dt, time_s) = (Random::new(3), 0.01, 0.1);
        let mut process = Markov::<1>::new(2.0, time_s, dt, &mut random);
        let n = 400_000;
        let mut x = Vec::with_capacity(n);
        for _ in 0..n {
            process.advance(&mut random);
            x.push(process.value[0]);
        }
        let at = |lag: usize| x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum::<f64>() / n as f64;
        assert!((at(0) - 4.0).abs() < 0.15);
        assert!((at(10) / at(0) - (-1.0_f64).exp()).abs() < 0.03);
    }
}
