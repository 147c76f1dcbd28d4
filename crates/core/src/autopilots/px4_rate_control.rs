//! PX4's rate controller, now and as it was until 2017 (Python side:
//! `control/autopilots/px4_loop.py`).
//!
//! Now: derivative on the measured angular acceleration, an integrator that grows less at large errors
//! and not at all against a saturated allocation, its old value in the output. Then: derivative of the
//! measured rate between loops, an integrator that stops outside ±0.3 and without thrust.

use crate::autopilots::gyro_filter::GyroFilter;
use crate::autopilots::notch_filter::{Notch, Section};
use crate::autopilots::one_pole::newest_weight;
use num_traits::{Float, FloatConst};

/// Error at which the integrator no longer grows, rad/s (400 deg/s).
const INTEGRATOR_ERROR_RAD_S: f64 = 400.0 * std::f64::consts::PI / 180.0;
/// Bound of output and integrator in the old controller.
const OLD_BOUND: f64 = 0.3;
/// Thrust below which the old controller does not integrate.
const OLD_LEAST_THRUST: f64 = 0.2;

/// Settings of one axis: gains already multiplied by K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateGains<F> {
    /// P, 1/(rad/s).
    pub p: F,
    /// I, 1/rad.
    pub i: F,
    /// D, 1/(rad/s²).
    pub d: F,
    /// Feed-forward, 1/(rad/s).
    pub ff: F,
    /// Largest integrator output.
    pub int_limit: F,
    /// Low-pass of the output, Hz; 0 is off.
    pub output_cutoff_hz: F,
    /// True for the controller until 2017.
    pub old: bool,
}

/// What one loop is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateInputs<F> {
    /// Set-point, rad/s.
    pub setpoint: F,
    /// Filtered rate, rad/s.
    pub rate: F,
    /// Filtered angular acceleration, rad/s²; the old controller does not look at it.
    pub acceleration: F,
    /// Thrust set-point 0…1; only the old controller looks at it.
    pub thrust: F,
    /// The allocation cannot give more, or less.
    pub saturated: [bool; 2],
    /// On the ground: no integration.
    pub landed: bool,
}

/// What one loop computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateTerms<F> {
    /// Proportional output.
    pub p: F,
    /// Integrator in the output.
    pub i: F,
    /// Derivative output.
    pub d: F,
    /// Feed-forward.
    pub ff: F,
    /// Sum behind the output's low-pass.
    pub output: F,
}

/// One axis of the controller.
#[derive(Debug, Clone)]
pub struct RateControl<F> {
    gains: RateGains<F>,
    dt: F,
    integral: F,
    last_rate: F,
    output: F,
    started: bool,
}

impl<F: Float + FloatConst> RateControl<F> {
    /// A controller at rest with a loop time, s.
    pub fn new(gains: RateGains<F>, dt: F) -> Self {
        let zero = F::zero();
        Self { gains, dt, integral: zero, last_rate: zero, output: zero, started: false }
    }

    /// Go on from a loop of which integral and rate are known.
    pub fn resumed(self, [integral, rate]: [F; 2]) -> Self {
        Self { integral, last_rate: rate, started: true, ..self }
    }

    /// One loop.
    pub fn update(&mut self, x: RateInputs<F>) -> RateTerms<F> {
        let g = self.gains;
        let error = x.setpoint - x.rate;
        let acceleration = if !g.old {
            x.acceleration
        } else if self.started {
            (x.rate - self.last_rate) / self.dt
        } else {
            F::zero()
        };
        self.last_rate = x.rate;
        self.started = true;
        let (p, i, d) = (g.p * error, self.integral, -(g.d * acceleration));
        let ff = g.ff * x.setpoint;
        let sum = p + i + d + ff;
        let cutoff = g.output_cutoff_hz;
        self.output = self.output + newest_weight(self.dt, cutoff) * (sum - self.output);
        if g.old {
            self.integrate_as_before(error, sum, &x);
        } else if !x.landed {
            self.integrate(error, x.saturated);
        }
        RateTerms { p, i, d, ff, output: self.output }
    }

    fn integrate(&mut self, error: F, [more, less]: [bool; 2]) {
        let zero = F::zero();
        let error = if more { error.min(zero) } else { error };
        let error = if less { error.max(zero) } else { error };
        let reach = F::from(INTEGRATOR_ERROR_RAD_S).unwrap_or_else(F::one);
        let share = error / reach;
        let factor = (F::one() - share * share).max(zero);
        let next = self.integral + factor * self.gains.i * error * self.dt;
        self.integral = next.max(-self.gains.int_limit).min(self.gains.int_limit);
    }

    fn integrate_as_before(&mut self, error: F, output: F, x: &RateInputs<F>) {
        let bound = F::from(OLD_BOUND).unwrap_or_else(F::one);
        let least = F::from(OLD_LEAST_THRUST).unwrap_or_else(F::zero);
        let saturated = x.saturated[0] || x.saturated[1];
        if x.landed || saturated || x.thrust <= least || output.abs() >= x.thrust {
            return;
        }
        let next = self.integral + self.gains.i * error * self.dt;
        if next.abs() < bound && output.abs() < bound {
            self.integral = next;
        }
    }
}

/// Raw gyro samples of one axis to the rate and the angular acceleration that the controllers take:
/// notches one after the other, low-pass, difference, one-pole low-pass of the difference; every
/// `decimation`-th result is kept.
pub fn gyro_chain<F: Float + FloatConst>(
    raw: &[F],
    sample_rate_hz: F,
    notches: &[Section<F>],
    cutoff_hz: F,
    derivative_cutoff_hz: F,
    decimation: usize,
) -> (Vec<F>, Vec<F>) {
    let mut notches: Vec<Notch<F>> = notches.iter().map(|&section| Notch::new(section)).collect();
    let mut low_pass = GyroFilter::new(cutoff_hz, sample_rate_hz);
    let weight = newest_weight(F::one() / sample_rate_hz, derivative_cutoff_hz);
    let (mut last, mut slope) = (None, F::zero());
    let step = decimation.max(1);
    let kept = raw.len() / step;
    let (mut rates, mut accelerations) = (Vec::with_capacity(kept), Vec::with_capacity(kept));
    for (k, &sample) in raw.iter().enumerate() {
        let notched = notches.iter_mut().fold(sample, |value, notch| notch.apply(value));
        let rate = low_pass.apply(notched);
        let raw_slope = (rate - last.unwrap_or(rate)) * sample_rate_hz;
        slope = slope + weight * (raw_slope - slope);
        last = Some(rate);
        if (k + 1) % step == 0 {
            rates.push(rate);
            accelerations.push(slope);
        }
    }
    (rates, accelerations)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(setpoint: f64) -> RateInputs<f64> {
        RateInputs {
            setpoint,
            rate: 0.0,
            acceleration: 0.0,
            thrust: 0.5,
            saturated: [false; 2],
            landed: false,
        }
    }

    fn gains() -> RateGains<f64> {
        RateGains {
            p: 0.1,
            i: 1.0,
            d: 0.01,
            ff: 0.0,
            int_limit: 0.05,
            output_cutoff_hz: 0.0,
            old: false,
        }
    }

    #[test]
    fn output_holds_the_integral_of_the_loop_before() {
        let mut control = RateControl::new(gains(), 0.01);
        assert_eq!(control.update(inputs(1.0)).i, 0.0);
        let factor = 1.0 - (1.0 / INTEGRATOR_ERROR_RAD_S).powi(2);
        assert!((control.update(inputs(1.0)).i - 0.01 * factor).abs() < 1e-15);
    }

    #[test]
    fn saturation_stops_growth_in_its_own_direction_only() {
        let mut control = RateControl::new(gains(), 0.01);
        let full = RateInputs { saturated: [true, false], ..inputs(1.0) };
        control.update(full);
        assert_eq!(control.update(full).i, 0.0);
        control.update(RateInputs { setpoint: -1.0, ..full });
        assert!(control.update(full).i < 0.0);
    }

    #[test]
    fn old_controller_differentiates_the_rate_itself_and_waits_for_thrust() {
        let mut control = RateControl::new(RateGains { old: true, ..gains() }, 0.01);
        control.update(RateInputs { thrust: 0.1, ..inputs(0.1) });
        let terms = control.update(RateInputs { rate: 0.02, ..inputs(0.1) });
        assert_eq!(terms.i, 0.0);
        assert!((terms.d + 0.01 * 0.02 / 0.01).abs() < 1e-15);
    }

    #[test]
    fn goes_on_from_a_known_loop() {
        let mut control = RateControl::new(gains(), 0.01).resumed([0.02, 0.1]);
        assert_eq!(control.update(inputs(0.0)).i, 0.02);
    }

    #[test]
    fn chain_keeps_the_last_of_each_group() {
        let raw: Vec<f64> = (0..8).map(f64::from).collect();
        let (rates, slopes) = gyro_chain(&raw, 100.0, &[], 0.0, 0.0, 4);
        assert_eq!(rates, [3.0, 7.0]);
        assert_eq!(slopes, [100.0, 100.0]);
    }
}
