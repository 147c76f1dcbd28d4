//! ArduPilot's attitude P loop and its system-identification mode (axes 1–13).
//!
//! Both run at the end of a loop and set what the rate controller takes at the start of the next one:
//! a logged target leads the chirp inside a logged controller output by one loop. Body-frame
//! rate feed-forward is off (ATC_RATE_FF_ENAB 0), so attitude commands are not shaped.

use crate::autopilots::ardupilot_chirp::Chirp;
use crate::error::CoreError;

/// Wait between the start of the mode and the start of the chirp, s.
const DELAY_S: f32 = 1.0;

/// One activation of the mode: the SID_ parameters and when the pilot switches it on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SidRun {
    /// SID_AXIS, 1–13.
    pub axis: u8,
    /// Time of the switch, s.
    pub start_s: f64,
    /// SID_MAGNITUDE in the unit of the axis.
    pub magnitude: f32,
    /// SID_F_START_HZ.
    pub start_hz: f32,
    /// SID_F_STOP_HZ.
    pub stop_hz: f32,
    /// SID_T_FADE_IN, s.
    pub fade_in_s: f32,
    /// SID_T_REC, s.
    pub record_s: f32,
    /// SID_T_FADE_OUT, s.
    pub fade_out_s: f32,
    /// Time at which the pilot leaves the mode, s; infinity: it ends by itself.
    pub leave_s: f64,
}

/// What the mode adds, and what SIDD logs of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Injection {
    /// Added to the pilot's roll and pitch angle (rad) and yaw rate (rad/s).
    pub input: [f64; 3],
    /// Added to the rate targets, rad/s.
    pub rate: [f32; 3],
    /// Added to the actuator commands.
    pub actuator: [f32; 3],
    /// Added to the throttle.
    pub throttle: f64,
    /// SID_AXIS; 0 while the mode is off.
    pub axis: u8,
    /// SIDD.Time, s.
    pub time_s: f32,
    /// SIDD.Targ.
    pub target: f32,
    /// SIDD.F, Hz.
    pub frequency_hz: f32,
}

/// The mode: runs one after the other.
#[derive(Debug, Clone)]
pub struct SystemIdMode {
    dt: f32,
    runs: Vec<(SidRun, Chirp<f32>)>,
    next: usize,
    waveform_time: f32,
}

impl SystemIdMode {
    /// Check the runs and set up their chirps.
    ///
    /// # Errors
    /// `Range` for an axis outside 1–13 or a chirp that the firmware would refuse.
    pub fn new(runs: &[SidRun], dt: f32) -> Result<Self, CoreError> {
        let runs = runs
            .iter()
            .map(|run| {
                if !(1..=13).contains(&run.axis) {
                    let found = f64::from(run.axis);
                    return Err(CoreError::Range { what: "SID_AXIS", found, needed: "1 to 13" });
                }
                let chirp = Chirp::new(
                    run.start_hz,
                    run.stop_hz,
                    run.record_s,
                    run.fade_in_s,
                    run.fade_out_s,
                )?;
                Ok((*run, chirp))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { dt, runs, next: 0, waveform_time: 0.0 })
    }

    /// One loop at `time_s`; the autopilot adds up loop times in single precision, and so does this.
    pub fn update(&mut self, time_s: f64) -> Injection {
        let Some((run, chirp)) = self.runs.get(self.next) else {
            return Injection::default();
        };
        if time_s < run.start_s {
            return Injection::default();
        }
        self.waveform_time += self.dt;
        let length = DELAY_S + run.fade_in_s + chirp.hold_s() + run.record_s + run.fade_out_s;
        if self.waveform_time > length || time_s >= run.leave_s {
            self.next += 1;
            self.waveform_time = 0.0;
            return Injection::default();
        }
        let sample = chirp.sample(self.waveform_time - DELAY_S, run.magnitude);
        let mut injection = Injection {
            axis: run.axis,
            time_s: self.waveform_time,
            target: sample.value,
            frequency_hz: sample.frequency_rad_s / (2.0 * std::f32::consts::PI),
            ..Injection::default()
        };
        let place = usize::from((run.axis - 1) % 3);
        match run.axis {
            1..=6 => injection.input[place] = f64::from(sample.value.to_radians()),
            7..=9 => injection.rate[place] = sample.value.to_radians(),
            10..=12 => injection.actuator[place] = sample.value,
            _ => injection.throttle = f64::from(sample.value),
        }
        injection
    }
}

/// ATC_ANG_xxx_P and ATC_ACCEL_x_MAX.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeGains {
    /// Angle gain of roll, pitch and yaw, 1/s.
    pub angle_p: [f64; 3],
    /// Largest acceleration that the loop plans with, rad/s².
    pub acceleration_rad_s2: [f64; 3],
}

/// Unit quaternion of Euler angles (3-2-1), rad.
pub fn from_euler([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) =
        ((0.5 * roll).sin_cos(), (0.5 * pitch).sin_cos(), (0.5 * yaw).sin_cos());
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

/// Euler angles (3-2-1) of a unit quaternion, rad.
pub fn to_euler([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    [
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - x * z)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    ]
}

/// Rate target (rad/s) for an angle error (rad): proportional, and beyond the error where braking at
/// `acceleration` (rad/s²; 0 is no bound) would begin too late, the square root of it.
pub fn square_root_law(error: f64, gain: f64, acceleration: f64) -> f64 {
    let linear = acceleration / (gain * gain);
    if acceleration <= 0.0 || error.abs() <= linear {
        return gain * error;
    }
    error.signum() * (2.0 * acceleration * (error.abs() - 0.5 * linear)).sqrt()
}

impl AttitudeGains {
    /// Body-rate targets (rad/s) that turn the attitude to the target: P on the rotation vector,
    /// with the square-root law beyond the error where it would ask for more than the acceleration.
    pub fn rate_targets(&self, attitude: [f64; 4], target: [f64; 4]) -> [f32; 3] {
        let [w, x, y, z] = attitude;
        let [tw, tx, ty, tz] = target;
        let scalar = w * tw + x * tx + y * ty + z * tz;
        let vector = [
            w * tx - x * tw - y * tz + z * ty,
            w * ty + x * tz - y * tw - z * tx,
            w * tz - x * ty + y * tx - z * tw,
        ];
        let size = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        let sign = if scalar < 0.0 { -1.0 } else { 1.0 };
        let per_vector = if size > 1e-12 { 2.0 * size.atan2(scalar.abs()) / size } else { 2.0 };
        std::array::from_fn(|i| {
            let error = sign * per_vector * vector[i];
            square_root_law(error, self.angle_p[i], self.acceleration_rad_s2[i]) as f32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAINS: AttitudeGains =
        AttitudeGains { angle_p: [4.5; 3], acceleration_rad_s2: [19.2, 19.2, 4.7] };

    #[test]
    fn small_attitude_errors_are_proportional_and_large_ones_are_not() {
        let level = from_euler([0.0, 0.0, 1.0]);
        let rates = GAINS.rate_targets(level, from_euler([0.1, 0.0, 1.0]));
        assert!((f64::from(rates[0]) - 0.45).abs() < 1e-6 && rates[1].abs() < 1e-6);
        let large = GAINS.rate_targets(level, from_euler([2.0, 0.0, 1.0]));
        assert!(f64::from(large[0]) < 9.0 * 0.9);
    }

    #[test]
    fn euler_angles_return() {
        let angles = [0.3, -0.7, 2.0];
        let back = to_euler(from_euler(angles));
        assert!(angles.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn the_mode_waits_sweeps_ends_and_refuses() {
        let run = SidRun {
            axis: 11,
            start_s: 0.5,
            magnitude: 0.2,
            start_hz: 1.0,
            stop_hz: 10.0,
            fade_in_s: 1.0,
            record_s: 10.0,
            fade_out_s: 1.0,
            leave_s: f64::INFINITY,
        };
        let dt = 0.0025;
        let mut mode = SystemIdMode::new(&[run], dt).unwrap();
        let log: Vec<Injection> = (0..8000).map(|k| mode.update(f64::from(k) * 0.0025)).collect();
        assert!(log[..199].iter().all(|i| i.axis == 0));
        assert!(log[202..598].iter().all(|i| i.axis == 11 && i.target == 0.0));
        let largest = log.iter().map(|i| i.actuator[1]).fold(0.0, f32::max);
        assert!((largest - 0.2).abs() < 1e-3);
        assert!(log[6300..].iter().all(|i| i.axis == 0));
        let mut left = SystemIdMode::new(&[SidRun { leave_s: 3.0, ..run }], dt).unwrap();
        let axes: Vec<u8> = (0..1400).map(|k| left.update(f64::from(k) * 0.0025).axis).collect();
        assert!(axes[1199] == 11 && axes[1200..].iter().all(|&axis| axis == 0));
        assert!(SystemIdMode::new(&[SidRun { axis: 14, ..run }], dt).is_err());
        assert!(SystemIdMode::new(&[SidRun { record_s: 1.0, ..run }], dt).is_err());
    }
}
