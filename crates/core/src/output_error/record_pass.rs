//! One record's part of an output-error fit: its own numbers, and passes over its samples.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::output_error::bias_sums::BiasSums;
use crate::output_error::model_on_records::{Trajectories, Wanted};
use crate::output_error::normal_equations::{Elimination, add_rows, eliminate};
use crate::output_error::output_error_weights::{Moments, Weights};
use crate::output_error::output_sums::OutputSums;
use crate::output_error::record_data::RecordData;

/// What a pass needs beside its buffers.
pub struct Task<'a, T: Trajectories> {
    /// The model on all records.
    pub trajectories: &'a T,
    /// The model at one θ.
    pub shared: &'a T::Shared,
    /// The record's measurements.
    pub data: &'a RecordData,
    /// Number of the record.
    pub record: usize,
    /// Weights of the residuals.
    pub weights: &'a Weights,
}

/// The record's numbers and reused buffers.
#[derive(Debug, Clone)]
pub struct RecordPass {
    /// Free numbers at the last point of linearisation.
    pub own: Vec<f64>,
    /// The same at the point tried last.
    trial: Vec<f64>,
    /// Of the last linearisation.
    pub elimination: Elimination,
    scratch: Vec<f64>,
    gram: Vec<f64>,
    /// Of the trial numbers, by `gather`.
    sums: OutputSums,
}

/// Share of a cost that has to be left after what the records' own numbers take, for the difference
/// to have digits: beside outputs of an unstable trial point, which grow out of all bounds, it is
/// rounding and may even be zero.
const LEFT: f64 = 1e-6;

/// Whether a cost and what is taken from it are too close for their difference to mean anything.
fn cancels(cost: f64, taken: f64) -> bool {
    taken > 0.0 && cost - taken < LEFT * cost
}

/// What one record adds to the normal equations.
#[derive(Debug, Clone)]
pub struct Part {
    /// Normal equations of θ and residual.
    pub rest: Vec<f64>,
    /// Reduction by the record's own numbers.
    pub beside: f64,
    /// Σ 2ρ.
    pub cost: f64,
}

impl RecordPass {
    /// From the record's start values.
    pub fn new(data: &RecordData) -> Self {
        let own = data.free_values();
        Self {
            trial: own.clone(),
            own,
            elimination: Elimination::default(),
            scratch: Vec::new(),
            gram: Vec::new(),
            sums: OutputSums::default(),
        }
    }

    /// Move the trial numbers along with a change of θ since the last linearisation.
    pub fn follow(&mut self, data: &RecordData, change: &[f64], share: f64) {
        self.trial.clone_from(&self.own);
        if !self.elimination.kept.is_empty() {
            let step = self.elimination.step(change, share);
            self.trial.iter_mut().zip(step).for_each(|(value, each)| *value += each);
            for (value, &(low, high)) in self.trial.iter_mut().zip(&data.limits) {
                *value = value.clamp(low, high);
            }
        }
    }

    /// Keep the trial numbers.
    pub fn accept(&mut self) {
        self.own.clone_from(&self.trial);
    }

    /// Sums over residuals at the accepted numbers.
    ///
    /// # Errors
    /// As the model's run.
    pub fn moments<T: Trajectories>(&mut self, task: &Task<'_, T>) -> Result<Moments, CoreError> {
        let values = self.own.clone();
        self.residual_moments(task, &values)
    }

    /// Sums over residuals at the trial numbers.
    ///
    /// # Errors
    /// As the model's run.
    pub fn trial_moments<T: Trajectories>(
        &mut self,
        task: &Task<'_, T>,
    ) -> Result<Moments, CoreError> {
        let values = self.trial.clone();
        self.residual_moments(task, &values)
    }

    fn residual_moments<T: Trajectories>(
        &mut self,
        task: &Task<'_, T>,
        values: &[f64],
    ) -> Result<Moments, CoreError> {
        let (data, weights) = (task.data, task.weights);
        let p = task.trajectories.n_outputs();
        let wanted = Wanted { theta: false, initial: &[], shift: &[] };
        let stride = wanted.stride(task.trajectories.n_parameters());
        let (initial, shift, bias) = data.moved(values);
        let mut moments = Moments::new(p);
        moments.count = data.measured.len() / p.max(1);
        let mut u = vec![0.0; p];
        let mut sink = |first: usize, rows: &mut [f64]| {
            let measured = &data.measured[first * p..];
            for (sample, z) in rows.chunks_exact(p * stride).zip(measured.chunks_exact(p)) {
                for o in 0..p {
                    u[o] = sample[o * stride] + bias[o] - z[o];
                }
                weights.whiten(&mut u, 1);
                for i in 0..p {
                    moments.cost += weights.twice_loss(u[i]);
                    u[i] *= weights.weight(u[i]);
                    for j in 0..=i {
                        moments.products[i * p + j] += u[i] * u[j];
                    }
                }
            }
        };
        let (trajectories, scratch) = (task.trajectories, &mut self.scratch);
        trajectories.run(
            task.shared,
            task.record,
            &initial,
            &shift,
            &wanted,
            scratch,
            &mut sink,
        )?;
        for i in 0..p {
            for j in 0..i {
                moments.products[j * p + i] = moments.products[i * p + j];
            }
        }
        Ok(moments)
    }

    /// Best trial numbers at this θ, by one least squares; the cost there.
    ///
    /// # Errors
    /// As the model's run.
    pub fn settle<T: Trajectories>(&mut self, task: &Task<'_, T>) -> Result<f64, CoreError> {
        let values = self.trial.clone();
        let (found, cost) = self.normal_equations(task, &values, false)?;
        let step = found.step(&[], 1.0);
        self.trial.iter_mut().zip(step).for_each(|(value, each)| *value += each);
        if cancels(cost, found.beside) {
            return self.trial_moments(task).map(|moments| moments.cost);
        }
        Ok(cost - found.beside)
    }

    /// Normal equations at the accepted numbers, these eliminated.
    ///
    /// # Errors
    /// As the model's run.
    pub fn linearise<T: Trajectories>(&mut self, task: &Task<'_, T>) -> Result<Part, CoreError> {
        let values = self.own.clone();
        let (found, cost) = self.normal_equations(task, &values, true)?;
        let part = Part { rest: found.rest.clone(), beside: found.beside, cost };
        self.elimination = found;
        Ok(part)
    }

    /// Run with derivatives at the trial numbers and keep what outputs sum up to.
    ///
    /// # Errors
    /// As the model's run.
    pub fn gather<T: Trajectories>(&mut self, task: &Task<'_, T>) -> Result<Moments, CoreError> {
        let data = task.data;
        let p = task.trajectories.n_outputs();
        let wanted = Wanted { theta: true, initial: &data.free_initial, shift: &data.free_shift };
        let stride = wanted.stride(task.trajectories.n_parameters());
        let (initial, shift, bias) = data.moved(&self.trial);
        let has_bias = !data.free_bias.is_empty();
        let sums = &mut self.sums;
        sums.clear(p, stride);
        let mut sink = |first: usize, rows: &mut [f64]| {
            let measured = &data.measured[first * p..];
            for (sample, z) in rows.chunks_exact_mut(p * stride).zip(measured.chunks_exact(p)) {
                for (row, (b, z)) in sample.chunks_exact_mut(stride).zip(bias.iter().zip(z)) {
                    row[0] += b - z;
                }
            }
            sums.add(rows, has_bias);
        };
        let (trajectories, scratch) = (task.trajectories, &mut self.scratch);
        let (shared, record) = (task.shared, task.record);
        trajectories.run(shared, record, &initial, &shift, &wanted, scratch, &mut sink)?;
        Ok(self.gathered(task.weights))
    }

    /// Moments of what `gather` kept under some weights.
    pub fn gathered(&self, weights: &Weights) -> Moments {
        self.sums.moments(weights)
    }

    /// Normal equations from what `gather` kept, of a record without numbers of its own.
    pub fn weigh(&self, data: &RecordData, weights: &Weights, n_theta: usize) -> Elimination {
        let (gram, sums) = self.sums.weighed(weights);
        let stride = gram.len().isqrt();
        let mut ordered = sums.ordered(&gram, stride, n_theta, data, weights.inverse());
        eliminate(&mut ordered, data.n_free(), data.n_free() + n_theta + 1)
    }

    /// Keep what `weigh` found.
    pub fn keep_gathered(&mut self, found: Elimination, weights: &Weights) -> Part {
        let cost = self.gathered(weights).cost;
        let part = Part { rest: found.rest.clone(), beside: 0.0, cost };
        self.elimination = found;
        part
    }

    fn normal_equations<T: Trajectories>(
        &mut self,
        task: &Task<'_, T>,
        values: &[f64],
        theta: bool,
    ) -> Result<(Elimination, f64), CoreError> {
        let (data, weights) = (task.data, task.weights);
        let p = task.trajectories.n_outputs();
        let n_theta = if theta { task.trajectories.n_parameters() } else { 0 };
        let wanted = Wanted { theta, initial: &data.free_initial, shift: &data.free_shift };
        let stride = wanted.stride(n_theta);
        let (initial, shift, bias) = data.moved(values);
        let gram = &mut self.gram;
        gram.clear();
        gram.resize(stride * stride, 0.0);
        let has_bias = !data.free_bias.is_empty();
        let mut sums = BiasSums { weight: vec![0.0; p], rows: vec![0.0; p * stride] };
        let mut cost = 0.0;
        let mut sink = |first: usize, rows: &mut [f64]| {
            let measured = &data.measured[first * p..];
            for (sample, z) in rows.chunks_exact_mut(p * stride).zip(measured.chunks_exact(p)) {
                for (o, row) in sample.chunks_exact_mut(stride).enumerate() {
                    row[0] += bias[o] - z[o];
                }
                weights.whiten(sample, stride);
                for (o, row) in sample.chunks_exact_mut(stride).enumerate() {
                    cost += weights.twice_loss(row[0]);
                    let weight = weights.weight(row[0]);
                    if weight < 1.0 {
                        // As a factor of the row, so that products of rows carry the weight once.
                        let root = weight.sqrt();
                        row.iter_mut().for_each(|entry| *entry *= root);
                    }
                    if has_bias {
                        sums.add(o, weight, row);
                    }
                }
            }
            add_rows(gram, rows, stride, 1);
        };
        let (trajectories, scratch) = (task.trajectories, &mut self.scratch);
        trajectories.run(
            task.shared,
            task.record,
            &initial,
            &shift,
            &wanted,
            scratch,
            &mut sink,
        )?;
        let mut ordered = sums.ordered(&self.gram, stride, n_theta, data, weights.inverse());
        let width = data.n_free() + n_theta + 1;
        data.hold(values, &mut ordered, width);
        Ok((eliminate(&mut ordered, data.n_free(), width), cost))
    }
}
