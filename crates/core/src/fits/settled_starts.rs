//! Searches from several starts: one that comes near an end which is known ends there.
//!
//! The last steps of a search cost as much as the first and lead, from within half a standard error
//! of a minimum, to that minimum. Starts go in waves, each twice as long as all before it: a search
//! knows the ends of the waves before its own, so that threads change no bit of an answer.

use rayon::prelude::*;

use crate::fits::least_squares::Termination;

/// Standard errors within which a search counts as at a minimum that another start has reached.
const NEAR: f64 = 0.5;
/// Diagonal of a triangle over its column below which rounding tells a combination of variables.
const TOLD: f64 = 1e-8;

/// A minimum of a sum of squares with the ellipsoid about it in which a search counts as there.
#[derive(Debug, Clone)]
pub struct Settled {
    x: Vec<f64>,
    triangle: Vec<f64>,
    limit: f64,
}

impl Settled {
    /// Where a search ended; None at no minimum, or where data do not tell all variables apart.
    ///
    /// `triangle` is that of the Jacobian (n × n, column-major), `variance` that of a residual.
    pub fn of(
        x: &[f64],
        triangle: &[f64],
        variance: f64,
        termination: Termination,
    ) -> Option<Self> {
        let n = x.len();
        let told = triangle.chunks_exact(n.max(1)).enumerate().all(|(j, column)| {
            let largest = column.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            column[j].abs() > TOLD * largest
        });
        let limit = NEAR * NEAR * variance;
        (told && termination.is_converged() && limit > 0.0 && limit.is_finite()).then(|| Self {
            x: x.to_vec(),
            triangle: triangle.to_vec(),
            limit,
        })
    }

    /// Whether a point lies within half a standard error of the minimum, along every direction.
    pub fn holds(&self, x: &[f64]) -> bool {
        let n = self.x.len();
        let mut away = 0.0;
        for row in 0..n {
            let moved: f64 =
                (row..n).map(|j| self.triangle[j * n + row] * (x[j] - self.x[j])).sum();
            away += moved * moved;
        }
        away <= self.limit
    }
}

/// Ends of searches from all starts, in their order; each search is given the ends of the waves
/// before its own. One start runs on the calling thread.
pub fn in_waves<S: Sync, E: Send + Sync>(
    starts: &[S],
    search: impl Fn(&S, &[E]) -> E + Sync,
) -> Vec<E> {
    let mut ends: Vec<E> = Vec::with_capacity(starts.len());
    while ends.len() < starts.len() {
        let first = ends.len();
        let wave = &starts[first..starts.len().min(2 * first + 1)];
        let found: Vec<E> = match wave {
            [only] => vec![search(only, &ends)],
            _ => wave.par_iter().map(|start| search(start, &ends)).collect(),
        };
        ends.extend(found);
    }
    ends
}

#[cfg(test)]
#[path = "tests/settled_starts.rs"]
mod tests;
