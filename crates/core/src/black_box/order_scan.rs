//! Many ARX or ARMAX orders on the same records: one triangle of the largest regressor matrix, the
//! others by taking its columns; ARMAX refined from there. (Python side: validation/order_scan/scan_orders.py)
//!
//! Reference: Ljung, *System Identification*, 2nd ed., sections 10.1 and 16.4; Hannan & Rissanen
//! (1982), Biometrika 69.

use rayon::prelude::*;

use crate::black_box::armax_newton::Newton;
use crate::black_box::armax_sums::Cut;
use crate::black_box::digital_filter::add_product;
use crate::black_box::polynomial_fit::{Before, PredictionError};
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_predictor::{Polynomials, Samples};
use crate::error::CoreError;
use crate::fits::least_squares::{Options, Problem, Progress};
use crate::fits::levenberg_marquardt::search;
use crate::numerics::householder::{back_substitute, triangularise};

/// A change of Akaike's criterion that ranks nothing.
const FINEST: f64 = 0.02;
/// Starts are near minima, and a structure that is larger than the data ask for has a valley that is a
/// thousand times flatter across than along: more damping lets steps end in it.
const FIRST_DAMPING: f64 = 1e-6;

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
    let moving = work.candidates.iter().any(|orders| orders.c > 0);
    let cuts: Vec<Cut> =
        if moving { work.records.iter().map(Cut::of).collect() } else { Vec::new() };
    let search = Search { work, cuts: &cuts, skip, stop };
    let one = |orders: &Orders| {
        let (theta, squares) = downdated(&triangle, width, &largest.places(orders))?;
        if orders.c == 0 {
            return Some(Scanned { theta, squares, iterations: 0, converged: true });
        }
        search.from(orders, &theta)
    };
    let mut found: Vec<_> = work.candidates.par_iter().map(one).collect();
    search.again_from_smaller(&mut found);
    Ok(found)
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

/// Searches of all structures on the same records.
struct Search<'a> {
    work: &'a Scan<'a>,
    cuts: &'a [Cut],
    skip: usize,
    stop: &'a (dyn Fn() -> bool + Sync),
}

impl Search<'_> {
    /// Least prediction errors from a start.
    fn from(&self, orders: &Orders, start: &[f64]) -> Option<Scanned> {
        let records = self.work.records.clone();
        let mut problem =
            PredictionError::new(orders.clone(), records, Before::Rest, self.skip, false).ok()?;
        (problem.fast, problem.levels) = (true, self.work.levels);
        let n = start.len();
        let (low, high) = (vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]);
        let options = Options {
            maximum_iterations: self.work.maximum_iterations,
            gradient_tolerance: 1e-6,
            step_tolerance: 1e-7,
            cost_tolerance: FINEST / problem.n_residuals().max(1) as f64,
            first_damping: FIRST_DAMPING,
            undamped_end: true,
            ..Options::default()
        };
        let proceed = &mut |_: &Progress<'_>| !(self.stop)();
        let mut objective = Newton::new(&mut problem, self.cuts);
        let found = search(&mut objective, start, &low, &high, &options, proceed).ok()?;
        Some(Scanned {
            squares: found.cost,
            iterations: found.iterations,
            converged: found.termination.is_converged(),
            theta: found.x,
        })
    }

    /// A structure has at least as small errors as those within it: where its search ended above one,
    /// it was at another minimum, and goes on from the smaller structure's.
    ///
    /// Structures of one size go side by side, the smallest first, so that threads change no bit.
    fn again_from_smaller(&self, found: &mut [Option<Scanned>]) {
        let candidates = &self.work.candidates;
        let mut sizes: Vec<usize> = candidates.iter().map(Orders::n_parameters).collect();
        sizes.sort_unstable();
        sizes.dedup();
        for size in sizes {
            let better = |place: usize| {
                let orders = &candidates[place];
                let own = found[place].as_ref().filter(|_| orders.c > 0)?;
                let (within, least) = (0..candidates.len())
                    .filter(|&other| lies_within(&candidates[other], orders))
                    .filter_map(|other| found[other].as_ref().map(|s| (other, s)))
                    .min_by(|(_, a), (_, b)| a.squares.total_cmp(&b.squares))?;
                if least.squares >= own.squares {
                    return None;
                }
                let start = widened(&candidates[within], orders, &least.theta);
                let again = self.from(orders, &start)?;
                let iterations = own.iterations + again.iterations;
                (again.squares < own.squares).then_some((place, Scanned { iterations, ..again }))
            };
            let of_size: Vec<usize> =
                (0..candidates.len()).filter(|&k| candidates[k].n_parameters() == size).collect();
            let made: Vec<_> = of_size.into_par_iter().filter_map(better).collect();
            made.into_iter().for_each(|(place, better)| found[place] = Some(better));
        }
    }
}

/// Whether a structure is another with some of its coefficients zero.
fn lies_within(smaller: &Orders, larger: &Orders) -> bool {
    let covers = |i: usize| {
        let (from, to) = (smaller.delays[i], smaller.delays[i] + smaller.b[i]);
        let (first, last) = (larger.delays[i], larger.delays[i] + larger.b[i]);
        smaller.b[i] == 0 || (first <= from && to <= last)
    };
    let less = smaller.n_parameters() < larger.n_parameters();
    less && smaller.a <= larger.a
        && smaller.c <= larger.c
        && smaller.b.len() == larger.b.len()
        && (0..larger.b.len()).all(covers)
}

/// Coefficients of the smaller structure in the larger one, the others zero.
fn widened(smaller: &Orders, larger: &Orders, theta: &[f64]) -> Vec<f64> {
    let counts = |orders: &Orders| [&[orders.a], &orders.b[..], &[orders.c]].concat();
    // Of each input: coefficients of the larger structure before the first of the smaller one.
    let inputs = (0..larger.b.len()).map(|i| match smaller.b[i] {
        0 => 0,
        _ => smaller.delays[i] - larger.delays[i],
    });
    let ahead = [0].into_iter().chain(inputs).chain([0]);
    let mut rest = theta;
    let mut made = Vec::with_capacity(larger.n_parameters());
    for ((few, many), zeros) in counts(smaller).into_iter().zip(counts(larger)).zip(ahead) {
        let (head, tail) = rest.split_at(few);
        rest = tail;
        let end = made.len() + many;
        made.resize(made.len() + zeros, 0.0);
        made.extend_from_slice(head);
        made.resize(end, 0.0);
    }
    made
}

#[cfg(test)]
#[path = "tests/order_scan.rs"]
mod tests;
