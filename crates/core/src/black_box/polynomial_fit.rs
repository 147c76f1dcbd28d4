//! Prediction-error fits of linear polynomial models. (Python side:
//! identification/prediction_error/fit.py)
//!
//! Derivatives are shifts of a few filtered signals; the Jacobian is triangularised block by block
//! and never kept. The unknown past of each record is linear in the errors and eliminated.
//!
//! Reference: Ljung, *System Identification*, 2nd ed., chapter 10; elimination of linear unknowns:
//! Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, in the form of Kaufman (1975), BIT 15.

use crate::black_box::polynomial_normal::{add_products, factorise, remove_square};
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_past::Past;
use crate::black_box::polynomial_predictor::{Derivatives, Polynomials, Run, Samples, run};
use crate::error::CoreError;
use crate::fits::least_squares::{Minimum, Options, Problem, Progress};
use crate::fits::levenberg_marquardt::minimise;
use crate::fits::settled_starts::{Settled, in_waves};
use crate::numerics::householder::{back_substitute, norm, triangularise};
use crate::numerics::polynomial_roots::reflected;

const BLOCK: usize = 512;

/// What is known of the time before a record.
#[derive(Debug, Clone)]
pub enum Before {
    /// Everything was at rest.
    Rest,
    /// Nothing: the values that stand for the past are fitted.
    Unknown,
    /// These values, one row for each record.
    Given(Vec<Vec<f64>>),
}

/// A fit to be made.
#[derive(Debug, Clone)]
pub struct PredictionError<'a> {
    /// Structure.
    pub orders: Orders,
    /// Records.
    pub records: Vec<Samples<'a>>,
    /// What is known of the time before each.
    pub before: Before,
    /// First errors of each record that do not count.
    pub skip: usize,
    /// Keep the roots of A, too, inside the circle.
    pub stable: bool,
    /// Fit a constant to each record: the level of its output.
    pub levels: bool,
    /// Take normal equations while they have digits enough: to rank many structures.
    pub fast: bool,
    cache: Option<(Vec<f64>, Vec<Run>, Vec<Past>)>,
}

impl<'a> PredictionError<'a> {
    /// Check that data and structure belong together.
    ///
    /// # Errors
    /// `Shape` where they do not, `NotFinite` for a sample that is no number.
    pub fn new(
        orders: Orders,
        records: Vec<Samples<'a>>,
        before: Before,
        skip: usize,
        stable: bool,
    ) -> Result<Self, CoreError> {
        let needed = orders.b.len();
        let shared = orders.f.len() == 1 && needed > 1;
        let below = if shared { needed } else { orders.f.len() };
        for (what, found) in [("F polynomials", below), ("delays", orders.delays.len())] {
            if found != needed {
                return Err(CoreError::Shape { what, found, needed });
            }
        }
        for record in &records {
            if record.inputs.len() != needed {
                let found = record.inputs.len();
                return Err(CoreError::Shape { what: "inputs", found, needed });
            }
            for row in record.inputs.iter().chain([&record.output]) {
                if row.len() != record.output.len() {
                    let (found, needed) = (row.len(), record.output.len());
                    return Err(CoreError::Shape { what: "samples of an input", found, needed });
                }
                if let Some(index) = row.iter().position(|x| !x.is_finite()) {
                    return Err(CoreError::NotFinite { what: "a channel", index });
                }
            }
        }
        if let Before::Given(rows) = &before
            && rows.len() != records.len()
        {
            let (found, needed) = (rows.len(), records.len());
            return Err(CoreError::Shape { what: "values of the past", found, needed });
        }
        Ok(Self { orders, records, before, skip, stable, levels: false, fast: false, cache: None })
    }

    /// Runs of the predictor with the past that counts, and the past's directions.
    pub fn runs(&self, theta: &[f64]) -> Result<(Vec<Run>, Vec<Past>), CoreError> {
        let p = Polynomials::new(&self.orders, theta)?;
        let mut runs = Vec::with_capacity(self.records.len());
        let mut pasts = Vec::new();
        for (index, record) in self.records.iter().enumerate() {
            let n = record.output.len();
            let unknown = matches!(self.before, Before::Unknown);
            let given = if let Before::Given(rows) = &self.before { &rows[index][..] } else { &[] };
            let mut made = run(&self.orders, &p, record, given);
            if unknown || self.levels {
                let mut past =
                    if unknown { Past::new(&self.orders, &p, n, self.skip) } else { Past::empty() };
                if self.levels {
                    past.add_level(&p, n, self.skip);
                }
                let values = past.best(&made.error);
                made.add_past(&self.orders, &p, &past, &values);
                pasts.push(past);
            }
            runs.push(made);
        }
        Ok((runs, pasts))
    }

    /// Add one record's rows to the triangle of [Jacobian | errors].
    fn absorb(&self, triangle: &mut [f64], made: &Derivatives, run: &Run, past: Option<&Past>) {
        let width = self.orders.n_parameters() + 1;
        let n = run.error.len();
        let shares = past.map_or(Vec::new(), |past| past.level_shares(made));
        let mut first = self.skip;
        let mut work = Vec::new();
        while first < n {
            let lasting = past.map_or(0, Past::lasting);
            // The past moves the first rows together, so they make one block.
            let count = if first < lasting { lasting.max(BLOCK) - first } else { BLOCK };
            let count = count.min(n - first);
            let height = width + count;
            work.clear();
            work.resize(height * width, 0.0);
            for (column, above) in work.chunks_exact_mut(height).zip(triangle.chunks_exact(width)) {
                column[..width].copy_from_slice(above);
            }
            made.fill(first, count, &mut work, height, width);
            let errors = &mut work[(width - 1) * height + width..];
            errors.copy_from_slice(&run.error[first..first + count]);
            if let Some(past) = past
                && first < lasting
            {
                for column in work.chunks_exact_mut(height).take(width - 1) {
                    let mut whole = vec![0.0; lasting.max(first + count)];
                    whole[first..first + count].copy_from_slice(&column[width..]);
                    past.remove_from(&mut whole);
                    column[width..].copy_from_slice(&whole[first..first + count]);
                }
            }
            if let Some(level) = past.and_then(|past| past.level.as_ref()) {
                for (column, share) in work.chunks_exact_mut(height).zip(&shares) {
                    let rows = column[width..].iter_mut().zip(&level[first..]);
                    rows.for_each(|(value, d)| *value -= share * d);
                }
            }
            triangularise(&mut work, height, width);
            for (column, above) in work.chunks_exact(height).zip(triangle.chunks_exact_mut(width)) {
                above.copy_from_slice(&column[..width]);
            }
            first += count;
        }
    }
}

impl Problem for PredictionError<'_> {
    fn n_parameters(&self) -> usize {
        self.orders.n_parameters()
    }

    fn n_residuals(&self) -> usize {
        self.records.iter().map(|r| r.output.len().saturating_sub(self.skip)).sum()
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError> {
        let (runs, pasts) = self.runs(x)?;
        let counted = runs.iter().flat_map(|run| run.error.iter().skip(self.skip));
        residuals.iter_mut().zip(counted).for_each(|(place, value)| *place = *value);
        self.cache = Some((x.to_vec(), runs, pasts));
        Ok(())
    }

    fn jacobian(&mut self, _x: &[f64], _jacobian: &mut [f64]) -> Result<(), CoreError> {
        Err(CoreError::Singular { what: "a Jacobian that is never kept" })
    }

    fn triangle(&mut self, x: &[f64], triangle: &mut [f64]) -> Result<bool, CoreError> {
        let (runs, pasts) = match self.cache.take() {
            Some((at, runs, pasts)) if at == x => (runs, pasts),
            _ => self.runs(x)?,
        };
        let p = Polynomials::new(&self.orders, x)?;
        let made: Vec<Derivatives> = self
            .records
            .iter()
            .zip(&runs)
            .map(|(record, run)| Derivatives::new(&self.orders, &p, record, run))
            .collect();
        if self.fast && !matches!(self.before, Before::Unknown) {
            let mut products = vec![0.0; triangle.len()];
            for (index, (made, run)) in made.iter().zip(&runs).enumerate() {
                add_products(made, &run.error, self.skip, &mut products);
                if let Some(past) = pasts.get(index) {
                    remove_square(&past.level_shares(made), &mut products);
                }
            }
            if let Some(found) = factorise(&products, self.orders.n_parameters() + 1) {
                triangle.copy_from_slice(&found);
                return Ok(true);
            }
        }
        for (index, (made, run)) in made.iter().zip(&runs).enumerate() {
            self.absorb(triangle, made, run, pasts.get(index));
        }
        Ok(true)
    }

    /// The predictor must forget: C and F stay inside the circle, A only where that is asked.
    fn project(&self, x: &mut [f64]) {
        let Ok(mut p) = Polynomials::new(&self.orders, x) else { return };
        let watched =
            p.f.iter_mut().chain([&mut p.c]).chain(if self.stable { Some(&mut p.a) } else { None });
        let mut moved = false;
        for polynomial in watched {
            if let Some(inside) = reflected(polynomial) {
                *polynomial = inside;
                moved = true;
            }
        }
        if moved {
            x.copy_from_slice(&p.flat());
        }
    }
}

/// Fit from each start, in waves (`settled_starts`); what `stop` answers ends all of them.
pub fn fit_from(
    problem: &PredictionError<'_>,
    starts: &[Vec<f64>],
    options: &Options,
    stop: &(dyn Fn() -> bool + Sync),
) -> Vec<Result<Minimum, CoreError>> {
    let n = problem.n_parameters();
    let (low, high) = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
    let search = |start: &Vec<f64>, known: &[Result<Minimum, CoreError>]| {
        let ends: Vec<(&Minimum, Settled)> = known.iter().flatten().filter_map(settled).collect();
        let mut at = None;
        let mut proceed = |now: &Progress<'_>| {
            at =
                ends.iter().find(|(_, end)| end.holds(now.x)).map(|(end, _)| (now.iteration, *end));
            at.is_none() && !stop()
        };
        let found = minimise(&mut problem.clone(), start, &low, &high, options, &mut proceed);
        match at {
            Some((iterations, end)) => Ok(Minimum { iterations, ..end.clone() }),
            None => found,
        }
    };
    in_waves(starts, search)
}

/// A minimum with the ellipsoid about it in which other starts count as there.
fn settled(end: &Minimum) -> Option<(&Minimum, Settled)> {
    let variance = end.cost / end.residuals.len() as f64;
    Settled::of(&end.x, &end.triangle, variance, end.termination).map(|about| (end, about))
}

/// A linear regression: ARX, or one stage of a start.
#[derive(Debug, Clone)]
pub struct Regression {
    /// Coefficients.
    pub theta: Vec<f64>,
    /// Triangle of [regressors | output], (n + 1 × n + 1), column-major.
    pub triangle: Vec<f64>,
    /// Rows that entered.
    pub n_rows: usize,
    /// First coefficient whose regressor is a combination of those before it.
    pub dependent: Option<usize>,
}

/// Least squares of A y = Σ Bᵢ uᵢ + e.
///
/// # Errors
/// Where data and structure do not belong together.
pub fn regress(problem: &mut PredictionError<'_>) -> Result<Regression, CoreError> {
    let n = problem.n_parameters();
    let width = n + 1;
    let n_rows = problem.n_residuals();
    let mut triangle = vec![0.0; width * width];
    problem.triangle(&vec![0.0; n], &mut triangle)?;
    let tolerance = f64::EPSILON * n_rows.max(width) as f64;
    let dependent = (0..n).find(|&j| {
        let column = &triangle[j * width..j * width + n];
        column[j].abs() <= tolerance * norm(column)
    });
    let mut theta = vec![0.0; n];
    let wanted: Vec<f64> = triangle[n * width..n * width + n].iter().map(|x| -x).collect();
    back_substitute(&triangle, width, n, &wanted, &mut theta);
    Ok(Regression { theta, triangle, n_rows, dependent })
}

#[cfg(test)]
#[path = "tests/polynomial_fit.rs"]
mod tests;
