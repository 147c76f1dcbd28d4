//! Sums over the derivatives of one record's run, which need not stand for all samples: products for
//! least squares, and what a step leaves. (Python side: identification/hold_steps.py)

use crate::error::CoreError;
use crate::numerics::widest::widest;
use crate::output_error::model_on_records::{Directed, LANES, Trajectories, Wanted};
use crate::output_error::output_sums::OutputSums;
use crate::output_error::record_data::{RecordData, same};

/// A record's run at one θ, all its free numbers moving.
pub struct Sloped<'a, T: Trajectories> {
    trajectories: &'a T,
    record: usize,
    data: &'a RecordData,
    shared: T::Shared,
}

impl<'a, T: Trajectories> Sloped<'a, T> {
    /// A record at one θ.
    ///
    /// # Errors
    /// Where record and model do not fit, or the model has no value at θ.
    pub fn new(
        trajectories: &'a T,
        record: usize,
        data: &'a RecordData,
        theta: &[f64],
    ) -> Result<Self, CoreError> {
        let n = trajectories.record_lengths()[record];
        let (initial, shifts) = (trajectories.n_initial(record), trajectories.n_shifts());
        data.require(n, trajectories.n_outputs(), initial, shifts)?;
        let shared = trajectories.share(theta, true)?;
        Ok(Self { trajectories, record, data, shared })
    }

    /// Columns of derivatives: θ, then the record's own numbers.
    pub fn n_columns(&self) -> usize {
        self.trajectories.n_parameters() + self.data.n_free()
    }

    fn run(
        &self,
        shared: &T::Shared,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let RecordData { initial, shift, .. } = self.data;
        let wanted = self.wanted();
        let scratch = &mut Vec::new();
        self.trajectories.run(shared, self.record, initial, shift, &wanted, scratch, sink)
    }

    fn wanted(&self) -> Wanted<'a> {
        let RecordData { free_initial, free_shift, .. } = self.data;
        Wanted { theta: true, initial: free_initial, shift: free_shift }
    }

    /// Residuals (n_outputs × n_samples), those of the run itself where none are `given`, and by
    /// output the products of all columns, with the residuals as the last.
    ///
    /// # Errors
    /// As the model's run; `Shape` for residuals of another length.
    pub fn products(&self, given: Option<&[f64]>) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
        let (p, data) = (self.trajectories.n_outputs(), self.data);
        let n = self.trajectories.record_lengths()[self.record];
        let stride = self.wanted().stride(self.trajectories.n_parameters());
        let mut left = vec![0.0; p * n];
        if let Some(given) = given {
            same("residuals", given.len(), p * n)?;
            left.copy_from_slice(given);
        }
        let mut sums = OutputSums::default();
        sums.clear(p, stride);
        self.run(&self.shared, &mut |first, rows| {
            let measured = data.measured[first * p..].chunks_exact(p);
            for (k, (sample, measured)) in
                rows.chunks_exact_mut(p * stride).zip(measured).enumerate()
            {
                for (o, row) in sample.chunks_exact_mut(stride).enumerate() {
                    let rest = &mut left[o * n + first + k];
                    if given.is_none() {
                        *rest = measured[o] - (row[0] + data.bias[o]);
                    }
                    row[0] = *rest;
                }
            }
            sums.add(rows, !data.free_bias.is_empty());
        })?;
        Ok((left, self.ordered(&sums, stride, n)))
    }

    /// Products by output in the order of the columns: θ, initial states, shifts, biases, residual.
    fn ordered(&self, sums: &OutputSums, stride: usize, n: usize) -> Vec<f64> {
        let biases = &self.data.free_bias;
        let (width, run) = (self.n_columns() + 1, self.n_columns() - biases.len());
        // Place in a row of the run; None for a bias.
        let place = |k: usize| match k {
            k if k < run => Some(1 + k),
            k if k + 1 < width => None,
            _ => Some(0),
        };
        let mut found = Vec::with_capacity(self.trajectories.n_outputs() * width * width);
        for (o, (gram, totals)) in sums.by_output().enumerate() {
            let felt = |k: usize| if biases[k - run] == o { 1.0 } else { 0.0 };
            for (i, j) in (0..width).flat_map(|i| (0..width).map(move |j| (i, j))) {
                found.push(match (place(i), place(j)) {
                    (Some(a), Some(b)) => gram[a.min(b) * stride + a.max(b)],
                    (Some(a), None) => totals[a] * felt(j),
                    (None, Some(b)) => totals[b] * felt(i),
                    (None, None) => n as f64 * felt(i) * felt(j),
                });
            }
        }
        found
    }
}

impl<T: Directed> Sloped<'_, T> {
    /// What a step of all columns leaves of residuals (n_outputs × n_samples), to first order: θ moves
    /// along the step alone.
    ///
    /// # Errors
    /// As the model's run; `Shape` for a step or residuals of another length.
    pub fn stepped(&self, given: &[f64], step: &[f64]) -> Result<Vec<f64>, CoreError> {
        let (p, n_theta) = (self.trajectories.n_outputs(), self.trajectories.n_parameters());
        let n = self.trajectories.record_lengths()[self.record];
        same("residuals", given.len(), p * n)?;
        same("step", step.len(), self.n_columns())?;
        let (by_theta, by_own) = step.split_at(n_theta);
        let mut weights = vec![0.0; self.wanted().stride(1)];
        let n_run = by_own.len() - self.data.free_bias.len();
        weights[1] = 1.0;
        weights[2..2 + n_run].copy_from_slice(&by_own[..n_run]);
        let mut biases = vec![0.0; p];
        let moved = self.data.free_bias.iter().zip(&by_own[n_run..]);
        moved.for_each(|(&output, change)| biases[output] += change);
        let mut left = given.to_vec();
        let along = self.trajectories.along(&self.shared, by_theta);
        self.run(&along, &mut |first, rows| {
            widest(
                #[inline(always)]
                || take(&mut left, rows, &weights, &biases, first, n),
            );
        })?;
        Ok(left)
    }
}

/// Take the changes of a block of samples from what was left.
#[inline(always)]
fn take(left: &mut [f64], rows: &[f64], weights: &[f64], biases: &[f64], first: usize, n: usize) {
    let (p, stride) = (biases.len(), weights.len());
    for (o, bias) in biases.iter().enumerate() {
        let samples = rows.chunks_exact(p * stride).zip(&mut left[o * n + first..]);
        for (sample, left) in samples {
            *left -= inner(&sample[o * stride..(o + 1) * stride], weights) + bias;
        }
    }
}

#[inline(always)]
fn inner(row: &[f64], weights: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    for (values, weights) in row.as_chunks::<LANES>().0.iter().zip(weights.as_chunks::<LANES>().0) {
        sums.iter_mut().zip(values.iter().zip(weights)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

#[cfg(test)]
#[path = "tests/slope_sums.rs"]
mod tests;
