//! Forward selection of regression terms by error-reduction ratio, one pass over the candidates a
//! term. (Python side: identification/orthogonal_least_squares.py)
//!
//! For every candidate p_j the squared length a_j and the product b_j = w_jᵀy of its part w_j that is
//! orthogonal to the chosen terms are kept; a new direction q changes them by r_j = qᵀp_j alone, so
//! the candidates are read once for each term and never written.
//!
//! Reference: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), eqs. 12 to 20; leave-one-out
//! errors: Chen, Hong, Harris & Sharkey, IEEE Trans. SMC-B 34 (2004), eqs. 15 to 20.

use rayon::prelude::*;

use crate::error::CoreError;
use crate::radial_basis::{Radial, require_finite};

/// Below this share of its length a candidate counts as a combination of the chosen terms.
const COLLINEAR: f64 = 1e-10;
/// Below this share of its last exact value a squared length has lost digits to cancellation.
const CANCELLED: f64 = 1e-6;
/// A sum of squared errors below this share of the target's is rounding: nothing is left to explain.
const ROUNDING: f64 = 1e-26;
/// Candidates of one parallel task.
const CHUNK: usize = 16;

/// Candidate terms: given columns, then radial functions that are computed when they are read.
#[derive(Debug, Clone, Copy)]
pub struct Candidates<'a> {
    /// Given columns, one after the other, `n_samples` long.
    pub columns: &'a [f64],
    /// Radial functions and the regressors at which they are read, (n_samples × dimension).
    pub radial: Option<(Radial<'a>, &'a [f64])>,
    /// Length of a column.
    pub n_samples: usize,
}

impl Candidates<'_> {
    fn given(&self) -> usize {
        self.columns.len() / self.n_samples
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.given() + self.radial.map_or(0, |(radial, _)| radial.len())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Column `index`, in place or computed into `scratch`.
    fn column<'b>(&'b self, index: usize, scratch: &'b mut Vec<f64>) -> &'b [f64] {
        let given = self.given();
        match self.radial {
            Some((radial, regressors)) if index >= given => {
                scratch.clear();
                let rows = regressors.chunks_exact(radial.dimension);
                scratch.extend(rows.map(|x| radial.value(index - given, x)));
                scratch
            }
            _ => &self.columns[index * self.n_samples..(index + 1) * self.n_samples],
        }
    }

    fn check(&self, y: &[f64]) -> Result<(), CoreError> {
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
        require_finite("the target", y)?;
        require_finite("the candidates", self.columns)
    }
}

/// What ends the selection. The last four run to the most terms and keep the smallest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The sum of squared errors is at most this.
    SumOfSquares(f64),
    /// The best error-reduction ratio is below this.
    ErrorReduction(f64),
    /// Only the most terms.
    Terms,
    /// Smallest leave-one-out mean square.
    Press,
    /// Smallest n ln(SSE/n) + 2k.
    Akaike,
    /// Akaike's with the small-sample term 2k(k+1)/(n−k−1).
    AkaikeCorrected,
    /// Smallest n ln(SSE/n) + k ln n.
    Bayes,
}

/// The terms in the order of their choice, with what each did.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Candidate indices.
    pub terms: Vec<usize>,
    /// Error-reduction ratio of each, of yᵀy.
    pub error_reduction: Vec<f64>,
    /// Sum of squared errors after each.
    pub sum_of_squares: Vec<f64>,
    /// Leave-one-out mean square after each.
    pub press: Vec<f64>,
    /// How many of the terms the stop keeps.
    pub kept: usize,
    /// Weights of the kept terms.
    pub weights: Vec<f64>,
    /// Upper triangular factor of the kept terms, row-major: PᵀP = RᵀR.
    pub factor: Vec<f64>,
    /// Candidates that were combinations of the chosen terms at the end.
    pub collinear: usize,
}

#[derive(Debug, Clone, Copy)]
struct Remainder {
    length: f64,
    product: f64,
    full: f64,
    exact: f64,
    open: bool,
}

struct State<'a> {
    candidates: &'a Candidates<'a>,
    remainders: Vec<Remainder>,
    directions: Vec<Vec<f64>>,
    /// Column k of R, k + 1 long.
    factor: Vec<Vec<f64>>,
    gains: Vec<f64>,
    residual: Vec<f64>,
    leverage: Vec<f64>,
}

impl<'a> State<'a> {
    fn new(candidates: &'a Candidates<'a>, y: &[f64]) -> Self {
        let start = |scratch: &mut Vec<f64>, index| {
            let column = candidates.column(index, scratch);
            let (length, product) = (dot(column, column), dot(column, y));
            let open = length > 0.0 && length.is_finite();
            Remainder { length, product, full: length, exact: length, open }
        };
        let remainders = (0..candidates.len()).into_par_iter().map_init(Vec::new, start).collect();
        Self {
            candidates,
            remainders,
            directions: Vec::new(),
            factor: Vec::new(),
            gains: Vec::new(),
            residual: y.to_vec(),
            leverage: vec![0.0; y.len()],
        }
    }

    /// The open candidate that lowers the error most; the first of equals.
    fn best(&self) -> Option<usize> {
        let mut best = None;
        let mut most = 0.0;
        for (index, candidate) in self.remainders.iter().enumerate() {
            if candidate.open {
                let value = candidate.product * candidate.product / candidate.length;
                if value > most {
                    (best, most) = (Some(index), value);
                }
            }
        }
        best
    }

    /// Add a candidate; false where it is a combination of the chosen terms.
    fn add(&mut self, index: usize) -> bool {
        let mut scratch = Vec::new();
        let mut q = self.candidates.column(index, &mut scratch).to_vec();
        let mut column = orthogonalise(&mut q, &self.directions);
        let length = dot(&q, &q);
        self.remainders[index].open = false;
        if length <= COLLINEAR * self.remainders[index].full {
            return false;
        }
        let norm = length.sqrt();
        q.iter_mut().for_each(|value| *value /= norm);
        column.push(norm);
        let gain = dot(&q, &self.residual);
        for ((r, h), value) in self.residual.iter_mut().zip(&mut self.leverage).zip(&q) {
            *r -= gain * value;
            *h += value * value;
        }
        self.directions.push(q);
        self.factor.push(column);
        self.gains.push(gain);
        true
    }

    /// Take the newest direction out of every open candidate.
    fn deflate(&mut self) {
        let (candidates, directions) = (self.candidates, &self.directions);
        let (Some(q), Some(&gain)) = (directions.last(), self.gains.last()) else { return };
        let residual = &self.residual;
        let update = |scratch: &mut Vec<f64>, index: usize, candidate: &mut Remainder| {
            if !candidate.open {
                return;
            }
            let column = candidates.column(index, scratch);
            let r = dot(q, column);
            candidate.length -= r * r;
            candidate.product -= r * gain;
            if candidate.length < CANCELLED * candidate.exact {
                let mut w = column.to_vec();
                orthogonalise(&mut w, directions);
                candidate.length = dot(&w, &w);
                candidate.product = dot(&w, residual);
                candidate.exact = candidate.length;
                candidate.open = candidate.length > COLLINEAR * candidate.full;
            }
        };
        self.remainders.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, part)| {
            let mut scratch = Vec::new();
            for (offset, candidate) in part.iter_mut().enumerate() {
                update(&mut scratch, chunk * CHUNK + offset, candidate);
            }
        });
    }

    fn press(&self) -> f64 {
        let errors = self.residual.iter().zip(&self.leverage);
        let sum: f64 = errors.map(|(r, h)| (r / (1.0 - h).max(f64::EPSILON)).powi(2)).sum();
        sum / self.residual.len() as f64
    }

    /// Weights of the first `kept` terms, by back substitution.
    fn weights(&self, kept: usize) -> Vec<f64> {
        let mut weights = self.gains[..kept].to_vec();
        for row in (0..kept).rev() {
            let later: f64 = (row + 1..kept).map(|k| self.factor[k][row] * weights[k]).sum();
            weights[row] = (weights[row] - later) / self.factor[row][row];
        }
        weights
    }
}

/// Choose terms for `y`: the first `forced` candidates in their order, then by error reduction.
///
/// # Errors
/// Lengths that disagree, values that are not finite, a target without power, no candidate, more
/// forced terms than candidates or samples, and forced terms that are combinations of one another.
pub fn select(
    candidates: &Candidates<'_>,
    y: &[f64],
    forced: usize,
    stop: Stop,
    maximum_terms: usize,
) -> Result<Selection, CoreError> {
    candidates.check(y)?;
    let power = dot(y, y);
    if power == 0.0 || !power.is_finite() {
        let needed = "a finite, positive sum of squares";
        return Err(CoreError::Range { what: "the target's power", found: power, needed });
    }
    if forced > candidates.len() || forced >= y.len() || candidates.is_empty() {
        let (found, needed) = (candidates.len().min(y.len() - 1), forced.max(1));
        return Err(CoreError::Shape { what: "candidates and samples", found, needed });
    }
    // One sample must stay free, or the errors say nothing.
    let most = maximum_terms.max(forced).min(y.len() - 1);
    let mut state = State::new(candidates, y);
    let (mut terms, mut press, mut sums) = (Vec::new(), Vec::new(), Vec::new());
    while terms.len() < most {
        let is_forced = terms.len() < forced;
        let next = if is_forced { Some(terms.len()) } else { state.best() };
        let Some(index) = next else { break };
        let promised = state.remainders[index];
        let reduction = promised.product * promised.product / (promised.length * power);
        if !is_forced && matches!(stop, Stop::ErrorReduction(least) if reduction < least) {
            break;
        }
        if !state.add(index) {
            if is_forced {
                return Err(CoreError::Singular { what: "the set of forced terms" });
            }
            continue;
        }
        terms.push(index);
        sums.push(dot(&state.residual, &state.residual));
        press.push(state.press());
        let left = sums[sums.len() - 1];
        let reached = matches!(stop, Stop::SumOfSquares(goal) if left <= goal);
        if terms.len() >= forced && (reached || left <= ROUNDING * power) {
            break;
        }
        state.deflate();
    }
    let kept = kept(stop, forced, y.len(), &sums, &press);
    let factor = (0..kept * kept)
        .map(|entry| *state.factor[entry % kept].get(entry / kept).unwrap_or(&0.0))
        .collect();
    let chosen: usize = terms.len();
    let open = state.remainders.iter().filter(|candidate| candidate.open).count();
    Ok(Selection {
        error_reduction: state.gains.iter().map(|gain| gain * gain / power).collect(),
        weights: state.weights(kept),
        collinear: candidates.len() - chosen - open,
        terms,
        sum_of_squares: sums,
        press,
        kept,
        factor,
    })
}

/// How many of the terms the stop keeps, never fewer than the forced ones.
fn kept(stop: Stop, forced: usize, n: usize, sums: &[f64], press: &[f64]) -> usize {
    let samples = n as f64;
    let value = |k: usize| {
        let (terms, fit) = (k as f64, samples * (sums[k - 1] / samples).ln());
        match stop {
            Stop::Press => press[k - 1],
            Stop::Akaike => fit + 2.0 * terms,
            Stop::AkaikeCorrected if k + 1 >= n => f64::INFINITY,
            Stop::AkaikeCorrected => fit + 2.0 * terms * samples / (samples - terms - 1.0),
            Stop::Bayes => fit + terms * samples.ln(),
            Stop::SumOfSquares(_) | Stop::ErrorReduction(_) | Stop::Terms => -terms,
        }
    };
    let (mut best, mut least) = (forced, f64::INFINITY);
    for k in forced.max(1)..=sums.len() {
        if value(k) < least {
            (best, least) = (k, value(k));
        }
    }
    best
}

/// Take the directions out of `w`, twice (one pass of Gram–Schmidt loses orthogonality); returns
/// the coefficients.
fn orthogonalise(w: &mut [f64], directions: &[Vec<f64>]) -> Vec<f64> {
    let mut coefficients = vec![0.0; directions.len()];
    for _ in 0..2 {
        let found: Vec<f64> = directions.iter().map(|q| dot(q, w)).collect();
        for ((q, value), total) in directions.iter().zip(&found).zip(&mut coefficients) {
            w.iter_mut().zip(q).for_each(|(entry, direction)| *entry -= value * direction);
            *total += value;
        }
    }
    coefficients
}

/// Inner product in eight partial sums, so that the compiler can use vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for lane in 0..8 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + tail
}

#[cfg(test)]
#[path = "tests/orthogonal_least_squares.rs"]
mod tests;
