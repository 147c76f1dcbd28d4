//! Twin-rotor rig: a beam on a pivot with a main and a tail rotor (Python side:
//! `vehicles/twin_rotor.py`).
//!
//! With pitch ψ from the horizontal, yaw φ, motor momenta-like states τ₁, τ₂ and the thrust moments
//! Mᵢ = aᵢ τᵢ|τᵢ| + bᵢ τᵢ:
//! I₁ ψ̈ = M₁ − M_g sin(ψ − ψ₀) − c sin(2ψ) φ̇²/2 − B₁ ψ̇ − C₁ sgn ψ̇ − K_gy M₁ φ̇ cos ψ + d₁,
//! I₂ φ̈ = M₂ − M_r − S φ − B₂ φ̇ − C₂ sgn φ̇ + d₂, M_r = k_c (T₀ s + 1)/(T_p s + 1) M₁,
//! T₁ᵢ τ̇ᵢ = kᵢ uᵢ − T₀ᵢ τᵢ. Reference: Feedback Instruments, *Twin Rotor MIMO System Control
//! Experiments* 33-949S; the spring S of the cable as in Rahideh & Shaheed, Proc. IMechE Part I 221
//! (2007), 89–101.

use crate::error::CoreError;
use crate::numerics::random::Random;

/// Number of states: pitch and its rate, yaw and its rate, τ₁, τ₂, the lag of the reaction moment.
pub const N_STATES: usize = 7;

/// State vector in the order of [`N_STATES`].
pub type State = [f64; N_STATES];

/// Rate over which Coulomb friction changes its sign, rad/s: a bearing creeps before it slides, and
/// a jump would stop the integrator from converging.
const CREEP_RAD_S: f64 = 0.01;

/// Physical parameters; see the Python dataclass for their meaning and sources. Pairs are (pitch,
/// yaw) or (main, tail).
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct TwinRotor {
    pub inertia_kg_m2: [f64; 2],
    pub thrust_square_n_m: [f64; 2],
    pub thrust_linear_n_m: [f64; 2],
    pub gravity_moment_n_m: f64,
    pub rest_angle_rad: f64,
    pub centrifugal_kg_m2: f64,
    pub viscous_friction_n_m_s: [f64; 2],
    pub coulomb_friction_n_m: [f64; 2],
    pub cable_stiffness_n_m: f64,
    pub gyroscopic_s: f64,
    pub reaction_gain: f64,
    pub reaction_lead_s: f64,
    pub reaction_lag_s: f64,
    pub motor_gain_per_v: [f64; 2],
    pub motor_lag_s: [f64; 2],
    pub maximum_voltage_v: f64,
    pub yaw_locked: bool,
}

/// Errors of the position sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Encoders {
    /// Angle of one count, rad; 0 for a continuous sensor.
    pub step_rad: f64,
    /// Standard deviation of white noise before quantisation, rad.
    pub noise_rad: f64,
}

/// Air that moves about the beam: Gauss–Markov moments on pitch and yaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Draught {
    /// Standard deviation of each moment, N m.
    pub moment_n_m: [f64; 2],
    /// Correlation time, s.
    pub time_s: f64,
}

/// What one run needs beside the rig.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Voltages of the main and the tail rotor, 2 × n, held between samples.
    pub voltages_v: &'a [f64],
    /// Time between samples, s.
    pub sample_time_s: f64,
    /// Runge–Kutta steps in each sample.
    pub substeps: usize,
    /// Seed of draught and noise.
    pub seed: u64,
}

impl TwinRotor {
    fn thrust(&self, rotor: usize, tau: f64) -> f64 {
        self.thrust_square_n_m[rotor] * tau * tau.abs() + self.thrust_linear_n_m[rotor] * tau
    }

    fn friction(&self, axis: usize, rate: f64) -> f64 {
        self.viscous_friction_n_m_s[axis] * rate
            + self.coulomb_friction_n_m[axis] * (rate / CREEP_RAD_S).tanh()
    }

    /// Time derivative of the state under voltages (V) and disturbing moments (N m).
    pub fn derivative(&self, x: &State, voltage_v: [f64; 2], disturbance: [f64; 2]) -> State {
        let [pitch, pitch_rate, yaw, yaw_rate, main, tail, lagged] = *x;
        let (lift, side) = (self.thrust(0, main), self.thrust(1, tail));
        let pitch_moment = lift
            - self.gravity_moment_n_m * (pitch - self.rest_angle_rad).sin()
            - 0.5 * self.centrifugal_kg_m2 * (2.0 * pitch).sin() * yaw_rate * yaw_rate
            - self.friction(0, pitch_rate)
            - self.gyroscopic_s * lift * yaw_rate * pitch.cos()
            + disturbance[0];
        let quick = self.reaction_lead_s / self.reaction_lag_s;
        let reaction = self.reaction_gain * (quick * (lift - lagged) + lagged);
        let yaw_moment =
            side - reaction - self.cable_stiffness_n_m * yaw - self.friction(1, yaw_rate)
                + disturbance[1];
        let motor = |rotor: usize, tau: f64| {
            let limit = self.maximum_voltage_v;
            let command = self.motor_gain_per_v[rotor] * voltage_v[rotor].clamp(-limit, limit);
            (command - tau) / self.motor_lag_s[rotor]
        };
        let moves = if self.yaw_locked { 0.0 } else { 1.0 };
        [
            pitch_rate,
            pitch_moment / self.inertia_kg_m2[0],
            moves * yaw_rate,
            moves * yaw_moment / self.inertia_kg_m2[1],
            motor(0, main),
            motor(1, tail),
            (lift - lagged) / self.reaction_lag_s,
        ]
    }

    fn step(&self, x: &mut State, voltage_v: [f64; 2], disturbance: [f64; 2], dt: f64) {
        let moved =
            |slope: &State, h: f64| -> State { std::array::from_fn(|i| x[i] + h * slope[i]) };
        let k1 = self.derivative(x, voltage_v, disturbance);
        let k2 = self.derivative(&moved(&k1, 0.5 * dt), voltage_v, disturbance);
        let k3 = self.derivative(&moved(&k2, 0.5 * dt), voltage_v, disturbance);
        let k4 = self.derivative(&moved(&k3, dt), voltage_v, disturbance);
        *x = std::array::from_fn(|i| x[i] + dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }

    /// Measured and true pitch and yaw, 4 × n: rows measured pitch, measured yaw, pitch, yaw.
    ///
    /// # Errors
    /// Voltages that are not 2 × n, no step, or a state that leaves the finite numbers.
    pub fn run(
        &self,
        start: State,
        encoders: &Encoders,
        draught: &Draught,
        run: &Run<'_>,
    ) -> Result<Vec<f64>, CoreError> {
        let n = run.voltages_v.len() / 2;
        if !run.voltages_v.len().is_multiple_of(2) || run.substeps == 0 {
            let (found, needed) = (run.voltages_v.len(), 2 * n);
            return Err(CoreError::Shape { what: "voltages of two rotors", found, needed });
        }
        // Sensor noise has a stream of its own: calmer air must not change it.
        let mut air = Random::new(run.seed);
        let mut sensor = Random::new(run.seed ^ 0x5EED_0F5E_4501_D0E5);
        let dt = run.sample_time_s / run.substeps as f64;
        let keep = if draught.time_s > 0.0 { (-dt / draught.time_s).exp() } else { 0.0 };
        let drive = (1.0 - keep * keep).sqrt();
        let mut moment = draught.moment_n_m.map(|sigma| sigma * air.normal());
        let mut x = start;
        let mut rows = vec![0.0; 4 * n];
        for k in 0..n {
            for (axis, angle) in [x[0], x[2]].into_iter().enumerate() {
                let noisy = angle + encoders.noise_rad * sensor.normal();
                rows[axis * n + k] = quantised(noisy, encoders.step_rad);
                rows[(2 + axis) * n + k] = angle;
            }
            let voltage_v = [run.voltages_v[k], run.voltages_v[n + k]];
            for _ in 0..run.substeps {
                self.step(&mut x, voltage_v, moment, dt);
                moment = std::array::from_fn(|axis| {
                    keep * moment[axis] + drive * draught.moment_n_m[axis] * air.normal()
                });
            }
            if x.iter().any(|value| !value.is_finite()) {
                return Err(CoreError::NotFinite { what: "state of the twin rotor", index: k });
            }
        }
        Ok(rows)
    }
}

fn quantised(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}
