//! Rigid-body kinematics with exact sensitivities (Python side: `conditioning/kinematics.py`).
//!
//! States x = (φ, θ, ψ, u, v, w), inputs (p, q, r, a_x, a_y, a_z):
//! φ̇ = p + tan θ (q sin φ + r cos φ), θ̇ = q cos φ − r sin φ, ψ̇ = (q sin φ + r cos φ) / cos θ,
//! u̇ = r v − q w − g sin θ + a_x, v̇ = p w − r u + g cos θ sin φ + a_y,
//! ẇ = q u − p v + g cos θ cos φ + a_z (Klein & Morelli, *Aircraft System Identification*, chapter
//! 10; Jategaonkar, *Flight Vehicle System Identification*, chapter 10).
//!
//! A classical Runge–Kutta step uses the inputs at its start, middle and end. The sensitivities to
//! the initial state and to each input (as an offset, and times the input itself) are advanced by
//! the same step on the differentiated equations: they are the derivatives of the numbers returned,
//! not of a limit. An offset of an input over the whole record has the sensitivity of a bias.

use crate::error::CoreError;

/// Number of states, and of inputs.
pub const N: usize = 6;
/// Columns of the sensitivity: initial states, offsets of the inputs, gains of the inputs.
pub const COLUMNS: usize = 3 * N;

type Vector = [f64; N];
type Square = [[f64; N]; N];
type Sensitivity = [[f64; COLUMNS]; N];

/// States (n × 6) and sensitivities (n × 6 × 18), both row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// States at the samples.
    pub states: Vec<f64>,
    /// Derivatives of the states: column j < 6 by initial state j, 6 + j by the offset of input j,
    /// 12 + j by the relative gain of input j.
    pub sensitivities: Vec<f64>,
}

struct Slope {
    rate: Vector,
    by_state: Square,
    by_input: Square,
}

fn slope(x: &Vector, input: &Vector, gravity: f64) -> Slope {
    let [phi, theta, _, u, v, w] = *x;
    let [p, q, r, ax, ay, az] = *input;
    let (sf, cf) = phi.sin_cos();
    let (st, ct) = theta.sin_cos();
    let tt = st / ct;
    let turn = q * sf + r * cf;
    let tilt = q * cf - r * sf;
    let rate = [
        p + tt * turn,
        tilt,
        turn / ct,
        r * v - q * w - gravity * st + ax,
        p * w - r * u + gravity * ct * sf + ay,
        q * u - p * v + gravity * ct * cf + az,
    ];
    let by_state = [
        [tt * tilt, turn / (ct * ct), 0.0, 0.0, 0.0, 0.0],
        [-turn, 0.0, 0.0, 0.0, 0.0, 0.0],
        [tilt / ct, turn * st / (ct * ct), 0.0, 0.0, 0.0, 0.0],
        [0.0, -gravity * ct, 0.0, 0.0, r, -q],
        [gravity * ct * cf, -gravity * st * sf, 0.0, -r, 0.0, p],
        [-gravity * ct * sf, -gravity * st * cf, 0.0, q, -p, 0.0],
    ];
    let by_input = [
        [1.0, tt * sf, tt * cf, 0.0, 0.0, 0.0],
        [0.0, cf, -sf, 0.0, 0.0, 0.0],
        [0.0, sf / ct, cf / ct, 0.0, 0.0, 0.0],
        [0.0, -w, v, 1.0, 0.0, 0.0],
        [w, 0.0, -u, 0.0, 1.0, 0.0],
        [-v, u, 0.0, 0.0, 0.0, 1.0],
    ];
    Slope { rate, by_state, by_input }
}

/// Slope of the state and of its sensitivities at one stage of a step.
fn stage(
    x: &Vector,
    s: &Sensitivity,
    input: &Vector,
    gravity: f64,
    rate: &mut Vector,
    change: &mut Sensitivity,
) {
    let here = slope(x, input, gravity);
    *rate = here.rate;
    for (row, out) in change.iter_mut().enumerate() {
        *out = [0.0; COLUMNS];
        for (weight, source) in here.by_state[row].iter().zip(s) {
            // More than half of ∂ẋ/∂x is zero at any attitude.
            if *weight != 0.0 {
                for (value, derivative) in out.iter_mut().zip(source) {
                    *value += weight * derivative;
                }
            }
        }
        for (j, weight) in here.by_input[row].iter().enumerate() {
            // An offset moves the input by one, a relative gain by the input itself.
            out[N + j] += weight;
            out[2 * N + j] += weight * input[j];
        }
    }
}

fn moved(
    x: &Vector,
    s: &Sensitivity,
    k: &Vector,
    ks: &Sensitivity,
    h: f64,
) -> (Vector, Sensitivity) {
    let (mut next, mut next_s) = (*x, *s);
    for i in 0..N {
        next[i] += h * k[i];
        for (value, change) in next_s[i].iter_mut().zip(&ks[i]) {
            *value += h * change;
        }
    }
    (next, next_s)
}

/// Reconstruct attitude and velocity from rates and specific forces.
///
/// `inputs` holds the inputs at the samples and half way between them, (2 n − 1) × 6 row-major;
/// `gravity` is in the unit of the specific forces.
///
/// # Errors
/// A shape that does not fit, a value that is not finite, or a pitch angle that reaches 90 degrees.
pub fn reconstruct(
    inputs: &[f64],
    initial: &[f64],
    sample_time_s: f64,
    gravity: f64,
) -> Result<Reconstruction, CoreError> {
    let shape = |what, found, needed| CoreError::Shape { what, found, needed };
    let start: Vector = initial.try_into().map_err(|_| shape("initial state", initial.len(), N))?;
    let (rows, rest) = inputs.as_chunks::<N>();
    if !rest.is_empty() || rows.len() % 2 == 0 {
        return Err(shape("inputs at samples and half steps", inputs.len(), N));
    }
    for (what, values) in [("inputs", inputs), ("initial state", initial)] {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            return Err(CoreError::NotFinite { what, index });
        }
    }
    let n_samples = rows.len().div_ceil(2);
    let mut x = start;
    let mut s: Sensitivity = [[0.0; COLUMNS]; N];
    for (i, row) in s.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let mut states = Vec::with_capacity(n_samples * N);
    let mut sensitivities = Vec::with_capacity(n_samples * N * COLUMNS);
    let mut keep = |x: &Vector, s: &Sensitivity| {
        states.extend_from_slice(x);
        sensitivities.extend(s.iter().flatten());
    };
    keep(&x, &s);
    for step in rows.windows(3).step_by(2) {
        (x, s) = advance(&x, &s, step, sample_time_s, gravity);
        if x[1].cos() <= 0.0 || !x.iter().all(|value| value.is_finite()) {
            return Err(CoreError::Range {
                what: "reconstructed pitch angle, rad",
                found: x[1],
                needed: "between -pi/2 and pi/2 (Euler angles are singular beyond)",
            });
        }
        keep(&x, &s);
    }
    Ok(Reconstruction { states, sensitivities })
}

/// One classical Runge–Kutta step over the inputs at its start, middle and end.
fn advance(
    x: &Vector,
    s: &Sensitivity,
    inputs: &[Vector],
    h: f64,
    g: f64,
) -> (Vector, Sensitivity) {
    let mut rates = [[0.0; N]; 4];
    let mut changes = [[[0.0; COLUMNS]; N]; 4];
    stage(x, s, &inputs[0], g, &mut rates[0], &mut changes[0]);
    for (i, (fraction, input)) in [(0.5, 1), (0.5, 1), (1.0, 2)].into_iter().enumerate() {
        let (xi, si) = moved(x, s, &rates[i], &changes[i], fraction * h);
        let (mut rate, mut change) = ([0.0; N], [[0.0; COLUMNS]; N]);
        stage(&xi, &si, &inputs[input], g, &mut rate, &mut change);
        (rates[i + 1], changes[i + 1]) = (rate, change);
    }
    let (mut next, mut next_s) = (*x, *s);
    for (i, weight) in [1.0, 2.0, 2.0, 1.0].into_iter().enumerate() {
        (next, next_s) = moved(&next, &next_s, &rates[i], &changes[i], weight * h / 6.0);
    }
    (next, next_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(n: usize, offset: f64, gain: f64, column: usize) -> Vec<f64> {
        (0..2 * n - 1)
            .flat_map(|k| {
                let t = k as f64 * 0.01;
                let mut row = [
                    t.sin(),
                    0.7 * (1.3 * t).cos(),
                    0.2 * (0.4 * t).sin(),
                    0.3,
                    -0.2,
                    -9.7 + 0.1 * t,
                ];
                row[column] = row[column] * (1.0 + gain) + offset;
                row
            })
            .collect()
    }

    #[test]
    fn a_constant_roll_rate_integrates_to_a_ramp() {
        let flow = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0].repeat(199);
        let run = reconstruct(&flow, &[0.0; N], 0.02, 9.80665).unwrap();
        assert!((run.states[99 * N] - 0.1 * 99.0 * 0.02).abs() < 1e-13);
    }

    #[test]
    fn sensitivities_are_the_derivatives_of_the_states() {
        let start = [0.1, 0.2, 0.3, 5.0, 0.5, 1.0];
        let n = 150;
        let run = |u: &[f64], x: &[f64]| reconstruct(u, x, 0.02, 9.80665).unwrap();
        let exact = run(&inputs(n, 0.0, 0.0, 0), &start);
        let h = 1e-6;
        for column in 0..COLUMNS {
            let moved = |sign: f64| {
                let mut x = start;
                let (mut offset, mut gain) = (0.0, 0.0);
                match column / N {
                    0 => x[column] += sign * h,
                    1 => offset = sign * h,
                    _ => gain = sign * h,
                }
                run(&inputs(n, offset, gain, column % N), &x).states
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            for i in 0..N {
                let index = (n - 1) * N + i;
                let numeric = (up[index] - down[index]) / (2.0 * h);
                let found = exact.sensitivities[index * COLUMNS + column];
                assert!((numeric - found).abs() < 1e-6 * (1.0 + found.abs()), "{column} {i}");
            }
        }
    }

    #[test]
    fn refusals_name_what_is_wrong() {
        let steep = reconstruct(&[0.0, 2.0, 0.0, 0.0, 0.0, 0.0].repeat(199), &[0.0; N], 0.02, 9.8);
        assert!(matches!(steep, Err(CoreError::Range { .. })));
        assert!(matches!(
            reconstruct(&[0.0; 7], &[0.0; N], 0.02, 9.8),
            Err(CoreError::Shape { .. })
        ));
        assert!(matches!(
            reconstruct(&[0.0; 18], &[0.0; 5], 0.1, 9.8),
            Err(CoreError::Shape { .. })
        ));
        assert!(matches!(
            reconstruct(&[f64::NAN; 18], &[0.0; N], 0.1, 9.8),
            Err(CoreError::NotFinite { .. })
        ));
    }
}
