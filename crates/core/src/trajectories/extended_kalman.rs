//! Extended Kalman filter of a model's equations on one record. (Python side:
//! identification/filter_error/extended_kalman.py)
//!
//! The state is corrected at every sample and advanced by the Runge–Kutta steps of its equations;
//! its covariance follows their exact derivatives, taken at the predicted state. Constants of outputs
//! and inputs are states that stand still. White noise of density W on ẋ adds, over a step h,
//! ∫ Φ W Φᵀ dt ≈ h/6 (2 W + 2 Φ W Φᵀ + Φ W + W Φᵀ), wrong in third order of h.
//!
//! Reference: Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., §5.5 and §7.2.

use crate::error::CoreError;
use crate::state_space::ode_model::OdeModel;
use crate::trajectories::runge_kutta::{Course, Setting, expect};
use crate::trajectories::sensitivity::TrajectorySensitivity;
use crate::trajectories::sensitivity_pattern::Directions;
use crate::trajectories::trajectory::Trajectory;

/// What the filter begins with; states are followed by constants of inputs, then of outputs.
#[derive(Debug, Clone, Copy)]
pub struct Belief<'a> {
    /// Mean.
    pub state: &'a [f64],
    /// Covariance, row-major.
    pub covariance: &'a [f64],
    /// Inputs with a constant.
    pub shifted: &'a [usize],
    /// Outputs with a constant.
    pub biased: &'a [usize],
    /// Densities of the process noise, by state.
    pub process: &'a [f64],
    /// Variances of the outputs' noise.
    pub measurement: &'a [f64],
}

/// What it found, sample by sample.
#[derive(Debug, Clone, Default)]
pub struct Filtered {
    /// Measured outputs less those predicted one sample ahead.
    pub innovations: Vec<f64>,
    /// Lower Cholesky factors of their covariances.
    pub triangles: Vec<f64>,
    /// Predicted states and constants.
    pub states: Vec<f64>,
}

/// Filter a record: `measured` is n_samples × n_outputs.
///
/// # Errors
/// `Shape` for what does not fit, `Singular` where innovations have no covariance, `Diverged` where the
/// state leaves all bounds.
pub fn filter(
    ode: &OdeModel,
    parameters: &[f64],
    course: &Course<'_>,
    measured: &[f64],
    belief: &Belief<'_>,
) -> Result<Filtered, CoreError> {
    let (n, p, inner) = (ode.n_states, ode.n_outputs, ode.n_states + belief.shifted.len());
    let size = inner + belief.biased.len();
    expect("states and constants", belief.state.len(), size)?;
    expect("covariance of the state", belief.covariance.len(), size * size)?;
    expect("densities of process noise", belief.process.len(), n)?;
    expect("variances of outputs", belief.measurement.len(), p)?;
    expect("measured outputs", measured.len(), course.n_samples * p)?;
    let mut setting = Setting::default();
    setting.prepare(ode, parameters, course)?;
    let mut sensitivity = TrajectorySensitivity::default();
    let directions = Directions { parameters: &[], n_initial: n, shift: belief.shifted };
    let mut seeds = vec![0.0; n * inner];
    (0..n).for_each(|i| seeds[i * inner + i] = 1.0);
    let (mut state, mut covariance) = (belief.state.to_vec(), belief.covariance.to_vec());
    let mut shift = vec![0.0; ode.n_inputs];
    let mut found = Filtered::default();
    for (sample, seen) in measured.chunks_exact(p).enumerate() {
        for (k, &input) in belief.shifted.iter().enumerate() {
            shift[input] = state[n + k];
        }
        let steps = setting_off(ode, &mut setting, sample, &shift, &state[..n])?;
        let range = sample..sample + 1;
        let path = Trajectory { ode, setting: &setting, range, states: &steps, shift: &shift };
        let mut observed = vec![0.0; p * size];
        let mut innovation = seen.to_vec();
        let mut sink = |_: usize, rows: &mut [f64]| {
            for (output, row) in rows.chunks_exact(1 + inner).enumerate() {
                innovation[output] -= row[0];
                observed[output * size..][..inner].copy_from_slice(&row[1..]);
            }
        };
        sensitivity.run(&path, parameters, &directions, &seeds, 1 + inner, &mut sink)?;
        for (k, &output) in belief.biased.iter().enumerate() {
            observed[output * size + inner + k] = 1.0;
            innovation[output] -= state[inner + k];
        }
        found.states.extend(&state);
        found.innovations.extend(&innovation);
        let triangle =
            correct(&mut state, &mut covariance, &observed, &innovation, belief.measurement)?;
        found.triangles.extend(triangle);
        if sample + 1 == course.n_samples {
            break;
        }
        for (k, &input) in belief.shifted.iter().enumerate() {
            shift[input] = state[n + k];
        }
        for step in sample * course.substeps..(sample + 1) * course.substeps {
            setting.advance(ode, step, &shift, &mut state[..n])?;
        }
        if !state.iter().all(|value| value.abs() < crate::trajectories::runge_kutta::LARGEST_STATE)
        {
            return Err(CoreError::Diverged { sample });
        }
        let mut transition = vec![0.0; size * size];
        (n..size).for_each(|i| transition[i * size + i] = 1.0);
        for i in 0..n {
            (0..inner).for_each(|j| transition[i * size + j] = sensitivity.end(ode, i, j));
        }
        spread(&mut covariance, &transition, belief.process, course.sample_s, size);
    }
    Ok(found)
}

/// States at the beginning of each part of one sample interval.
fn setting_off(
    ode: &OdeModel,
    setting: &mut Setting,
    sample: usize,
    shift: &[f64],
    state: &[f64],
) -> Result<Vec<f64>, CoreError> {
    let (mut steps, mut state) = (state.to_vec(), state.to_vec());
    if sample + 1 < setting.n_samples {
        for part in 1..setting.substeps {
            setting.advance(ode, sample * setting.substeps + part - 1, shift, &mut state)?;
            steps.extend(&state);
        }
    }
    Ok(steps)
}

/// Take a measurement into state and covariance; gives the triangle of the innovations' covariance.
fn correct(
    state: &mut [f64],
    covariance: &mut [f64],
    observed: &[f64],
    innovation: &[f64],
    noise: &[f64],
) -> Result<Vec<f64>, CoreError> {
    let (size, p) = (state.len(), innovation.len());
    // P Cᵀ, then its whitened form P Cᵀ L⁻ᵀ, whose square is what the covariance loses.
    let mut gain = product(covariance, observed, size, p, size);
    let mut triangle = product(observed, &transposed(&gain, size, p), p, p, size);
    (0..p).for_each(|k| triangle[k * p + k] += noise[k]);
    cholesky(&mut triangle, p)?;
    let mut white = innovation.to_vec();
    for i in 0..p {
        let sum: f64 = (0..i).map(|j| triangle[i * p + j] * white[j]).sum();
        white[i] = (white[i] - sum) / triangle[i * p + i];
    }
    for row in gain.chunks_exact_mut(p) {
        for i in 0..p {
            let sum: f64 = (0..i).map(|j| triangle[i * p + j] * row[j]).sum();
            row[i] = (row[i] - sum) / triangle[i * p + i];
        }
    }
    for i in 0..size {
        state[i] += (0..p).map(|k| gain[i * p + k] * white[k]).sum::<f64>();
        for j in 0..size {
            covariance[i * size + j] -=
                (0..p).map(|k| gain[i * p + k] * gain[j * p + k]).sum::<f64>();
        }
    }
    Ok(triangle)
}

/// P ← Φ P Φᵀ + Q.
fn spread(covariance: &mut [f64], transition: &[f64], process: &[f64], step: f64, size: usize) {
    let half = product(covariance, transition, size, size, size);
    covariance.copy_from_slice(&product(
        transition,
        &transposed(&half, size, size),
        size,
        size,
        size,
    ));
    let phi = |i: usize, j: usize| transition[i * size + j];
    for i in 0..process.len() {
        for j in 0..process.len() {
            let through: f64 =
                process.iter().enumerate().map(|(k, w)| phi(i, k) * w * phi(j, k)).sum();
            let once = phi(i, j) * process[j] + process[i] * phi(j, i);
            let own = if i == j { process[i] } else { 0.0 };
            covariance[i * size + j] += step / 6.0 * (2.0 * (own + through) + once);
        }
    }
    for i in 0..size {
        for j in 0..i {
            let mean = 0.5 * (covariance[i * size + j] + covariance[j * size + i]);
            covariance[i * size + j] = mean;
            covariance[j * size + i] = mean;
        }
    }
}

/// A Bᵀ of A (rows × inner) and B (columns × inner).
fn product(a: &[f64], b: &[f64], rows: usize, columns: usize, inner: usize) -> Vec<f64> {
    let dot = |i: usize, j: usize| -> f64 {
        a[i * inner..][..inner].iter().zip(&b[j * inner..][..inner]).map(|(x, y)| x * y).sum()
    };
    (0..rows * columns).map(|place| dot(place / columns, place % columns)).collect()
}

fn transposed(matrix: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    (0..rows * columns).map(|place| matrix[place % rows * columns + place / rows]).collect()
}

/// Lower triangle in place of a matrix that is positive definite.
fn cholesky(matrix: &mut [f64], n: usize) -> Result<(), CoreError> {
    for j in 0..n {
        let own = matrix[j * n + j] - (0..j).map(|k| matrix[j * n + k].powi(2)).sum::<f64>();
        // Not "at most zero": NaN is not above either.
        if !(own > 0.0 && own.is_finite()) {
            return Err(CoreError::Singular { what: "the covariance of the innovations" });
        }
        let root = own.sqrt();
        matrix[j * n + j] = root;
        for i in j + 1..n {
            let sum: f64 = (0..j).map(|k| matrix[i * n + k] * matrix[j * n + k]).sum();
            matrix[i * n + j] = (matrix[i * n + j] - sum) / root;
        }
        (j + 1..n).for_each(|i| matrix[j * n + i] = 0.0);
    }
    Ok(())
}
