//! Forward selection of regression terms by error-reduction ratio.
//! (Python side: identification/narx/fit.py)
//!
//! For every candidate p_j the squared length a_j and the product b_j = w_jᵀy of its part w_j that is
//! orthogonal to the chosen terms are kept; a new direction q changes them by r_j = qᵀp_j alone, so
//! the candidates are read and never written: in sixteen bits (`rounded_columns.rs`), after which
//! those that may be the best within the bounds of its errors are worked out in double; or where they
//! are computed at each reading, for several terms at a time (`look_ahead.rs`). A penalty λ_j on a term's squared coefficient along w_j shrinks it by a_j/(a_j + λ_j).
//!
//! Reference: Chen, Cowan & Grant, IEEE Trans. Neural Networks 2 (1991), eqs. 12 to 20; leave-one-out
//! errors: Chen, Hong, Harris & Sharkey, IEEE Trans. SMC-B 34 (2004), eqs. 15 to 20; penalties: Chen,
//! Neurocomputing 69 (2006), section 2.

use rayon::prelude::*;

use crate::black_box::candidates::Candidates;
use crate::black_box::look_ahead::{LookAhead, Progress};
use crate::black_box::radial_basis::require_finite;
use crate::black_box::remainder::Remainder;
use crate::black_box::rounded_columns::{RoundedColumns, Whole, round};
use crate::black_box::stop_rule::Path;
use crate::black_box::stop_rule::Stop;
use crate::error::CoreError;
use crate::numerics::gram_schmidt::{dot, orthogonalise, subtract};

/// Below this share of its length a candidate counts as a combination of the chosen terms.
const COLLINEAR: f64 = 1e-10;
/// A sum of squared errors below this share of the target's is rounding: nothing is left to explain.
const ROUNDING: f64 = 1e-26;

/// The terms in the order of their choice, with what each did.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Candidate indices.
    pub terms: Vec<usize>,
    /// Error-reduction ratio of each, of yᵀy; with a penalty Chen's regularised one.
    pub error_reduction: Vec<f64>,
    /// Sum of squared errors after each.
    pub sum_of_squares: Vec<f64>,
    /// The same without penalties, and what each term takes from it.
    pub unpenalised: Vec<f64>,
    /// Squared product of each direction with the target.
    pub explained: Vec<f64>,
    /// Leave-one-out mean square after each.
    pub press: Vec<f64>,
    /// How many of the terms the stop keeps.
    pub kept: usize,
    /// Weights of the kept terms.
    pub weights: Vec<f64>,
    /// Penalty λ of each kept term.
    pub penalties: Vec<f64>,
    /// Upper triangular factor of the kept terms, row-major: PᵀP = RᵀR.
    pub factor: Vec<f64>,
    /// Candidates that were combinations of the chosen terms at the end.
    pub collinear: usize,
}

struct State<'a> {
    candidates: &'a Candidates<'a>,
    /// What is left of the candidates, in sixteen bits; None where they are computed when read.
    rounded: Option<RoundedColumns>,
    remainders: Vec<Remainder>,
    directions: Vec<Vec<f64>>,
    /// Product of each direction with every open candidate, of candidates that are not rounded.
    shares: Vec<Vec<f64>>,
    /// Column k of R, k + 1 long.
    factor: Vec<Vec<f64>>,
    /// Product of each direction with the target, and the share that its penalty leaves of it.
    gains: Vec<f64>,
    shrinkage: Vec<f64>,
    residual: Vec<f64>,
    unpenalised: Vec<f64>,
    leverage: Vec<f64>,
}

impl<'a> State<'a> {
    fn new(
        candidates: &'a Candidates<'a>,
        y: &[f64],
        penalties: &[f64],
    ) -> Result<Self, CoreError> {
        let (rounded, remainders) = if candidates.rounded {
            let (rounded, remainders) = RoundedColumns::of(candidates, y, penalties);
            (Some(rounded), remainders)
        } else {
            let start = |index: usize, column: &[f64]| {
                let penalty = *penalties.get(index).unwrap_or(&0.0);
                Remainder::whole(dot(column, column), dot(column, y), penalty)
            };
            (None, candidates.map(Remainder::whole(0.0, 0.0, 0.0), |_| true, start))
        };
        let odd = |rest: &Remainder| !rest.length.is_finite();
        for (index, _) in remainders.iter().enumerate().filter(|(_, rest)| odd(rest)) {
            require_finite("the candidates", candidates.column(index, &mut Vec::new()))?;
        }
        Ok(Self {
            candidates,
            rounded,
            remainders,
            directions: Vec::new(),
            shares: Vec::new(),
            factor: Vec::new(),
            gains: Vec::new(),
            shrinkage: Vec::new(),
            residual: y.to_vec(),
            unpenalised: y.to_vec(),
            leverage: vec![0.0; y.len()],
        })
    }

    /// The open candidate that lowers the error most; the first of equals.
    ///
    /// Whichever may be it within its doubts is worked out in double precision, until one without
    /// doubt reaches the bounds of all others.
    fn best(&mut self) -> Option<usize> {
        loop {
            let mut best = None;
            let mut most = 0.0;
            for (index, candidate) in self.remainders.iter().enumerate() {
                if candidate.open && candidate.largest_reduction() > most {
                    (best, most) = (Some(index), candidate.largest_reduction());
                }
            }
            let index = best?;
            if self.remainders[index].is_certain() {
                return best;
            }
            let rounded = self.rounded.as_mut().map(|columns| columns.column_mut(index));
            let vector = Vector { candidates: self.candidates, directions: &self.directions };
            vector.restore(index, &mut self.remainders[index], &self.unpenalised, rounded);
        }
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
        let gain = dot(&q, &self.unpenalised);
        let shrinkage = length / (length + self.remainders[index].penalty);
        for ((r, h), value) in self.residual.iter_mut().zip(&mut self.leverage).zip(&q) {
            *r -= shrinkage * gain * value;
            *h += shrinkage * value * value;
        }
        self.unpenalised.iter_mut().zip(&q).for_each(|(r, value)| *r -= gain * value);
        self.directions.push(q);
        self.factor.push(column);
        self.gains.push(gain);
        self.shrinkage.push(shrinkage);
        true
    }

    /// Products of the newest direction, that of candidate `index`, with the open candidates, and the
    /// length of what they miss of it.
    fn share(&self, index: usize, ahead: &mut LookAhead) -> (Vec<f64>, f64) {
        let open = |index: usize| self.remainders[index].open;
        match (&self.rounded, self.directions.last()) {
            (Some(columns), Some(newest)) => columns.products(newest, open),
            _ => (ahead.share(index, &self.progress()), 0.0),
        }
    }

    /// Take the newest direction out of every open candidate, whose products with it are given.
    fn deflate(&mut self, (share, blurred): (Vec<f64>, f64)) {
        let Some(&gain) = self.gains.last() else { return };
        let vector = Vector { candidates: self.candidates, directions: &self.directions };
        let residual = &self.unpenalised;
        let each = self.remainders.par_iter_mut().zip(&share).enumerate();
        // Errors of the shares lie along the directions: b does not see them, a to second order.
        let restore = |(index, (candidate, r)): (usize, (&mut Remainder, &f64)), rounded| {
            candidate.deflate(*r, gain, blurred);
            if candidate.open && candidate.lost() {
                vector.restore(index, candidate, residual, rounded);
            }
        };
        match &mut self.rounded {
            Some(columns) => {
                each.zip(columns.each_mut()).for_each(|(item, place)| restore(item, Some(place)));
            }
            None => {
                each.for_each(|item| restore(item, None));
                self.shares.push(share);
            }
        }
    }

    fn progress(&self) -> Progress<'_> {
        Progress {
            candidates: self.candidates,
            remainders: &self.remainders,
            directions: &self.directions,
            shares: &self.shares,
        }
    }

    fn press(&self) -> f64 {
        let errors = self.residual.iter().zip(&self.leverage);
        let sum: f64 = errors.map(|(r, h)| (r / (1.0 - h).max(f64::EPSILON)).powi(2)).sum();
        sum / self.residual.len() as f64
    }

    /// Weights of the first `kept` terms, by back substitution.
    fn weights(&self, kept: usize) -> Vec<f64> {
        let gains = self.gains.iter().zip(&self.shrinkage);
        let mut weights: Vec<f64> = gains.take(kept).map(|(gain, left)| gain * left).collect();
        for row in (0..kept).rev() {
            let later: f64 = (row + 1..kept).map(|k| self.factor[k][row] * weights[k]).sum();
            weights[row] = (weights[row] - later) / self.factor[row][row];
        }
        weights
    }
}

/// Where what is left of a candidate comes from.
struct Vector<'a> {
    candidates: &'a Candidates<'a>,
    directions: &'a [Vec<f64>],
}

impl Vector<'_> {
    /// Work out what is left of a candidate from its column; `rounded` is what is read of it from now.
    fn restore(
        &self,
        index: usize,
        candidate: &mut Remainder,
        residual: &[f64],
        rounded: Option<(&mut [Whole], &mut f64)>,
    ) {
        let mut w = self.candidates.column(index, &mut Vec::new()).to_vec();
        let shares: Vec<f64> = self.directions.iter().map(|q| dot(q, &w)).collect();
        self.directions.iter().zip(shares).for_each(|(q, share)| subtract(&mut w, share, q));
        candidate.length = dot(&w, &w);
        candidate.product = dot(&w, residual);
        candidate.exact = candidate.length;
        candidate.open = candidate.length > COLLINEAR * candidate.full;
        (candidate.length_doubt, candidate.product_doubt) = (0.0, 0.0);
        if let Some((values, scale)) = rounded.filter(|_| candidate.open) {
            candidate.missed = round(&w, candidate.length, values, scale);
        }
    }
}

/// Choose terms for `y`: the first `forced` candidates in their order, then by error reduction.
///
/// `penalties` holds λ of each candidate; empty for none.
///
/// # Errors
/// Lengths that disagree, values that are not finite, a target without power, no candidate, more
/// forced terms than candidates or samples, negative penalties, and forced terms that are combinations
/// of one another.
pub fn select(
    candidates: &Candidates<'_>,
    y: &[f64],
    forced: usize,
    penalties: &[f64],
    stop: Stop,
    maximum_terms: usize,
) -> Result<Selection, CoreError> {
    let power = checked_power(candidates, y, forced, penalties)?;
    // One sample must stay free, or the errors say nothing.
    let most = maximum_terms.max(forced).min(y.len() - 1);
    let mut state = State::new(candidates, y, penalties)?;
    let mut path = Path::default();
    let mut ahead = LookAhead::new(forced, most);
    loop {
        let is_forced = path.terms.len() < forced;
        let next = if is_forced { Some(path.terms.len()) } else { state.best() };
        let Some(index) = next else { break };
        let reduction = state.remainders[index].reduction() / power;
        if !is_forced && matches!(stop, Stop::ErrorReduction(least) if reduction < least) {
            break;
        }
        if !state.add(index) {
            if is_forced {
                return Err(CoreError::Singular { what: "the set of forced terms" });
            }
            continue;
        }
        path.terms.push(index);
        path.sums.push(dot(&state.residual, &state.residual));
        path.unpenalised.push(dot(&state.unpenalised, &state.unpenalised));
        path.press.push(state.press());
        path.effective.push(state.shrinkage.iter().sum());
        let left = path.sums[path.sums.len() - 1];
        let reached = matches!(stop, Stop::SumOfSquares(goal) if left <= goal);
        let enough = reached || left <= ROUNDING * power;
        if path.terms.len() >= most || (path.terms.len() >= forced && enough) {
            break;
        }
        let share = state.share(index, &mut ahead);
        state.deflate(share);
    }
    let kept = stop.kept(forced, y.len(), &path);
    Ok(selection(&state, path, kept, power))
}

/// Power of the target, after the checks of what `select` is given.
fn checked_power(
    candidates: &Candidates<'_>,
    y: &[f64],
    forced: usize,
    penalties: &[f64],
) -> Result<f64, CoreError> {
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
    if !penalties.is_empty() && penalties.len() != candidates.len() {
        let (found, needed) = (penalties.len(), candidates.len());
        return Err(CoreError::Shape { what: "penalties of the candidates", found, needed });
    }
    match penalties.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
        Some(&found) => {
            Err(CoreError::Range { what: "a penalty", found, needed: "zero or above, finite" })
        }
        None => Ok(power),
    }
}

fn selection(state: &State<'_>, path: Path, kept: usize, power: f64) -> Selection {
    let factor = (0..kept * kept)
        .map(|entry| *state.factor[entry % kept].get(entry / kept).unwrap_or(&0.0))
        .collect();
    let open = state.remainders.iter().filter(|candidate| candidate.open).count();
    let explained: Vec<f64> = state.gains.iter().map(|gain| gain * gain).collect();
    let reductions = explained.iter().zip(&state.shrinkage);
    let penalty = |index: &usize| state.remainders[*index].penalty;
    Selection {
        error_reduction: reductions.map(|(gain, left)| gain * left / power).collect(),
        weights: state.weights(kept),
        collinear: state.remainders.len() - path.terms.len() - open,
        penalties: path.terms[..kept].iter().map(penalty).collect(),
        terms: path.terms,
        sum_of_squares: path.sums,
        unpenalised: path.unpenalised,
        explained,
        press: path.press,
        kept,
        factor,
    }
}

#[cfg(test)]
#[path = "tests/orthogonal_least_squares.rs"]
mod tests;
