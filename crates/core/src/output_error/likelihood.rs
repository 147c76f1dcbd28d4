//! Maximum-likelihood output error over many records. (Python side: identification/output_error/fit.py)
//!
//! Minimises ½ Σ vᵀR⁻¹v + (N/2) ln det R over parameters θ that all records share and, for each
//! record, initial states, input shifts and output biases. Each record's own numbers are eliminated
//! from its normal equations before the records meet (the arrow of many records), so the search sees
//! θ alone. R and robust weights are taken anew at every point of linearisation: by the concavity of
//! the logarithm a step that lowers the sum of squares for these weights lowers the likelihood too.
//!
//! Reference: Klein & Morelli, *Aircraft System Identification*, §6.1; Jategaonkar, *Flight Vehicle
//! System Identification*, 2nd ed., §4.6 to 4.10; Golub & Pereyra (1973) for the elimination; Huber
//! (1981), *Robust Statistics*, §7.8, for the robust weights.

use rayon::prelude::*;

use crate::error::CoreError;
use crate::fits::dense_problem::Dense;
use crate::fits::joint_objective::Joint;
use crate::fits::least_squares::{Objective, Options, Point, Problem, Progress, Termination};
use crate::fits::levenberg_marquardt::{Found, search};
use crate::fits::settled_starts::{Settled, in_waves};
use crate::output_error::model_on_records::Trajectories;
use crate::output_error::normal_equations::{Elimination, triangle};
use crate::output_error::output_error_weights::{Moments, Noise, Weights};
use crate::output_error::record_data::{RecordData, same};
use crate::output_error::record_pass::{Part, RecordPass, Task};

/// Where a fit ended.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Parameters θ.
    pub theta: Vec<f64>,
    /// ½ Σ vᵀR⁻¹v + (N/2) ln det R, and half the sum of squares of what is fitted beside records.
    pub objective: f64,
    /// R, n_outputs × n_outputs.
    pub noise: Vec<f64>,
    /// Free numbers of each record: initial states, shifts, biases.
    pub own: Vec<Vec<f64>>,
    /// Whether the record tells that number apart from the others.
    pub determined: Vec<Vec<bool>>,
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub termination: Termination,
}

/// The fit as an objective of θ alone.
pub struct OutputError<'a, T: Trajectories> {
    trajectories: &'a T,
    data: &'a [RecordData],
    weights: Weights,
    passes: Vec<RecordPass>,
    /// The records' own numbers are found by one least squares.
    settles: bool,
    /// One pass serves cost, weights and linearisation.
    gathers: bool,
    /// θ of the last linearisation.
    theta: Vec<f64>,
    /// Calls of `cost` since then.
    tried: usize,
    moments: Option<Moments>,
    /// Under the present weights, at `theta`; where one pass serves.
    weighed: Option<Moments>,
}

impl<'a, T: Trajectories> OutputError<'a, T> {
    /// Take a model, the records and what is assumed of the noise.
    ///
    /// # Errors
    /// `Shape` where records and model do not belong together.
    pub fn new(
        trajectories: &'a T,
        data: &'a [RecordData],
        noise: &Noise,
    ) -> Result<Self, CoreError> {
        let lengths = trajectories.record_lengths();
        let (p, shifts) = (trajectories.n_outputs(), trajectories.n_shifts());
        same("records", data.len(), lengths.len())?;
        for (record, (each, &n)) in data.iter().zip(lengths).enumerate() {
            each.require(n, p, trajectories.n_initial(record), shifts)?;
        }
        let weights = Weights::new(noise, data, p)?;
        let passes = data.iter().map(RecordPass::new).collect();
        let theta = Vec::new();
        let is_free = data.iter().all(|each| each.limits.is_empty());
        let settles = trajectories.is_affine() && is_free;
        // Residuals at numbers of a record that are not at their best yet would count as noise.
        let alone = data.iter().all(|each| each.n_free() == 0);
        let gathers = settles && alone && !noise.full && noise.limit.is_infinite();
        Ok(Self {
            trajectories,
            data,
            weights,
            passes,
            settles,
            gathers,
            theta,
            tried: 0,
            moments: None,
            weighed: None,
        })
    }

    /// Run a task on every record, in parallel, the answers in the order of the records.
    fn all<R: Send>(
        &mut self,
        work: impl Fn(&T, &RecordData, usize, &mut RecordPass) -> Result<R, CoreError> + Sync,
    ) -> Result<Vec<R>, CoreError> {
        let (trajectories, data) = (self.trajectories, self.data);
        let one = |(k, pass): (usize, &mut RecordPass)| work(trajectories, &data[k], k, pass);
        if self.passes.len() == 1 {
            return self.passes.iter_mut().enumerate().map(one).collect();
        }
        self.passes.par_iter_mut().enumerate().map(one).collect()
    }

    fn take_moments(&mut self, theta: &[f64]) -> Result<Moments, CoreError> {
        let shared = self.trajectories.share(theta, false)?;
        let weights = self.weights.clone();
        let found = self.all(|trajectories, data, k, pass| {
            let task = Task { trajectories, shared: &shared, data, record: k, weights: &weights };
            pass.moments(&task)
        })?;
        Ok(Moments::total(found))
    }

    fn follow(&mut self, change: &[f64], share: f64) {
        let each = self.passes.iter_mut().zip(self.data);
        each.for_each(|(pass, data)| pass.follow(data, change, share));
    }

    /// Run at the trial numbers, keeping what `weigh` needs.
    fn gather(&mut self, theta: &[f64]) -> Result<Moments, CoreError> {
        let shared = self.trajectories.share(theta, true)?;
        let weights = self.weights.clone();
        let found = self.all(|trajectories, data, k, pass| {
            pass.gather(&Task { trajectories, shared: &shared, data, record: k, weights: &weights })
        })?;
        Ok(Moments::total(found))
    }

    /// Normal equations of each record, from `gather`.
    fn weigh(&self) -> Vec<Elimination> {
        let n = self.trajectories.n_parameters();
        let each = self.passes.iter().zip(self.data);
        each.map(|(pass, data)| pass.weigh(data, &self.weights, n)).collect()
    }

    /// What each record adds to the normal equations.
    fn parts(&mut self, x: &[f64]) -> Result<Vec<Part>, CoreError> {
        let weights = self.weights.clone();
        if self.gathers {
            let moments = self.passes.iter().map(|pass| pass.gathered(&weights)).collect();
            self.weighed = Some(Moments::total(moments));
            let found = self.weigh().into_iter().zip(&mut self.passes);
            return Ok(found.map(|(each, pass)| pass.keep_gathered(each, &weights)).collect());
        }
        let shared = self.trajectories.share(x, true)?;
        self.all(|trajectories, data, k, pass| {
            let task = Task { trajectories, shared: &shared, data, record: k, weights: &weights };
            pass.linearise(&task)
        })
    }

    /// Free numbers of the records, before the elimination of the last linearisation.
    pub fn own(&self) -> Vec<Vec<f64>> {
        self.passes.iter().map(|pass| pass.own.clone()).collect()
    }

    fn estimate(
        mut self,
        theta: Vec<f64>,
        iterations: usize,
        termination: Termination,
    ) -> Result<Estimate, CoreError> {
        // What the last linearisation left for the records' own numbers.
        if self.settles {
            self.follow(&vec![0.0; theta.len()], 1.0);
            self.passes.iter_mut().for_each(RecordPass::accept);
        }
        let moments = match self.weighed.take() {
            // The last linearisation was here: it took R from these residuals, and weighed them.
            Some(moments) if theta == self.theta => moments,
            _ => {
                let moments = self.take_moments(&theta)?;
                self.weights.update(&moments)?;
                self.take_moments(&theta)?
            }
        };
        Ok(Estimate {
            theta,
            objective: self.weights.objective(&moments),
            noise: self.weights.covariance(),
            own: self.own(),
            determined: self.passes.iter().map(|pass| pass.elimination.kept.clone()).collect(),
            iterations,
            termination,
        })
    }
}

impl<T: Trajectories> Objective for OutputError<'_, T> {
    fn n_parameters(&self) -> usize {
        self.trajectories.n_parameters()
    }

    fn begin(&mut self, x: &[f64]) -> Result<(), CoreError> {
        if self.gathers {
            let moments = self.gather(x)?;
            require_finite(&moments)?;
            self.moments = Some(moments);
            return Ok(());
        }
        for _ in 0..2 {
            // From the start values of the records' own numbers to their best at this θ.
            let moments = self.take_moments(x)?;
            require_finite(&moments)?;
            self.weights.update(&moments)?;
            if !self.settles {
                break;
            }
            self.cost(x)?;
            self.passes.iter_mut().for_each(RecordPass::accept);
        }
        Ok(())
    }

    fn cost(&mut self, x: &[f64]) -> Result<f64, CoreError> {
        let change: Vec<f64> = match self.theta.len() {
            0 => vec![0.0; x.len()],
            _ => x.iter().zip(&self.theta).map(|(new, old)| new - old).collect(),
        };
        // Where damping of θ alone cannot tame the records' own numbers, their step shrinks as well.
        let share = 0.5_f64.powi(self.tried as i32);
        let settles = self.settles;
        let share = if settles { 1.0 } else { share };
        self.tried += 1;
        self.follow(&change, share);
        if self.gathers {
            let moments = self.gather(x)?;
            let cost = moments.cost;
            self.moments = Some(moments);
            return Ok(cost);
        }
        let shared = self.trajectories.share(x, false)?;
        let weights = self.weights.clone();
        let found = self.all(|trajectories, data, k, pass| {
            let task = Task { trajectories, shared: &shared, data, record: k, weights: &weights };
            if settles && data.n_free() > 0 {
                pass.settle(&task).map(|cost| (cost, None))
            } else {
                pass.trial_moments(&task).map(|moments| (moments.cost, Some(moments)))
            }
        })?;
        let cost = found.iter().map(|(cost, _)| cost).sum();
        let moments: Option<Vec<Moments>> = found.into_iter().map(|(_, each)| each).collect();
        self.moments = moments.map(Moments::total);
        Ok(cost)
    }

    fn linearise(&mut self, x: &[f64], point: &mut Point) -> Result<(), CoreError> {
        self.passes.iter_mut().for_each(RecordPass::accept);
        self.tried = 0;
        self.theta = x.to_vec();
        let moments = match self.moments.take() {
            Some(moments) => moments,
            None => self.take_moments(x)?,
        };
        self.weights.update(&moments)?;
        let found = self.parts(x)?;
        let n = x.len();
        let mut gram = vec![0.0; (n + 1) * (n + 1)];
        (point.beside, point.cost) = (0.0, 0.0);
        for each in &found {
            point.beside += each.beside;
            point.cost += each.cost;
            gram.iter_mut().zip(&each.rest).for_each(|(sum, part)| *sum += part);
        }
        if !gram.iter().all(|value| value.is_finite()) {
            return Err(CoreError::NotFinite { what: "the derivatives of the outputs", index: 0 });
        }
        triangle(&gram, n, &mut point.triangle, &mut point.projected);
        Ok(())
    }
}

/// Fit from several starts, in waves (`settled_starts`), until `stop` says true; the answers keep
/// the order of the starts. Residuals of variance one of other data on the same parameters, where
/// there are any `beside`, add their sum of squares.
#[allow(clippy::too_many_arguments)]
pub fn fit_from<T: Trajectories, P: Problem + Clone + Sync>(
    trajectories: &T,
    data: &[RecordData],
    noise: &Noise,
    beside: Option<&P>,
    starts: &[Vec<f64>],
    bounds: (&[f64], &[f64]),
    options: &Options,
    stop: &(dyn Fn() -> bool + Sync),
) -> Vec<Result<Estimate, CoreError>> {
    let one = |start: &Vec<f64>, known: &[Result<Ending, CoreError>]| {
        let mut at = None;
        let proceed = &mut |now: &Progress<'_>| {
            let near = |end: &&Ending| end.1.as_ref().is_some_and(|about| about.holds(now.x));
            at = known.iter().flatten().find(near).map(|end| (now.iteration, &end.0));
            at.is_none() && !stop()
        };
        let mut fit = OutputError::new(trajectories, data, noise)?;
        let Some(beside) = beside else {
            let found = search(&mut fit, start, bounds.0, bounds.1, options, proceed)?;
            return reached(at).map_or_else(|| ending(fit, found), Ok);
        };
        let mut beside = beside.clone();
        let mut other = Dense::new(&mut beside);
        let mut joint = Joint::new(&mut other, &mut fit)?;
        let found = search(&mut joint, start, bounds.0, bounds.1, options, proceed)?;
        if let Some(there) = reached(at) {
            return Ok(there);
        }
        let share = 0.5 * other.cost(&found.x)?;
        let mut made = ending(fit, found)?;
        made.0.objective += share;
        Ok(made)
    };
    in_waves(starts, one).into_iter().map(|end| end.map(|(estimate, _)| estimate)).collect()
}

/// Where a fit ended, with the ellipsoid about it in which other starts count as there.
type Ending = (Estimate, Option<Settled>);

/// The end of another start that a search came near, in its own steps.
fn reached(at: Option<(usize, &Estimate)>) -> Option<Ending> {
    at.map(|(iterations, end)| (Estimate { iterations, ..end.clone() }, None))
}

/// What a search found; its residuals are whitened, so that their variance is one.
fn ending<T: Trajectories>(fit: OutputError<'_, T>, found: Found) -> Result<Ending, CoreError> {
    let about = Settled::of(&found.x, &found.triangle, 1.0, found.termination);
    Ok((fit.estimate(found.x, found.iterations, found.termination)?, about))
}

fn require_finite(moments: &Moments) -> Result<(), CoreError> {
    let what = "the model's outputs at the start";
    if moments.is_finite() { Ok(()) } else { Err(CoreError::NotFinite { what, index: 0 }) }
}
