//! Rigid-body quadrotor with four lagging rotors (Python side: `vehicles/quadrotor.py`).
//!
//! Newton–Euler equations in body axes (x forward, y right, z down) with quaternion attitude:
//! v̇ = −ω × v + Rᵀg + F/m and I ω̇ = −ω × (I ω + h) − ḣ + M, where h is the rotors' momentum. Rotor
//! thrust follows its command with a first-order lag and loses `axial_damping` newtons for each m/s of
//! hub motion against it; each hub has linear drag in its plane. With one command moved about
//! hover, thrust and moments are linear in it, so the rate axes have an exact transfer function.
//! On the rig the c.g. is held in place, and the gimbal adds inertia and friction.

use crate::autopilots::ardupilot_mixer::FACTORS;

/// Acceleration of gravity, m/s² (standard).
pub const GRAVITY_M_S2: f64 = 9.80665;

/// Spin directions: +1 counter-clockwise seen from above (its reaction yaws the body to the right).
const SPIN: [f64; 4] = [1.0, 1.0, -1.0, -1.0];

/// Physical parameters; see the Python dataclass for their meaning and sources.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub struct Quadrotor {
    pub mass_kg: f64,
    pub inertia_kg_m2: [f64; 3],
    pub arm_m: f64,
    pub rotor_height_m: f64,
    pub maximum_thrust_n: f64,
    pub thrust_expo: f64,
    pub torque_per_thrust_m: f64,
    pub thrust_per_speed_n_s2: f64,
    pub rotor_inertia_kg_m2: f64,
    pub motor_lag_s: f64,
    pub motor_delay_s: f64,
    pub axial_damping_n_s_m: f64,
    pub in_plane_drag_n_s_m: f64,
    pub on_rig: bool,
    pub rig_inertia_kg_m2: [f64; 3],
    pub rig_friction_n_m_s: [f64; 3],
}

/// Number of state variables: position 0–2 (north, east, down), body velocity 3–5, quaternion 6–9,
/// body rates 10–12, rotor thrusts 13–16.
pub const N_STATES: usize = 17;

/// State vector in the order of [`N_STATES`].
pub type State = [f64; N_STATES];

/// Motion of the air: velocity in earth axes (m/s) and body-axis rotation (rad/s).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gust {
    /// Velocity north, east, down, m/s.
    pub velocity_m_s: [f64; 3],
    /// Rotation about the body axes, rad/s.
    pub rate_rad_s: [f64; 3],
}

/// Force without gravity (N) and moment about the c.g. (N m) in body axes, rotor momentum included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Moment without rotor momentum, N m.
    pub moment_n_m: [f64; 3],
    /// Momentum of the rotors along body z, N m s.
    pub rotor_momentum: f64,
    /// Its derivative, N m.
    pub rotor_momentum_rate: f64,
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Rotation from body to earth axes (row-major) of a unit quaternion (w, x, y, z).
pub fn body_to_earth(q: [f64; 4]) -> [[f64; 3]; 3] {
    let [w, x, y, z] = q;
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

fn transposed_times(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|j| m[0][j] * v[0] + m[1][j] * v[1] + m[2][j] * v[2])
}

/// Body rates of a state, rad/s.
pub fn rates(x: &State) -> [f64; 3] {
    [x[10], x[11], x[12]]
}

/// Quaternion of a state.
pub fn quaternion(x: &State) -> [f64; 4] {
    [x[6], x[7], x[8], x[9]]
}

impl Quadrotor {
    /// Hover at the origin, level, nose north.
    pub fn hover(&self) -> State {
        let mut x = [0.0; N_STATES];
        x[6] = 1.0;
        x[13..].fill(self.mass_kg * GRAVITY_M_S2 / 4.0);
        x
    }

    fn total_inertia(&self) -> [f64; 3] {
        let rig = if self.on_rig { self.rig_inertia_kg_m2 } else { [0.0; 3] };
        std::array::from_fn(|i| self.inertia_kg_m2[i] + rig[i])
    }

    /// Hub of a rotor from the c.g., body axes, m.
    fn hub(&self, motor: usize) -> [f64; 3] {
        let side = self.arm_m * std::f64::consts::FRAC_1_SQRT_2;
        [2.0 * side * FACTORS[motor][1], -2.0 * side * FACTORS[motor][0], -self.rotor_height_m]
    }

    /// Loads at a state, with thrust derivatives `thrust_rate` (N/s).
    pub fn loads(&self, x: &State, thrust_rate: [f64; 4], gust: &Gust) -> Loads {
        let earth = body_to_earth(quaternion(x));
        let air = transposed_times(&earth, gust.velocity_m_s);
        let velocity = std::array::from_fn::<f64, 3, _>(|i| x[3 + i] - air[i]);
        let omega = rates(x);
        let turning = std::array::from_fn(|i| omega[i] - gust.rate_rad_s[i]);
        let mut loads = Loads {
            force_n: [0.0; 3],
            moment_n_m: [0.0; 3],
            rotor_momentum: 0.0,
            rotor_momentum_rate: 0.0,
        };
        let floor = 1e-3 * self.maximum_thrust_n;
        for motor in 0..4 {
            let (hub, thrust) = (self.hub(motor), x[13 + motor]);
            let swept = cross(turning, hub);
            let hub_velocity: [f64; 3] = std::array::from_fn(|i| velocity[i] + swept[i]);
            let force = [
                -self.in_plane_drag_n_s_m * hub_velocity[0],
                -self.in_plane_drag_n_s_m * hub_velocity[1],
                -thrust - self.axial_damping_n_s_m * hub_velocity[2],
            ];
            let moment = cross(hub, force);
            for i in 0..3 {
                loads.force_n[i] += force[i];
                loads.moment_n_m[i] += moment[i];
            }
            loads.moment_n_m[2] += SPIN[motor] * self.torque_per_thrust_m * thrust;
            let speed = (thrust.max(floor) / self.thrust_per_speed_n_s2).sqrt();
            let speed_rate = thrust_rate[motor] / (2.0 * self.thrust_per_speed_n_s2 * speed);
            loads.rotor_momentum -= SPIN[motor] * self.rotor_inertia_kg_m2 * speed;
            loads.rotor_momentum_rate -= SPIN[motor] * self.rotor_inertia_kg_m2 * speed_rate;
        }
        if self.on_rig {
            for (moment, (friction, rate)) in
                loads.moment_n_m.iter_mut().zip(self.rig_friction_n_m_s.iter().zip(omega))
            {
                *moment -= friction * rate;
            }
        }
        loads
    }

    /// Specific force that an accelerometer at the c.g. measures, m/s².
    pub fn specific_force(&self, x: &State, gust: &Gust) -> [f64; 3] {
        if self.on_rig {
            let earth = body_to_earth(quaternion(x));
            return transposed_times(&earth, [0.0, 0.0, -GRAVITY_M_S2]);
        }
        self.loads(x, [0.0; 4], gust).force_n.map(|f| f / self.mass_kg)
    }

    /// Time derivative of the state for commanded thrusts, N.
    pub fn derivative(&self, x: &State, command_n: [f64; 4], gust: &Gust) -> State {
        let thrust_rate: [f64; 4] =
            std::array::from_fn(|i| (command_n[i] - x[13 + i]) / self.motor_lag_s);
        let loads = self.loads(x, thrust_rate, gust);
        let (omega, q) = (rates(x), quaternion(x));
        let mut dx = [0.0; N_STATES];
        if !self.on_rig {
            let earth = body_to_earth(q);
            let velocity = [x[3], x[4], x[5]];
            let turn = cross(omega, velocity);
            for i in 0..3 {
                dx[i] = earth[i].iter().zip(velocity).map(|(r, v)| r * v).sum();
                dx[3 + i] = loads.force_n[i] / self.mass_kg + GRAVITY_M_S2 * earth[2][i] - turn[i];
            }
        }
        let [w, a, b, c] = q;
        let [p, yq, r] = omega;
        dx[6] = -0.5 * (a * p + b * yq + c * r);
        dx[7] = 0.5 * (w * p + b * r - c * yq);
        dx[8] = 0.5 * (w * yq + c * p - a * r);
        dx[9] = 0.5 * (w * r + a * yq - b * p);
        let inertia = self.total_inertia();
        let momentum = [inertia[0] * p, inertia[1] * yq, inertia[2] * r + loads.rotor_momentum];
        let turned = cross(omega, momentum);
        for i in 0..3 {
            let spin_up = if i == 2 { loads.rotor_momentum_rate } else { 0.0 };
            dx[10 + i] = (loads.moment_n_m[i] - turned[i] - spin_up) / inertia[i];
        }
        dx[13..].copy_from_slice(&thrust_rate);
        dx
    }

    /// Advance by one Runge–Kutta step of fourth order; the quaternion keeps unit length.
    pub fn step(&self, x: &mut State, command_n: [f64; 4], gust: &Gust, dt: f64) {
        let moved =
            |slope: &State, h: f64| -> State { std::array::from_fn(|i| x[i] + h * slope[i]) };
        let k1 = self.derivative(x, command_n, gust);
        let k2 = self.derivative(&moved(&k1, 0.5 * dt), command_n, gust);
        let k3 = self.derivative(&moved(&k2, 0.5 * dt), command_n, gust);
        let k4 = self.derivative(&moved(&k3, dt), command_n, gust);
        for i in 0..N_STATES {
            x[i] += dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        let norm = x[6..10].iter().map(|v| v * v).sum::<f64>().sqrt();
        x[6..10].iter_mut().for_each(|v| *v /= norm);
    }
}
