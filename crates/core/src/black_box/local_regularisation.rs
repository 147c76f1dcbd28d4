//! Penalties of the chosen terms from the evidence for them, and the choice made again with those.
//! (Python side: identification/narx/fit.py)
//!
//! Chen's update λ_i ← γ_i/(n − Σγ) · SSE/g_i², with γ_i = a_i/(a_i + λ_i) and g_i = b_i/(a_i + λ_i), has
//! one fixed point for given terms in a given order. With u_i = b_i²/a_i and the residual variance of
//! ordinary least squares s = (yᵀy − Σu)/(n − k) it is λ_i = a_i s/(u_i − s): it exists where u_i > s,
//! else λ_i grows without end and the term goes. So no iteration is needed to find the penalties, only
//! to find an order of choice that they do not change.
//!
//! Reference: Chen, Neurocomputing 69 (2006), section 2.2.

use crate::black_box::candidates::Candidates;
use crate::black_box::orthogonal_least_squares::{Selection, select};
use crate::black_box::stop_rule::Stop;
use crate::error::CoreError;

/// After so many rounds the order of the terms is held: two orders may follow each other for ever.
const ROUNDS: usize = 10;

/// Penalties on squared coefficients along the orthogonal directions; forced terms have none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Regularisation {
    /// The same λ for every term that is not forced (zero: ordinary least squares).
    Uniform(f64),
    /// Each kept term its own λ by evidence; the first choice is made with this λ.
    Local(f64),
}

/// As `select`, with penalties.
///
/// # Errors
/// As `select`.
pub fn select_regularised(
    candidates: &Candidates<'_>,
    y: &[f64],
    forced: usize,
    regularisation: Regularisation,
    stop: Stop,
    maximum_terms: usize,
) -> Result<Selection, CoreError> {
    let (Regularisation::Uniform(start) | Regularisation::Local(start)) = regularisation;
    let penalty = |index| if index < forced { 0.0 } else { start };
    let penalties: Vec<f64> = (0..candidates.len()).map(penalty).collect();
    let first = select(candidates, y, forced, &penalties, stop, maximum_terms)?;
    match regularisation {
        Regularisation::Uniform(_) => Ok(first),
        Regularisation::Local(_) => by_evidence(candidates, y, forced, stop, first),
    }
}

fn by_evidence(
    candidates: &Candidates<'_>,
    y: &[f64],
    forced: usize,
    stop: Stop,
    first: Selection,
) -> Result<Selection, CoreError> {
    let collinear = first.collinear;
    let mut terms = first.terms[..first.kept].to_vec();
    let mut found = first;
    let mut round = 0;
    loop {
        let evidence = penalties(&found, forced, y.len());
        let (kept, penalties): (Vec<usize>, Vec<f64>) = evidence.into_iter().unzip();
        if kept.is_empty() {
            return Ok(Selection { kept: 0, weights: vec![], penalties, factor: vec![], ..found });
        }
        let subset: Vec<usize> = kept.iter().map(|place| terms[*place]).collect();
        let mut scratch = Vec::new();
        let columns: Vec<f64> = subset
            .iter()
            .flat_map(|index| candidates.column(*index, &mut scratch).to_vec())
            .collect();
        let few = Candidates::given(&columns, y.len());
        let held = if round < ROUNDS { forced } else { subset.len() };
        let again = select(&few, y, held, &penalties, stop, subset.len())?;
        let order = &again.terms[..again.kept];
        let settled = order.iter().copied().eq(0..terms.len());
        terms = order.iter().map(|place| subset[*place]).collect();
        found = Selection { terms: terms.clone(), collinear, ..again };
        if settled || terms.is_empty() {
            return Ok(found);
        }
        round += 1;
    }
}

/// Places and penalties of the kept terms whose evidence bears them; forced ones always stay.
fn penalties(found: &Selection, forced: usize, n: usize) -> Vec<(usize, f64)> {
    let k = found.kept;
    let Some(last) = k.checked_sub(1) else { return Vec::new() };
    let variance = found.unpenalised[last] / (n - k) as f64;
    let penalty = |place: usize| {
        if place < forced {
            return Some((place, 0.0));
        }
        let length = found.factor[place * k + place].powi(2);
        let explained = found.explained[place];
        (explained > variance).then(|| (place, length * variance / (explained - variance)))
    };
    (0..k).filter_map(penalty).collect()
}

#[cfg(test)]
#[path = "tests/local_regularisation.rs"]
mod tests;
