//! Extended Kalman filter of a model's equations on one record, and exact derivatives of what it finds.
//! (Python side: identification/filter_error/extended_kalman.py)
//!
//! The state is corrected at every sample and advanced by the Runge–Kutta steps of its equations;
//! its covariance follows their exact derivatives, taken at the predicted state. Constants of outputs
//! and inputs are states that stand still. White noise of density W on ẋ adds, over a step h,
//! ∫ Φ W Φᵀ dt ≈ h/6 (2 W + 2 Φ W Φᵀ + Φ W + W Φᵀ), wrong in third order of h. The same lines on dual
//! numbers give the derivatives by anything that the filter is given.
//!
//! Reference: Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., §5.5 and §7.2.

use rayon::prelude::*;

use crate::error::CoreError;
use crate::numerics::dual::{Dual, Scalar};
use crate::state_space::model_tape::ModelTape;
pub use crate::trajectories::filter_step::Constants;
use crate::trajectories::filter_step::Step;
use crate::trajectories::runge_kutta::{Course, LARGEST_STATE, check, expect};
use crate::trajectories::scalar_equations::EquationTapes;
use crate::trajectories::state_covariance::Correction;

/// Directions that are differentiated side by side.
const LANES: usize = 8;
/// Samples between two looks at whether to stop.
const WATCH: usize = 64;

/// What the filter begins with; states are followed by constants of inputs, then of outputs.
#[derive(Debug, Clone, Copy)]
pub struct Belief<'a> {
    /// Values of the model's parameters.
    pub parameters: &'a [f64],
    /// Mean.
    pub state: &'a [f64],
    /// Covariance, row-major.
    pub covariance: &'a [f64],
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

impl Filtered {
    fn keep<S: Scalar>(&mut self, state: &[S], innovation: &[S], triangle: &[S]) {
        let real = |values: &mut Vec<f64>, new: &[S]| values.extend(new.iter().map(|s| s.real()));
        real(&mut self.states, state);
        real(&mut self.innovations, innovation);
        real(&mut self.triangles, triangle);
    }
}

/// Innovations in units of their own deviations.
#[derive(Debug, Clone)]
pub struct Whitened<S> {
    /// L⁻¹ε, sample by sample.
    pub white: Vec<S>,
    /// Mean logarithms of L's diagonal, by output.
    pub logs: Vec<S>,
}

/// Derivatives of `Whitened`, a row for each of its numbers and a column for each direction.
#[derive(Debug, Clone)]
pub struct Slopes {
    /// Of `white`.
    pub white: Vec<f64>,
    /// Of `logs`.
    pub logs: Vec<f64>,
}

/// Filter a record: `measured` is n_samples × n_outputs.
///
/// # Errors
/// `Shape` for what does not fit, `Singular` where innovations have no covariance, `Diverged` where the
/// state leaves all bounds.
pub fn filter(
    model: &ModelTape,
    course: &Course<'_>,
    measured: &[f64],
    belief: &Belief<'_>,
    constants: &Constants<'_>,
) -> Result<(Filtered, Whitened<f64>), CoreError> {
    let tapes = EquationTapes::new(model)?;
    let work = Work { tapes: &tapes, course, measured, constants, stop: &|| false };
    work.check(belief)?;
    let start = Start::of(belief, |values, _| values.to_vec());
    let mut found = Filtered::default();
    let white = work.run(start, Some(&mut found))?;
    Ok((found, white))
}

/// What `filter` finds, and derivatives of the whitened innovations along `directions`, each of the form
/// of a belief. The same bits for any number of threads; cut short where `stop` says so.
///
/// # Errors
/// As `filter`.
pub fn slopes(
    model: &ModelTape,
    course: &Course<'_>,
    measured: &[f64],
    belief: &Belief<'_>,
    constants: &Constants<'_>,
    directions: &[Belief<'_>],
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<(Filtered, Whitened<f64>, Slopes), CoreError> {
    let tapes = EquationTapes::new(model)?;
    let work = Work { tapes: &tapes, course, measured, constants, stop };
    work.check(belief)?;
    directions.iter().try_for_each(|each| work.check(each))?;
    let one = |place: usize| {
        let group = &directions[place * LANES..directions.len().min((place + 1) * LANES)];
        let start = Start::of(belief, |values, part| {
            let dual = |(place, &value): (usize, &f64)| {
                let slope = |lane: usize| group.get(lane).map_or(0.0, |each| part(each)[place]);
                Dual { value, gradient: std::array::from_fn(slope) }
            };
            values.iter().enumerate().map(dual).collect()
        });
        // Values are the same in all groups: the first one keeps them.
        let mut kept = Filtered::default();
        Ok((work.run(start, (place == 0).then_some(&mut kept))?, kept))
    };
    let groups = directions.len().div_ceil(LANES).max(1);
    let (found, kept): (Vec<Whitened<Dual<f64, LANES>>>, Vec<Filtered>) =
        (0..groups).into_par_iter().map(one).collect::<Result<_, CoreError>>()?;
    let rows = |part: fn(&Whitened<Dual<f64, LANES>>) -> &[Dual<f64, LANES>]| -> Vec<f64> {
        let length = found.iter().map(|each| part(each).len()).min().unwrap_or(0);
        let entry = |place: usize| part(&found[place % directions.len() / LANES]);
        (0..length * directions.len())
            .map(|place| {
                let (row, lane) = (place / directions.len(), place % directions.len() % LANES);
                entry(place)[row].gradient[lane]
            })
            .collect()
    };
    let real = |part: &[Dual<f64, LANES>]| part.iter().map(|each| each.value).collect();
    let values = Whitened { white: real(&found[0].white), logs: real(&found[0].logs) };
    let slopes = Slopes { white: rows(|each| &each.white), logs: rows(|each| &each.logs) };
    Ok((kept.into_iter().next().unwrap_or_default(), values, slopes))
}

/// A belief on any scalar.
struct Start<S> {
    parameters: Vec<S>,
    state: Vec<S>,
    covariance: Vec<S>,
    process: Vec<S>,
    measurement: Vec<S>,
}

type Part = for<'a> fn(&Belief<'a>) -> &'a [f64];

impl<S> Start<S> {
    fn of(belief: &Belief<'_>, made: impl Fn(&[f64], Part) -> Vec<S>) -> Self {
        let part = |part: Part| made(part(belief), part);
        Self {
            parameters: part(|each| each.parameters),
            state: part(|each| each.state),
            covariance: part(|each| each.covariance),
            process: part(|each| each.process),
            measurement: part(|each| each.measurement),
        }
    }
}

struct Work<'a> {
    tapes: &'a EquationTapes,
    course: &'a Course<'a>,
    measured: &'a [f64],
    constants: &'a Constants<'a>,
    stop: &'a (dyn Fn() -> bool + Sync),
}

impl Work<'_> {
    fn check(&self, belief: &Belief<'_>) -> Result<(), CoreError> {
        let (n, p) = (self.tapes.n_states, self.tapes.n_outputs);
        let size = n + self.constants.shifted.len() + self.constants.biased.len();
        check(self.tapes.n_inputs, self.course)?;
        expect("values of parameters", belief.parameters.len(), self.tapes.n_parameters)?;
        expect("states and constants", belief.state.len(), size)?;
        expect("covariance of the state", belief.covariance.len(), size * size)?;
        expect("densities of process noise", belief.process.len(), n)?;
        expect("variances of outputs", belief.measurement.len(), p)?;
        expect("measured outputs", self.measured.len(), self.course.n_samples * p)
    }

    /// `kept` takes predicted state, innovations and triangle of each sample.
    fn run<S: Scalar>(
        &self,
        start: Start<S>,
        mut kept: Option<&mut Filtered>,
    ) -> Result<Whitened<S>, CoreError> {
        let (course, p) = (self.course, self.tapes.n_outputs);
        let mut correction = Correction::new();
        let mut step = Step::new(self.tapes, self.course, self.constants, &start.parameters)?;
        let (mut state, mut covariance) = (start.state, start.covariance);
        let mut logs = vec![S::constant(0.0); p];
        let mut white = Vec::with_capacity(self.measured.len());
        for (sample, seen) in self.measured.chunks_exact(p).enumerate() {
            if sample % WATCH == 0 && (self.stop)() {
                break;
            }
            step.measure(sample, &state, seen)?;
            let last = sample + 1 == course.n_samples;
            if !last {
                step.differentiate(sample, &state)?;
            }
            correction.prepare(
                &covariance,
                &step.observed,
                &step.innovation,
                &start.measurement,
            )?;
            if let Some(kept) = &mut kept {
                kept.keep(&state, &step.innovation, &correction.triangle);
            }
            correction.apply(&mut state, &mut covariance);
            (0..p).for_each(|k| logs[k] = logs[k] + correction.triangle[k * p + k].ln());
            white.extend_from_slice(&correction.white);
            if last {
                break;
            }
            step.advance(sample, &mut state)?;
            if !state.iter().all(|value| value.real().abs() < LARGEST_STATE) {
                return Err(CoreError::Diverged { sample });
            }
            correction.spread(
                &mut covariance,
                &step.transition,
                &start.process,
                course.sample_s,
                state.len(),
            );
        }
        let share = 1.0 / course.n_samples as f64;
        logs.iter_mut().for_each(|log| *log = log.times(share));
        Ok(Whitened { white, logs })
    }
}
