//! A simulated flight: quadrotor, sensors, gusts and autopilot in one loop (Python side:
//! `vehicles/flight.py`).
//!
//! Order within loop k, as in ArduCopter's fast loop: gyro sample and filter, rate controllers (with
//! the targets and injections that loop k − 1 left behind), mixer and motors, then attitude loop and
//! flight mode, then the log row. The motors hold each command for one loop, after a delay that need
//! not be a whole number of loops: the integration is cut where the command changes.

use crate::autopilots::ardupilot_mixer::{Mixed, Mixer};
use crate::autopilots::ardupilot_mode::{
    AttitudeGains, Injection, SidRun, SystemIdMode, from_euler, to_euler,
};
use crate::autopilots::ardupilot_pid::{Pid, PidGains, PidTerms};
use crate::autopilots::gyro_filter::GyroFilter;
use crate::error::CoreError;
use crate::numerics::random::Random;
use crate::vehicles::quadrotor::{
    GRAVITY_M_S2, Gust, N_STATES, Quadrotor, State, quaternion, rates,
};
use crate::vehicles::turbulence::{Markov, Turbulence};

/// Throttle per metre of height error and per m/s of climb of the pilot who keeps the height.
const HEIGHT_GAINS: [f64; 2] = [0.03, 0.05];

/// Settings of the autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Autopilot {
    /// SCHED_LOOP_RATE, Hz.
    pub loop_rate_hz: f64,
    /// INS_GYRO_FILTER, Hz; 0 is off.
    pub gyro_filter_hz: f64,
    /// ATC_RAT_RLL, PIT and YAW.
    pub rate: [PidGains<f32>; 3],
    /// ATC_ANG and ATC_ACCEL.
    pub attitude: AttitudeGains,
    /// MOT_ parameters.
    pub mixer: Mixer,
}

/// Errors of the inertial sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Standard deviation of a gyro sample, rad/s.
    pub gyro_noise_rad_s: f64,
    /// Gyro bias, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Standard deviation of an accelerometer sample, m/s².
    pub accelerometer_noise_m_s2: f64,
    /// Accelerometer bias, m/s².
    pub accelerometer_bias_m_s2: [f64; 3],
}

/// Columns of a log row, in order, parted by blanks.
pub const COLUMNS: &str = "time_s gyro_x gyro_y gyro_z gyro_mean_x gyro_mean_y gyro_mean_z gyro_filtered_x \
    gyro_filtered_y gyro_filtered_z accelerometer_x accelerometer_y accelerometer_z phi theta \
    psi phi_ref theta_ref psi_ref p_ref q_ref r_ref tau_phi tau_theta tau_psi thrust pwm_1 \
    pwm_2 pwm_3 pwm_4 limited roll_pid_target roll_pid_error roll_pid_p roll_pid_i roll_pid_d \
    roll_pid_ff roll_pid_d_ff pitch_pid_target pitch_pid_error pitch_pid_p pitch_pid_i \
    pitch_pid_d pitch_pid_ff pitch_pid_d_ff yaw_pid_target yaw_pid_error yaw_pid_p yaw_pid_i \
    yaw_pid_d yaw_pid_ff yaw_pid_d_ff sid_axis sid_time_s sid_target sid_frequency_hz p q r \
    north_m east_m down_m u_m_s v_m_s w_m_s thrust_1_n thrust_2_n thrust_3_n thrust_4_n \
    gust_u_m_s gust_p_rad_s sid_applied pid_limited roll_pid_dmod pitch_pid_dmod yaw_pid_dmod \
    roll_pid_slew_rate pitch_pid_slew_rate yaw_pid_slew_rate";

/// What happens in one flight.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// Pilot's roll angle, pitch angle (rad) and yaw rate (rad/s) for each loop: 3 × n_loops.
    pub pilot: &'a [f64],
    /// Activations of the system-identification mode, in order of time.
    pub runs: &'a [SidRun],
    /// A log row is written every so many loops.
    pub log_every: usize,
    /// Seed of all noise.
    pub seed: u64,
}

/// Thrust commands on their way to the motors.
struct MotorDelay {
    queue: Vec<[f64; 4]>,
    /// Whole loops and the rest (s) that a command needs.
    whole: usize,
    rest_s: f64,
}

impl MotorDelay {
    fn new(delay_s: f64, dt: f64, hover: [f64; 4]) -> Self {
        let loops = delay_s / dt;
        let whole = (loops + 1e-9).floor();
        let rest_s = ((loops - whole) * dt).max(0.0);
        let rest_s = if rest_s < 1e-9 * dt { 0.0 } else { rest_s };
        Self { queue: vec![hover; whole as usize + 2], whole: whole as usize, rest_s }
    }

    /// Take the command of loop `k`; give those that act before and after the cut.
    fn pass(&mut self, k: usize, command: [f64; 4]) -> ([f64; 4], [f64; 4]) {
        let n = self.queue.len();
        self.queue[k % n] = command;
        (self.queue[(k + n - self.whole - 1) % n], self.queue[(k + n - self.whole) % n])
    }
}

struct Loop<'a> {
    vehicle: &'a Quadrotor,
    autopilot: &'a Autopilot,
    dt: f64,
    pids: [Pid<f32>; 3],
    filters: [GyroFilter<f64>; 3],
    mode: SystemIdMode,
    injection: Injection,
    rate_target: [f32; 3],
    yaw_target: f64,
    angle_target: [f64; 3],
    limited: bool,
    last_gyro: Option<[f64; 3]>,
    hover_throttle: f64,
}

/// What the first half of a loop leaves for the log.
struct Acted {
    gyro: [f64; 3],
    gyro_mean: [f64; 3],
    filtered: [f64; 3],
    terms: [PidTerms<f32>; 3],
    output: [f64; 3],
    throttle: f64,
    mixed: Mixed,
    /// The injected target that this loop's output holds.
    applied: f32,
    /// The limit flag that the controllers saw.
    was_limited: bool,
}

impl Loop<'_> {
    fn act(&mut self, x: &State, gyro: [f64; 3], k: usize) -> Result<Acted, CoreError> {
        let last = self.last_gyro.replace(gyro).unwrap_or(gyro);
        let filtered: [f64; 3] = std::array::from_fn(|i| self.filters[i].apply(gyro[i]));
        let terms: [PidTerms<f32>; 3] = std::array::from_fn(|i| {
            let target = self.rate_target[i] + self.injection.rate[i];
            self.pids[i].update(target, filtered[i] as f32, self.limited)
        });
        let output: [f64; 3] = std::array::from_fn(|i| {
            f64::from(terms[i].feedback() + self.injection.actuator[i] + terms[i].feedforward())
        });
        if !(output.iter().all(|v| v.is_finite()) && x.iter().all(|v| v.is_finite())) {
            return Err(CoreError::NotFinite { what: "simulated flight", index: k });
        }
        let throttle = self.throttle(x) + self.injection.throttle;
        let mixed = self.autopilot.mixer.mix(output, throttle);
        let was_limited = std::mem::replace(&mut self.limited, mixed.limited);
        let gyro_mean = std::array::from_fn(|i| 0.5 * (gyro[i] + last[i]));
        let applied = self.injection.target;
        Ok(Acted {
            gyro,
            gyro_mean,
            filtered,
            terms,
            output,
            throttle,
            mixed,
            applied,
            was_limited,
        })
    }

    fn throttle(&self, x: &State) -> f64 {
        if self.vehicle.on_rig {
            return self.hover_throttle;
        }
        let earth = crate::vehicles::quadrotor::body_to_earth(quaternion(x));
        let climb = -(0..3).map(|i| earth[2][i] * x[3 + i]).sum::<f64>();
        let upright = earth[2][2].max(0.5);
        self.hover_throttle / upright + HEIGHT_GAINS[0] * x[2] - HEIGHT_GAINS[1] * climb
    }

    /// Attitude loop and flight mode: what the next loop will take.
    fn plan(&mut self, x: &State, pilot: [f64; 3], time_s: f64) {
        self.injection = self.mode.update(time_s);
        let input = self.injection.input;
        self.yaw_target += (pilot[2] + input[2]) * self.dt;
        self.angle_target = [pilot[0] + input[0], pilot[1] + input[1], self.yaw_target];
        self.rate_target =
            self.autopilot.attitude.rate_targets(quaternion(x), from_euler(self.angle_target));
        self.rate_target[2] += (pilot[2] + input[2]) as f32;
    }

    fn thrust_command(&self, mixed: &Mixed) -> [f64; 4] {
        let (mixer, vehicle) = (&self.autopilot.mixer, self.vehicle);
        mixed
            .pwm_us
            .map(|pwm| vehicle.maximum_thrust_n * mixer.thrust_ratio(pwm, vehicle.thrust_expo))
    }

    fn log(
        &self,
        rows: &mut Vec<f64>,
        time_s: f64,
        x: &State,
        a: &Acted,
        accel: [f64; 3],
        gust: &Gust,
    ) {
        rows.push(time_s);
        for block in
            [a.gyro, a.gyro_mean, a.filtered, accel, to_euler(quaternion(x)), self.angle_target]
        {
            rows.extend(block);
        }
        for i in 0..3 {
            rows.push(f64::from(self.rate_target[i] + self.injection.rate[i]));
        }
        rows.extend(a.output);
        rows.push(a.throttle);
        rows.extend(a.mixed.pwm_us);
        rows.push(f64::from(u8::from(a.mixed.limited)));
        for t in a.terms {
            rows.extend([t.target, t.error, t.p, t.i, t.d, t.ff, t.d_ff].map(f64::from));
        }
        let sid = &self.injection;
        rows.push(f64::from(sid.axis));
        rows.extend([sid.time_s, sid.target, sid.frequency_hz].map(f64::from));
        rows.extend(rates(x));
        rows.extend(&x[..6]);
        rows.extend(&x[13..N_STATES]);
        rows.extend([gust.velocity_m_s[0], gust.rate_rad_s[0], f64::from(a.applied)]);
        rows.push(f64::from(u8::from(a.was_limited)));
        rows.extend(a.terms.map(|t| f64::from(t.dmod)));
        rows.extend(a.terms.map(|t| f64::from(t.slew_rate)));
    }
}

fn check(vehicle: &Quadrotor, autopilot: &Autopilot, plan: &Plan<'_>) -> Result<(), CoreError> {
    let positive = [
        ("mass", vehicle.mass_kg),
        ("arm", vehicle.arm_m),
        ("maximum thrust", vehicle.maximum_thrust_n),
        ("rotor speed coefficient", vehicle.thrust_per_speed_n_s2),
        ("motor lag", vehicle.motor_lag_s),
        ("loop rate", autopilot.loop_rate_hz),
        ("voltage ratio", autopilot.mixer.voltage_ratio),
        ("smallest inertia", vehicle.inertia_kg_m2.iter().copied().fold(f64::MAX, f64::min)),
    ];
    for (what, found) in positive {
        if !(found > 0.0 && found.is_finite()) {
            return Err(CoreError::Range { what, found, needed: "a positive number" });
        }
    }
    if !(0.0..=1.0).contains(&vehicle.motor_delay_s) {
        let found = vehicle.motor_delay_s;
        return Err(CoreError::Range { what: "motor delay", found, needed: "0 to 1 s" });
    }
    if let Some(gains) = autopilot.rate.iter().find(|gains| !gains.is_sound()) {
        let needed = "finite gains, with bounds and filters of 0 or more";
        return Err(CoreError::Range {
            what: "rate controller",
            found: f64::from(gains.p),
            needed,
        });
    }
    if plan.log_every == 0 {
        return Err(CoreError::Range { what: "log divider", found: 0.0, needed: "1 or more" });
    }
    if !plan.pilot.len().is_multiple_of(3) {
        let needed = plan.pilot.len() / 3 * 3;
        return Err(CoreError::Shape { what: "pilot inputs", found: plan.pilot.len(), needed });
    }
    match plan.pilot.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "pilot inputs", index }),
        None => Ok(()),
    }
}

/// Fly a plan from hover; rows of [`COLUMNS`], one after the other.
///
/// # Errors
/// `Range` for a parameter without meaning or a throttle that cannot hover, `Shape` and
/// `NotFinite` for pilot inputs, `NotFinite` where the flight diverges.
pub fn fly(
    vehicle: &Quadrotor,
    autopilot: &Autopilot,
    sensors: &Sensors,
    turbulence: &Turbulence,
    plan: &Plan<'_>,
) -> Result<Vec<f64>, CoreError> {
    check(vehicle, autopilot, plan)?;
    let dt = 1.0 / autopilot.loop_rate_hz;
    let hover_throttle = vehicle.mass_kg * GRAVITY_M_S2 / (4.0 * vehicle.maximum_thrust_n);
    if hover_throttle >= autopilot.mixer.lift_max() {
        let needed = "below the thrust that the battery gives";
        return Err(CoreError::Range { what: "hover throttle", found: hover_throttle, needed });
    }
    let mut state = Loop {
        vehicle,
        autopilot,
        dt,
        pids: autopilot.rate.map(|gains| Pid::new(gains, dt as f32)),
        filters: std::array::from_fn(|_| {
            GyroFilter::new(autopilot.gyro_filter_hz, autopilot.loop_rate_hz)
        }),
        mode: SystemIdMode::new(plan.runs, dt as f32)?,
        injection: Injection::default(),
        rate_target: [0.0; 3],
        yaw_target: 0.0,
        angle_target: [0.0; 3],
        limited: false,
        last_gyro: None,
        hover_throttle,
    };
    run(&mut state, sensors, turbulence, plan)
}

fn run(
    state: &mut Loop<'_>,
    sensors: &Sensors,
    turbulence: &Turbulence,
    plan: &Plan<'_>,
) -> Result<Vec<f64>, CoreError> {
    let (vehicle, dt, n_loops) = (state.vehicle, state.dt, plan.pilot.len() / 3);
    let mut random = Random::new(plan.seed);
    // A stream of its own, so that the log rate does not change the flight.
    let mut log_random = Random::new(!plan.seed);
    let mut x = vehicle.hover();
    let t = turbulence;
    let mut wind = Markov::<3>::new(t.velocity_m_s, t.velocity_time_s, dt, &mut random);
    let mut turn = Markov::<3>::new(t.rate_rad_s, t.rate_time_s, dt, &mut random);
    let mut delay = MotorDelay::new(vehicle.motor_delay_s, dt, [x[13], x[14], x[15], x[16]]);
    let width = COLUMNS.split_whitespace().count();
    let mut rows = Vec::with_capacity((n_loops / plan.log_every + 1) * width);
    for k in 0..n_loops {
        let time_s = k as f64 * dt;
        let gust = Gust { velocity_m_s: wind.value, rate_rad_s: turn.value };
        let noise = random.normals::<3>(sensors.gyro_noise_rad_s);
        let omega = rates(&x);
        let gyro = std::array::from_fn(|i| omega[i] + sensors.gyro_bias_rad_s[i] + noise[i]);
        let acted = state.act(&x, gyro, k)?;
        let pilot = std::array::from_fn(|i| plan.pilot[i * n_loops + k]);
        state.plan(&x, pilot, time_s);
        if k % plan.log_every == 0 {
            let noise = log_random.normals::<3>(sensors.accelerometer_noise_m_s2);
            let force = vehicle.specific_force(&x, &gust);
            let accel =
                std::array::from_fn(|i| force[i] + sensors.accelerometer_bias_m_s2[i] + noise[i]);
            state.log(&mut rows, time_s, &x, &acted, accel, &gust);
        }
        let (before, after) = delay.pass(k, state.thrust_command(&acted.mixed));
        if delay.rest_s > 0.0 {
            vehicle.step(&mut x, before, &gust, delay.rest_s);
        }
        vehicle.step(&mut x, after, &gust, dt - delay.rest_s);
        wind.advance(&mut random);
        turn.advance(&mut random);
    }
    Ok(rows)
}
