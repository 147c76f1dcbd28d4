//! Mixer, thrust curve and PWM of ArduCopter's QUAD/X frame.
//!
//! Follows AP_MotorsMatrix: normalised factors ±0.5, compensation of the battery's sag, yaw given up
//! before roll and pitch, throttle moved so that the commands fit, and the inverse of the thrust
//! curve (MOT_THST_EXPO). Motors: 1 front right and 2 rear left turn counter-clockwise seen from
//! above, 3 front left and 4 rear right clockwise.

/// Factors of roll, pitch and yaw for each motor.
pub const FACTORS: [[f64; 3]; 4] =
    [[-0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.5, 0.5, -0.5], [-0.5, -0.5, -0.5]];

/// Largest part of the range kept for yaw when roll and pitch ask for all of it (MOT_YAW_HEADROOM).
const YAW_HEADROOM: f64 = 0.2;

/// MOT_ parameters and the state of the battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixer {
    /// MOT_THST_EXPO of the autopilot.
    pub thrust_expo: f64,
    /// MOT_SPIN_MIN.
    pub spin_min: f64,
    /// MOT_SPIN_MAX.
    pub spin_max: f64,
    /// MOT_PWM_MIN, µs.
    pub pwm_min_us: f64,
    /// MOT_PWM_MAX, µs.
    pub pwm_max_us: f64,
    /// Step of the PWM output, µs; 0 is continuous.
    pub pwm_step_us: f64,
    /// Battery voltage over its full value.
    pub voltage_ratio: f64,
}

/// Motor commands of one loop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mixed {
    /// PWM of each motor, µs.
    pub pwm_us: [f64; 4],
    /// Roll, pitch or yaw could not be given as asked.
    pub limited: bool,
}

impl Mixer {
    /// Lift available at the present voltage over lift with a full battery.
    pub fn lift_max(&self) -> f64 {
        let v = self.voltage_ratio;
        v * (1.0 - self.thrust_expo) + self.thrust_expo * v * v
    }

    /// Commands in −1…1 and throttle in 0…1 to PWM.
    pub fn mix(&self, command: [f64; 3], throttle: f64) -> Mixed {
        let compensation = 1.0 / self.lift_max();
        let [roll, pitch, yaw] = command.map(|c| c * compensation);
        let throttle = (throttle * compensation).clamp(0.0, 1.0);
        let roll_pitch = FACTORS.map(|f| f[0] * roll + f[1] * pitch);
        let headroom = roll_pitch.iter().map(|v| 1.0 - v.abs() - 0.5).fold(f64::MAX, f64::min);
        // Headroom for yaw is counted on one side of mid-range; each motor sees half the command.
        let yaw_bound = 2.0 * headroom.max(YAW_HEADROOM);
        let yaw_given = yaw.clamp(-yaw_bound, yaw_bound);
        let mut rpy: [f64; 4] = std::array::from_fn(|i| roll_pitch[i] + FACTORS[i][2] * yaw_given);
        let low = rpy.iter().copied().fold(f64::MAX, f64::min);
        let high = rpy.iter().copied().fold(f64::MIN, f64::max);
        let scale = if high - low > 1.0 { 1.0 / (high - low) } else { 1.0 };
        rpy = rpy.map(|v| v * scale);
        // Rounding may put the lower bound above the upper one, which `clamp` would not take.
        let throttle_given = throttle.min(1.0 - high * scale).max(-low * scale);
        let thrust = rpy.map(|v| (throttle_given + v).clamp(0.0, 1.0));
        Mixed { pwm_us: thrust.map(|t| self.pwm_of(t)), limited: scale < 1.0 || yaw_given != yaw }
    }

    fn pwm_of(&self, thrust: f64) -> f64 {
        let e = self.thrust_expo;
        let lifted = self.lift_max() * thrust;
        let ratio = if e == 0.0 {
            lifted
        } else {
            ((e - 1.0) + ((1.0 - e).powi(2) + 4.0 * e * lifted).sqrt()) / (2.0 * e)
        };
        let throttle = (ratio / self.voltage_ratio).clamp(0.0, 1.0);
        let actuator = self.spin_min + (self.spin_max - self.spin_min) * throttle;
        let pwm = self.pwm_min_us + (self.pwm_max_us - self.pwm_min_us) * actuator;
        if self.pwm_step_us > 0.0 {
            (pwm / self.pwm_step_us).round() * self.pwm_step_us
        } else {
            pwm
        }
    }

    /// Steady thrust over full-battery thrust that a motor with thrust curve `expo` gives for a PWM.
    pub fn thrust_ratio(&self, pwm_us: f64, expo: f64) -> f64 {
        let actuator = (pwm_us - self.pwm_min_us) / (self.pwm_max_us - self.pwm_min_us);
        let throttle =
            ((actuator - self.spin_min) / (self.spin_max - self.spin_min)).clamp(0.0, 1.0);
        let drive = throttle * self.voltage_ratio;
        (1.0 - expo) * drive + expo * drive * drive
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mixer() -> Mixer {
        Mixer {
            thrust_expo: 0.65,
            spin_min: 0.15,
            spin_max: 0.95,
            pwm_min_us: 1000.0,
            pwm_max_us: 2000.0,
            pwm_step_us: 0.0,
            voltage_ratio: 0.93,
        }
    }

    #[test]
    fn the_thrust_curve_is_undone_at_any_voltage() {
        let m = mixer();
        let mixed = m.mix([0.2, -0.1, 0.05], 0.4);
        for (pwm, f) in mixed.pwm_us.iter().zip(FACTORS) {
            let asked = 0.4 + 0.2 * f[0] - 0.1 * f[1] + 0.05 * f[2];
            assert!((m.thrust_ratio(*pwm, 0.65) - asked).abs() < 1e-12);
        }
        assert!(!mixed.limited);
    }

    #[test]
    fn yaw_gives_way_and_throttle_moves() {
        let mixed = mixer().mix([0.6, 0.0, 1.0], 0.1);
        assert!(mixed.limited);
        assert!(mixed.pwm_us.iter().all(|p| (1150.0 - 1e-9..=1950.0 + 1e-9).contains(p)));
        let spread = mixed.pwm_us[1] - mixed.pwm_us[0];
        assert!(spread > 0.0, "roll to the right lifts the left side");
    }
}
