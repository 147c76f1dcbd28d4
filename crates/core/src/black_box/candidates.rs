//! Candidate terms of a regression: given columns, and radial functions that are computed when they
//! are read. (Python side: identification/narx/candidates.py)

use rayon::prelude::*;

use crate::black_box::radial_basis::{Radial, require_finite};
use crate::error::CoreError;
use crate::numerics::gram_schmidt::{AT_ONCE, dots};

/// Candidates of one parallel task.
const CHUNK: usize = 16;
/// Samples that several vectors hold in the nearest cache.
const BLOCK: usize = 512;

/// Candidate terms: given columns, then radial functions.
#[derive(Debug, Clone, Copy)]
pub struct Candidates<'a> {
    /// Given columns, one after the other, `n_samples` long.
    pub columns: &'a [f64],
    /// Radial functions and the regressors at which they are read, (n_samples × dimension).
    pub radial: Option<(Radial<'a>, &'a [f64])>,
    /// Whether a selection keeps all of them beside, in sixteen bits, and reads those.
    pub rounded: bool,
    /// Length of a column.
    pub n_samples: usize,
}

impl<'a> Candidates<'a> {
    /// Given columns alone, rounded for a selection.
    pub fn given(columns: &'a [f64], n_samples: usize) -> Self {
        Self { columns, radial: None, rounded: true, n_samples }
    }

    fn n_given(&self) -> usize {
        self.columns.len() / self.n_samples
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.n_given() + self.radial.map_or(0, |(radial, _)| radial.len())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column `index`, in place or computed into `scratch`.
    pub(crate) fn column<'b>(&'b self, index: usize, scratch: &'b mut Vec<f64>) -> &'b [f64] {
        let (given, n) = (self.n_given(), self.n_samples);
        if index < given {
            return &self.columns[index * n..(index + 1) * n];
        }
        scratch.resize(n, 0.0);
        if let Some((functions, regressors)) = self.radial {
            functions.fill(index - given, regressors, scratch);
        }
        scratch
    }

    /// Map every candidate that `open` names, with its column, in the order of the candidates.
    pub(crate) fn map<T: Send + Clone>(
        &self,
        rest: T,
        open: impl Fn(usize) -> bool + Sync,
        work: impl Fn(usize, &[f64]) -> T + Sync,
    ) -> Vec<T> {
        let indices: Vec<usize> = (0..self.len()).collect();
        let chunk = |part: &[usize]| {
            let mut scratch = Vec::new();
            let each =
                |&index: &usize| open(index).then(|| work(index, self.column(index, &mut scratch)));
            part.iter().map(each).collect::<Vec<Option<T>>>()
        };
        let found: Vec<Vec<Option<T>>> = indices.par_chunks(CHUNK).map(chunk).collect();
        found.into_iter().flatten().map(|value| value.unwrap_or_else(|| rest.clone())).collect()
    }

    /// Products of every candidate that `open` names with several vectors; zero for the others.
    ///
    /// Blocks of samples keep the vectors close to the processor while columns pass by.
    pub(crate) fn products(
        &self,
        open: impl Fn(usize) -> bool + Sync,
        vectors: [&[f64]; AT_ONCE],
    ) -> Vec<[f64; AT_ONCE]> {
        let mut found = vec![[0.0; AT_ONCE]; self.len()];
        found.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sums)| {
            let mut scratch = vec![Vec::new(); sums.len()];
            let columns: Vec<(usize, &[f64])> = scratch
                .iter_mut()
                .enumerate()
                .filter(|(place, _)| open(chunk * CHUNK + place))
                .map(|(place, scratch)| (place, self.column(chunk * CHUNK + place, scratch)))
                .collect();
            for start in (0..self.n_samples).step_by(BLOCK) {
                let end = self.n_samples.min(start + BLOCK);
                let parts = vectors.map(|vector| &vector[start..end]);
                for (place, column) in &columns {
                    let part = dots(&column[start..end], parts);
                    sums[*place].iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
                }
            }
        });
        found
    }

    /// Check what belongs together, and that target and regressors are finite (`select` finds columns
    /// that are not while it first reads them).
    ///
    /// # Errors
    /// Lengths that disagree, values that are not finite.
    pub(crate) fn check(&self, y: &[f64]) -> Result<(), CoreError> {
        let n = self.n_samples;
        if n == 0 || y.len() != n || !self.columns.len().is_multiple_of(n) {
            let (found, needed) = (self.columns.len(), y.len());
            return Err(CoreError::Shape { what: "samples of the candidates", found, needed });
        }
        if let Some((radial, regressors)) = self.radial {
            if regressors.len() != n * radial.dimension {
                let (found, needed) = (regressors.len(), n * radial.dimension);
                return Err(CoreError::Shape { what: "values of the regressors", found, needed });
            }
            require_finite("the regressors", regressors)?;
        }
        require_finite("the target", y)
    }
}
