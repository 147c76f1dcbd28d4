//! Many ARX or ARMAX orders on the same records: one triangle of the largest regressor matrix, the
//! others by taking its columns; ARMAX refined from there. (Python side: validation/order_scan/scan_orders.py)
//!
//! Reference: Ljung, *System Identification*, 2nd ed., sections 10.1 and 16.4; Hannan & Rissanen
//! (1982), Biometrika 69.

use rayon::prelude::*;

use crate::black_box::digital_filter::add_product;
use crate::black_box::polynomial_fit::{Before, PredictionError};
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_predictor::{Polynomials, Samples};
use crate::error::CoreError;
use crate::fits::least_squares::{Options, Problem, Progress};
use crate::fits::levenberg_marquardt::minimise;
use crate::numerics::householder::{back_substitute, triangularise};

/// A change of Akaike's criterion that ranks nothing.
const FINEST: f64 = 0.02;

/// What is scanned, and on what.
pub struct Scan<'a> {
    /// Records of the fits.
    pub records: Vec<Samples<'a>>,
    /// Structures A y = B u + C e.
    pub candidates: Vec<Orders>,
    /// Degree of the long ARX model whose errors stand for the noise.
    pub long: usize,
    /// Most steps of each refinement.
    pub maximum_iterations: usize,
    /// Fit a constant to each record.
    pub levels: bool,
}

/// One structure, fitted.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Coefficients.
    pub theta: Vec<f64>,
    /// Sum of squared prediction errors after the longest lag of all structures.
    pub squares: f64,
    /// Steps of the refinement.
    pub iterations: usize,
    /// Whether it ended at a minimum.
    pub converged: bool,
}

/// Largest orders of a scan: the columns of its one regressor matrix.
struct Largest {
    orders: Orders,
    skip: usize,
}

impl Largest {
    fn of(candidates: &[Orders], n_inputs: usize) -> Self {
        let most = |of: &dyn Fn(&Orders) -> usize| candidates.iter().map(of).max().unwrap_or(0);
        let delays: Vec<usize> = (0..n_inputs)
            .map(|i| candidates.iter().map(|c| c.delays[i]).min().unwrap_or(0))
            .collect();
        let b: Vec<usize> =
            (0..n_inputs).map(|i| most(&|c| c.b[i] + c.delays[i]) - delays[i]).collect();
        let (a, c) = (most(&|o| o.a), most(&|o| o.c));
        let spans = (0..n_inputs).map(|i| b[i] + delays[i]).max().unwrap_or(0);
        let orders = Orders { a, b, c, d: 0, f: vec![0; n_inputs], delays };
        Self { orders, skip: a.max(spans).max(c) }
    }

    /// Places of a structure's coefficients among the columns.
    fn places(&self, orders: &Orders) -> Vec<usize> {
        let mut places: Vec<usize> = (0..orders.a).collect();
        let mut base = self.orders.a;
        for (i, &count) in orders.b.iter().enumerate() {
            let shift = base + orders.delays[i] - self.orders.delays[i];
            places.extend(shift..shift + count);
            base += self.orders.b[i];
        }
        places.extend(base..base + orders.c);
        places
    }
}

/// Fit every structure; `stop` ends the work early with what is unfinished left
/// as it started.
///
/// # Errors
/// Where records and structures do not belong together.
pub fn scan(
    work: &Scan<'_>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Option<Scanned>>, CoreError> {
    let n_inputs = work.records.first().map_or(0, |record| record.inputs.len());
    for orders in &work.candidates {
        let needed = n_inputs;
        for (what, found) in [("B", orders.b.len()), ("delays", orders.delays.len())] {
            if found != needed {
                return Err(CoreError::Shape { what, found, needed });
            }
        }
    }
    let largest = Largest::of(&work.candidates, n_inputs);
    let skip = largest.skip;
    if let Some(shortest) = work.records.iter().map(|r| r.output.len()).min()
        && shortest <= skip + work.long
    {
        let needed = skip + work.long + 1;
        return Err(CoreError::Shape { what: "samples of a record", found: shortest, needed });
    }
    let innovations = long_errors(work, skip)?;
    let triangle = regressors(work, &largest, &innovations)?;
    let width = largest.orders.n_parameters() + 1;
    let one = |orders: &Orders| {
        let start = downdated(&triangle, width, &largest.places(orders))?;
        refine(work, orders, start, skip, stop)
    };
    Ok(work.candidates.par_iter().map(one).collect())
}

/// Errors of a long ARX model, zero where its lags reach before the record.
fn long_errors(work: &Scan<'_>, skip: usize) -> Result<Vec<Vec<f64>>, CoreError> {
    if work.candidates.iter().all(|orders| orders.c == 0) {
        return Ok(work.records.iter().map(|r| vec![0.0; r.output.len()]).collect());
    }
    let n_inputs = work.records.first().map_or(0, |record| record.inputs.len());
    let orders = Orders {
        a: work.long,
        b: vec![work.long + 1; n_inputs],
        c: 0,
        d: 0,
        f: vec![0; n_inputs],
        delays: vec![0; n_inputs],
    };
    let first = work.long.max(skip);
    let mut problem =
        PredictionError::new(orders.clone(), work.records.clone(), Before::Rest, first, false)?;
    (problem.fast, problem.levels) = (true, work.levels);
    let n = orders.n_parameters();
    let mut triangle = vec![0.0; (n + 1) * (n + 1)];
    problem.triangle(&vec![0.0; n], &mut triangle)?;
    let mut theta = vec![0.0; n];
    let wanted: Vec<f64> = triangle[n * (n + 1)..][..n].iter().map(|x| -x).collect();
    back_substitute(&triangle, n + 1, n, &wanted, &mut theta);
    let p = Polynomials::new(&orders, &theta)?;
    Ok(work
        .records
        .iter()
        .map(|record| {
            let mut errors = vec![0.0; record.output.len()];
            add_product(1.0, &p.a, 0, record.output, &mut errors);
            for (b, input) in p.b.iter().zip(&record.inputs) {
                add_product(-1.0, b, 0, input, &mut errors);
            }
            errors[..first].fill(0.0);
            errors
        })
        .collect())
}

/// Triangle of [lags of output | of inputs | of innovations | output].
fn regressors(
    work: &Scan<'_>,
    largest: &Largest,
    innovations: &[Vec<f64>],
) -> Result<Vec<f64>, CoreError> {
    let records = work
        .records
        .iter()
        .zip(innovations)
        .map(|(record, noise)| Samples {
            output: record.output,
            inputs: record.inputs.iter().copied().chain([noise.as_slice()]).collect(),
        })
        .collect();
    let all = &largest.orders;
    let orders = Orders {
        a: all.a,
        b: all.b.iter().copied().chain([all.c]).collect(),
        c: 0,
        d: 0,
        f: vec![0; all.f.len() + 1],
        delays: all.delays.iter().copied().chain([1]).collect(),
    };
    let n = orders.n_parameters();
    let mut problem = PredictionError::new(orders, records, Before::Rest, largest.skip, false)?;
    problem.levels = work.levels;
    let mut triangle = vec![0.0; (n + 1) * (n + 1)];
    problem.triangle(&vec![0.0; n], &mut triangle)?;
    Ok(triangle)
}

/// Least squares on some of the columns, from the triangle of all; the sum of squares beside it.
/// `None` where the columns are collinear.
fn downdated(triangle: &[f64], width: usize, places: &[usize]) -> Option<(Vec<f64>, f64)> {
    let n = places.len();
    let mut work = Vec::with_capacity(width * (n + 1));
    for &place in places.iter().chain([&(width - 1)]) {
        work.extend(&triangle[place * width..(place + 1) * width]);
    }
    triangularise(&mut work, width, n + 1);
    let collinear = (0..n).any(|j| {
        let column = &work[j * width..j * width + n];
        let length: f64 = column.iter().map(|x| x * x).sum::<f64>().sqrt();
        column[j].abs() <= 1e-12 * length
    });
    if collinear {
        return None;
    }
    let mut theta = vec![0.0; n];
    let wanted: Vec<f64> = work[n * width..n * width + n].iter().map(|x| -x).collect();
    back_substitute(&work, width, n, &wanted, &mut theta);
    Some((theta, work[n * width + n].powi(2)))
}

fn refine(
    work: &Scan<'_>,
    orders: &Orders,
    start: (Vec<f64>, f64),
    skip: usize,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Scanned> {
    let (theta, squares) = start;
    if orders.c == 0 {
        return Some(Scanned { theta, squares, iterations: 0, converged: true });
    }
    let records = work.records.clone();
    let mut problem =
        PredictionError::new(orders.clone(), records, Before::Rest, skip, false).ok()?;
    (problem.fast, problem.levels) = (true, work.levels);
    let n = theta.len();
    let (low, high) = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
    let options = Options {
        maximum_iterations: work.maximum_iterations,
        gradient_tolerance: 1e-6,
        step_tolerance: 1e-7,
        cost_tolerance: FINEST / problem.n_residuals().max(1) as f64,
        ..Options::default()
    };
    let proceed = &mut |_: &Progress<'_>| !stop();
    let found = minimise(&mut problem, &theta, &low, &high, &options, proceed).ok()?;
    Some(Scanned {
        squares: found.cost,
        iterations: found.iterations,
        converged: found.termination.is_converged(),
        theta: found.x,
    })
}

#[cfg(test)]
#[path = "tests/order_scan.rs"]
mod tests;
