//! ArduPilot's rate PID (Python side: `control/autopilots/arducopter.py`, `vehicles/autopilot.py`),
//! in the autopilot's own single precision or in double for its linear view.
//!
//! Structure of AC_PID: notch and low-pass on target (NTF, FLTT), notch and low-pass on error (NEF,
//! FLTE), low-pass on the derivative of the filtered error (FLTD), integrator clamped to IMAX, slew
//! limiter on P + D (SMAX), P + D clamped to PDMX, feed-forward outside. Helicopters let the
//! integrator leak down to ILMI before each loop.

use crate::autopilots::notch_filter::{Notch, ardupilot_notch};
use crate::autopilots::one_pole::newest_weight;
use crate::autopilots::slew_limiter::SlewLimiter;
use num_traits::{Float, FloatConst};

/// ArduPilot's `is_positive` and `is_zero` compare with the spacing of single precision at one.
const SMALLEST: f64 = f32::EPSILON as f64;
/// Time constant of the slew limiter's decay, s; not a parameter of multicopters.
const SLEW_TAU_S: f64 = 1.0;

/// Settings of one axis; names and units of the ATC_RAT_xxx parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidGains<F> {
    /// P, 1/(rad/s).
    pub p: F,
    /// I, 1/rad.
    pub i: F,
    /// D, 1/(rad/s²).
    pub d: F,
    /// FF, 1/(rad/s).
    pub ff: F,
    /// D_FF, 1/(rad/s²).
    pub d_ff: F,
    /// IMAX, largest integrator output.
    pub imax: F,
    /// PDMX, largest |P + D|; 0 is off.
    pub pdmx: F,
    /// FLTT, target filter, Hz; 0 is off.
    pub fltt: F,
    /// FLTE, error filter, Hz; 0 is off.
    pub flte: F,
    /// FLTD, derivative filter, Hz; 0 is off.
    pub fltd: F,
    /// SMAX, largest slew rate of P + D, 1/s; 0 is off.
    pub smax: F,
    /// Notch that NTF names: centre in Hz, quality, attenuation in dB; zeros are off.
    pub target_notch: [F; 3],
    /// Notch that NEF names.
    pub error_notch: [F; 3],
}

impl<F: Float> PidGains<F> {
    /// Every number is finite, and bounds and filters are not negative.
    pub fn is_sound(&self) -> bool {
        let bounds = [self.imax, self.pdmx, self.fltt, self.flte, self.fltd, self.smax];
        let gains = [self.p, self.i, self.d, self.ff, self.d_ff];
        let notches = self.target_notch.iter().chain(&self.error_notch);
        bounds.iter().chain(notches).all(|v| v.is_finite() && *v >= F::zero())
            && gains.iter().all(|v| v.is_finite())
    }
}

/// What the controller computed in one loop, as PIDR, PIDP and PIDY log it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidTerms<F> {
    /// Filtered target, rad/s.
    pub target: F,
    /// Filtered error, rad/s.
    pub error: F,
    /// Proportional output.
    pub p: F,
    /// Integrator output.
    pub i: F,
    /// Derivative output.
    pub d: F,
    /// Feed-forward of the target.
    pub ff: F,
    /// Feed-forward of the target's derivative.
    pub d_ff: F,
    /// Factor that the slew limiter put on P and D.
    pub dmod: F,
    /// Slew rate that the limiter sees, 1/s.
    pub slew_rate: F,
}

impl<F: Float> PidTerms<F> {
    /// Sum without feed-forward.
    pub fn feedback(&self) -> F {
        self.p + self.d + self.i
    }

    /// Feed-forward, which the mixer adds.
    pub fn feedforward(&self) -> F {
        self.ff + self.d_ff
    }
}

/// One axis of the rate controller.
#[derive(Debug, Clone)]
pub struct Pid<F> {
    gains: PidGains<F>,
    dt: F,
    smallest: F,
    target: F,
    error: F,
    derivative: F,
    integrator: F,
    target_notch: Option<Notch<F>>,
    error_notch: Option<Notch<F>>,
    slew: Option<SlewLimiter<F>>,
    slew_scale: F,
    last_pd: F,
    leak: Option<[F; 2]>,
    started: bool,
}

impl<F: Float + FloatConst> Pid<F> {
    /// A controller at rest with a loop time, s.
    pub fn new(gains: PidGains<F>, dt: F) -> Self {
        let zero = F::zero();
        let notch = |[center, quality, attenuation]: [F; 3]| {
            ardupilot_notch(F::one() / dt, center, quality, attenuation).map(Notch::new)
        };
        let tau = F::from(SLEW_TAU_S).unwrap_or_else(F::one);
        Self {
            gains,
            dt,
            smallest: F::from(SMALLEST).unwrap_or_else(F::epsilon),
            target: zero,
            error: zero,
            derivative: zero,
            integrator: zero,
            target_notch: notch(gains.target_notch),
            error_notch: notch(gains.error_notch),
            slew: if gains.smax > zero { SlewLimiter::new(gains.smax, tau) } else { None },
            slew_scale: F::one(),
            last_pd: zero,
            leak: None,
            started: false,
        }
    }

    /// SMAX counts in other units of P + D (planes: 45 degrees of servo).
    pub fn with_slew_scale(self, scale: F) -> Self {
        Self { slew_scale: scale, ..self }
    }

    /// The integrator leaks by a share of what exceeds `floor` before each loop (helicopters).
    pub fn with_leak(self, share: F, floor: F) -> Self {
        Self { leak: Some([share, floor]), ..self }
    }

    /// Go on from a loop of which target, error, derivative (all filtered) and integrator are known.
    pub fn resumed(self, [target, error, derivative, integrator]: [F; 4]) -> Self {
        let last_pd = error * self.gains.p + derivative * self.gains.d;
        Self { target, error, derivative, integrator, last_pd, started: true, ..self }
    }

    /// One loop: target and measured rate in rad/s; with `limited` the integrator may only shrink.
    pub fn update(&mut self, target: F, measured: F, limited: bool) -> PidTerms<F> {
        let (g, dt) = (self.gains, self.dt);
        self.leak();
        let target = filtered(&mut self.target_notch, target);
        let mut target_derivative = F::zero();
        if self.started {
            let (target_last, error_last) = (self.target, self.error);
            self.target = self.target + newest_weight(dt, g.fltt) * (target - self.target);
            let error = filtered(&mut self.error_notch, self.target - measured);
            self.error = self.error + newest_weight(dt, g.flte) * (error - self.error);
            let derivative = (self.error - error_last) / dt;
            self.derivative =
                self.derivative + newest_weight(dt, g.fltd) * (derivative - self.derivative);
            target_derivative = (self.target - target_last) / dt;
        } else {
            self.started = true;
            self.target = target;
            self.error = filtered(&mut self.error_notch, target - measured);
        }
        self.integrate(limited);
        let (p, d, dmod) = self.limited_pd();
        PidTerms {
            target: self.target,
            error: self.error,
            p,
            i: self.integrator,
            d,
            ff: self.target * g.ff,
            d_ff: target_derivative * g.d_ff,
            dmod,
            slew_rate: self.slew.as_ref().map_or_else(F::zero, SlewLimiter::slew_rate),
        }
    }

    fn leak(&mut self) {
        let Some([share, floor]) = self.leak else { return };
        if self.gains.i.abs() < self.smallest {
            return;
        }
        if self.integrator > floor {
            self.integrator = self.integrator - (self.integrator - floor) * share;
        } else if self.integrator < -floor {
            self.integrator = self.integrator - (self.integrator + floor) * share;
        }
    }

    fn integrate(&mut self, limited: bool) {
        let small = self.smallest;
        let (integrator, error) = (self.integrator, self.error);
        let shrinks =
            (integrator >= small && error <= -small) || (integrator <= -small && error >= small);
        if self.gains.i.abs() < small {
            self.integrator = F::zero();
        } else if !limited || shrinks {
            let next = integrator + error * self.gains.i * self.dt;
            self.integrator = next.max(-self.gains.imax).min(self.gains.imax);
        }
    }

    fn limited_pd(&mut self) -> (F, F, F) {
        let (mut p, mut d) = (self.error * self.gains.p, self.derivative * self.gains.d);
        let demand = self.last_pd * self.slew_scale;
        let dmod = self.slew.as_mut().map_or_else(F::one, |slew| slew.modifier(demand, self.dt));
        p = p * dmod;
        d = d * dmod;
        let size = (p + d).abs();
        if self.gains.pdmx >= self.smallest && size > self.gains.pdmx {
            let scale = self.gains.pdmx / size;
            p = p * scale;
            d = d * scale;
        }
        self.last_pd = p + d;
        (p, d, dmod)
    }
}

fn filtered<F: Float>(notch: &mut Option<Notch<F>>, sample: F) -> F {
    match notch {
        Some(notch) => notch.apply(sample),
        None => sample,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gains() -> PidGains<f32> {
        PidGains {
            p: 0.5,
            i: 2.0,
            d: 0.0,
            ff: 0.0,
            d_ff: 0.0,
            imax: 0.25,
            pdmx: 0.1,
            fltt: 0.0,
            flte: 0.0,
            fltd: 0.0,
            smax: 0.0,
            target_notch: [0.0; 3],
            error_notch: [0.0; 3],
        }
    }

    #[test]
    fn integrator_stops_at_its_bound_and_shrinks_under_the_limit_flag() {
        let mut pid = Pid::new(gains(), 0.1);
        let grown = (0..9).map(|_| pid.update(1.0, 0.0, false)).last().unwrap();
        assert_eq!(grown.i, 0.25);
        assert_eq!(pid.update(1.0, 0.5, true).i, 0.25);
        assert!(pid.update(-1.0, 0.0, true).i < 0.25);
    }

    #[test]
    fn sum_of_p_and_d_is_bounded() {
        let mut pid = Pid::new(gains(), 0.1);
        let terms = pid.update(1.0, 0.0, false);
        assert!(((terms.p + terms.d).abs() - 0.1).abs() < 1e-6);
    }

    #[test]
    fn goes_on_from_a_known_loop() {
        let gains = PidGains { d: 0.01, fltd: 20.0, ..gains() };
        let mut first = Pid::new(gains, 0.1);
        first.update(0.1, 0.0, false);
        let known = first.update(0.2, 0.05, false);
        let state = [known.target, known.error, known.d / gains.d, known.i];
        let mut second = Pid::new(gains, 0.1).resumed(state);
        let (a, b) = (first.update(0.1, 0.3, false), second.update(0.1, 0.3, false));
        assert!((a.d - b.d).abs() < 1e-7 && (a.i - b.i).abs() < 1e-7 && (a.p - b.p).abs() < 1e-7);
    }

    #[test]
    fn a_leaking_integrator_settles_above_its_floor() {
        let free = PidGains { imax: 10.0, ..gains() };
        let mut pid = Pid::new(free, 0.01).with_leak(0.02, 0.1);
        let settled = (0..2000).map(|_| pid.update(0.05, 0.0, false)).last().unwrap();
        // In balance the leak of 2 % of the excess equals a loop's growth of 0.05·2·0.01.
        assert!((settled.i - (0.1 + 0.001 / 0.02)).abs() < 2e-3, "{}", settled.i);
    }
}
