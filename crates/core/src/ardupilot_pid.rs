//! ArduPilot's rate PID in the autopilot's own single precision (Python side:
//! `simulation/autopilot.py`).
//!
//! Structure of AC_PID: low-pass on target (FLTT), on error (FLTE) and on the derivative of the
//! filtered error (FLTD), integrator clamped to IMAX, P + D clamped to PDMX, feed-forward outside.
//! Notches and the slew limiter (NTF, NEF, SMAX) are off, as they are by default.

/// Settings of one axis; names and units of the ATC_RAT_xxx parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidGains {
    /// P, 1/(rad/s).
    pub p: f32,
    /// I, 1/rad.
    pub i: f32,
    /// D, 1/(rad/s²).
    pub d: f32,
    /// FF, 1/(rad/s).
    pub ff: f32,
    /// D_FF, 1/(rad/s²).
    pub d_ff: f32,
    /// IMAX, largest integrator output.
    pub imax: f32,
    /// PDMX, largest |P + D|; 0 is off.
    pub pdmx: f32,
    /// FLTT, target filter, Hz; 0 is off.
    pub fltt: f32,
    /// FLTE, error filter, Hz; 0 is off.
    pub flte: f32,
    /// FLTD, derivative filter, Hz; 0 is off.
    pub fltd: f32,
}

impl PidGains {
    /// Every number is finite, and bounds and filters are not negative.
    pub fn is_sound(&self) -> bool {
        let bounds = [self.imax, self.pdmx, self.fltt, self.flte, self.fltd];
        let gains = [self.p, self.i, self.d, self.ff, self.d_ff];
        bounds.iter().all(|v| v.is_finite() && *v >= 0.0) && gains.iter().all(|v| v.is_finite())
    }
}

/// What the controller computed in one loop, as PIDR, PIDP and PIDY log it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidTerms {
    /// Filtered target, rad/s.
    pub target: f32,
    /// Filtered error, rad/s.
    pub error: f32,
    /// Proportional output.
    pub p: f32,
    /// Integrator output.
    pub i: f32,
    /// Derivative output.
    pub d: f32,
    /// Feed-forward of the target.
    pub ff: f32,
    /// Feed-forward of the target's derivative.
    pub d_ff: f32,
}

impl PidTerms {
    /// Sum without feed-forward.
    pub fn feedback(&self) -> f32 {
        self.p + self.d + self.i
    }

    /// Feed-forward, which the mixer adds.
    pub fn feedforward(&self) -> f32 {
        self.ff + self.d_ff
    }
}

/// One axis of the rate controller.
#[derive(Debug, Clone)]
pub struct Pid {
    gains: PidGains,
    dt: f32,
    target: f32,
    error: f32,
    derivative: f32,
    integrator: f32,
    started: bool,
}

/// Weight of the newest sample in ArduPilot's one-pole filter; a cut-off of 0 Hz switches it off.
fn newest_weight(dt: f32, cutoff_hz: f32) -> f32 {
    if cutoff_hz <= 0.0 {
        return 1.0;
    }
    let rc = 1.0 / (2.0 * std::f32::consts::PI * cutoff_hz);
    dt / (dt + rc)
}

impl Pid {
    /// A controller at rest with a loop time, s.
    pub fn new(gains: PidGains, dt: f32) -> Self {
        Self {
            gains,
            dt,
            target: 0.0,
            error: 0.0,
            derivative: 0.0,
            integrator: 0.0,
            started: false,
        }
    }

    /// One loop: target and measured rate in rad/s; with `limited` the integrator may only shrink.
    pub fn update(&mut self, target: f32, measured: f32, limited: bool) -> PidTerms {
        let (g, dt) = (self.gains, self.dt);
        let mut target_derivative = 0.0;
        if self.started {
            let (target_last, error_last) = (self.target, self.error);
            self.target += newest_weight(dt, g.fltt) * (target - self.target);
            self.error += newest_weight(dt, g.flte) * ((self.target - measured) - self.error);
            let derivative = (self.error - error_last) / dt;
            self.derivative += newest_weight(dt, g.fltd) * (derivative - self.derivative);
            target_derivative = (self.target - target_last) / dt;
        } else {
            self.started = true;
            self.target = target;
            self.error = target - measured;
        }
        self.integrate(limited);
        let (p, d) = self.limited_pd();
        PidTerms {
            target: self.target,
            error: self.error,
            p,
            i: self.integrator,
            d,
            ff: self.target * g.ff,
            d_ff: target_derivative * g.d_ff,
        }
    }

    fn integrate(&mut self, limited: bool) {
        let shrinks = self.integrator * self.error < 0.0;
        if self.gains.i == 0.0 {
            self.integrator = 0.0;
        } else if !limited || shrinks {
            let next = self.integrator + self.error * self.gains.i * self.dt;
            self.integrator = next.clamp(-self.gains.imax, self.gains.imax);
        }
    }

    fn limited_pd(&self) -> (f32, f32) {
        let (p, d) = (self.error * self.gains.p, self.derivative * self.gains.d);
        let size = (p + d).abs();
        if self.gains.pdmx > 0.0 && size > self.gains.pdmx {
            let scale = self.gains.pdmx / size;
            return (p * scale, d * scale);
        }
        (p, d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gains() -> PidGains {
        PidGains { p: 0.5, i: 2.0, imax: 0.25, pdmx: 0.1, ..PidGains::default() }
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
    fn filters_off_pass_everything() {
        assert_eq!(newest_weight(0.0025, 0.0), 1.0);
        let weight = newest_weight(0.0025, 20.0);
        assert!((weight - 0.239_057).abs() < 1e-6);
    }
}
