//! The one-step predictor of A y = Σ (Bᵢ/Fᵢ) uᵢ + (C/D) e: its errors, their derivatives as shifts of
//! a few filtered signals, and what the unknown past adds. (Python side: models/polynomial/model.py)
//!
//! With wᵢ = (Bᵢ/Fᵢ) uᵢ and s = A y − Σ wᵢ the prediction error is e = (D/C) s. One F may stand under
//! all inputs: w = (Σ Bᵢ uᵢ)/F.
//!
//! Reference: Ljung, *System Identification*, 2nd ed., sections 4.2 and 10.3, eqs. 10.50 to 10.53.

use crate::black_box::digital_filter::{add_product, divide, divide_together};
use crate::black_box::polynomial_orders::Orders;
use crate::error::CoreError;
use crate::numerics::gram_schmidt::dot;
use crate::numerics::householder::norm;

/// The polynomials in q⁻¹; all but B start with one.
#[derive(Debug, Clone)]
pub struct Polynomials {
    /// A.
    pub a: Vec<f64>,
    /// B of each input, from its delay on.
    pub b: Vec<Vec<f64>>,
    /// C.
    pub c: Vec<f64>,
    /// D.
    pub d: Vec<f64>,
    /// F of each input, or the one of all.
    pub f: Vec<Vec<f64>>,
}

impl Polynomials {
    /// Take the coefficients in the order A, B₁ …, C, D, F₁ ….
    ///
    /// # Errors
    /// `Shape` where their number is not that of the orders.
    pub fn new(orders: &Orders, theta: &[f64]) -> Result<Self, CoreError> {
        if theta.len() != orders.n_parameters() {
            let (found, needed) = (theta.len(), orders.n_parameters());
            return Err(CoreError::Shape { what: "coefficients", found, needed });
        }
        let mut rest = theta;
        let mut take = |count: usize| {
            let (head, tail) = rest.split_at(count);
            rest = tail;
            head
        };
        let monic = |tail: &[f64]| [&[1.0], tail].concat();
        Ok(Self {
            a: monic(take(orders.a)),
            b: orders.b.iter().map(|&count| take(count).to_vec()).collect(),
            c: monic(take(orders.c)),
            d: monic(take(orders.d)),
            f: orders.f.iter().map(|&count| monic(take(count))).collect(),
        })
    }

    /// The coefficients back in one row.
    pub fn flat(&self) -> Vec<f64> {
        let mut row = self.a[1..].to_vec();
        self.b.iter().for_each(|b| row.extend(b));
        row.extend(&self.c[1..]);
        row.extend(&self.d[1..]);
        self.f.iter().for_each(|f| row.extend(&f[1..]));
        row
    }
}

/// Samples of one record.
#[derive(Debug, Clone)]
pub struct Samples<'a> {
    /// The output.
    pub output: &'a [f64],
    /// One row for each input.
    pub inputs: Vec<&'a [f64]>,
}

/// What the predictor computes on one record.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Prediction errors.
    pub error: Vec<f64>,
    /// s, the error before the noise model.
    pub disturbance: Vec<f64>,
    /// What comes out of each F.
    pub responses: Vec<Vec<f64>>,
    /// Constant that was fitted to D s, where there was one.
    pub level: f64,
}

/// Run the predictor; `memory` holds the values that stand for the past, or nothing for rest, and
/// after them the level where one is fitted.
pub fn run(orders: &Orders, p: &Polynomials, samples: &Samples<'_>, memory: &[f64]) -> Run {
    let n = samples.output.len();
    let (through_f, of_noise) = orders.memory();
    let mut disturbance = vec![0.0; n];
    add_product(1.0, &p.a, 0, samples.output, &mut disturbance);
    let mut responses = Vec::with_capacity(p.f.len());
    let mut used = 0;
    for (j, denominator) in p.f.iter().enumerate() {
        let driven = |sign: f64, target: &mut [f64]| {
            for i in orders.over(j) {
                add_product(sign, &p.b[i], orders.delays[i], samples.inputs[i], target);
            }
        };
        if orders.f[j] == 0 {
            driven(-1.0, &mut disturbance);
            responses.push(Vec::new());
            continue;
        }
        let mut response = vec![0.0; n];
        driven(1.0, &mut response);
        // What the unknown past adds to the first samples is remembered by the filter after it.
        add_past(&mut response, memory, used, through_f[j]);
        used += through_f[j];
        divide(denominator, &mut response);
        disturbance.iter_mut().zip(&response).for_each(|(s, w)| *s -= w);
        responses.push(response);
    }
    let mut error = if orders.d == 0 {
        disturbance.clone()
    } else {
        let mut product = vec![0.0; n];
        add_product(1.0, &p.d, 0, &disturbance, &mut product);
        product
    };
    add_past(&mut error, memory, used, of_noise);
    let level = memory.get(used + of_noise).copied().unwrap_or(0.0);
    error.iter_mut().for_each(|value| *value += level);
    divide(&p.c, &mut error);
    Run { error, disturbance, responses, level }
}

fn add_past(signal: &mut [f64], memory: &[f64], first: usize, count: usize) {
    if let Some(past) = memory.get(first..first + count) {
        signal.iter_mut().zip(past).for_each(|(value, extra)| *value += extra);
    }
}

/// One column of the Jacobian: a base signal, later by `shift` samples, with a sign.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// Place among the base signals.
    pub signal: usize,
    /// Samples of delay.
    pub shift: usize,
    /// Plus or minus one.
    pub sign: f64,
}

/// Filtered signals whose shifts are the derivatives of the error by the coefficients.
pub struct Derivatives {
    /// Base signals.
    pub signals: Vec<Vec<f64>>,
    /// One for each coefficient.
    pub columns: Vec<Column>,
}

impl Derivatives {
    /// Derivatives at the run of these polynomials.
    pub fn new(orders: &Orders, p: &Polynomials, samples: &Samples<'_>, run: &Run) -> Self {
        let mut made = Self { signals: Vec::new(), columns: Vec::new() };
        let mut last: Vec<Option<usize>> = Vec::new();
        let with_d = |x: &[f64]| {
            if orders.d == 0 {
                return x.to_vec();
            }
            let mut product = vec![0.0; x.len()];
            add_product(1.0, &p.d, 0, x, &mut product);
            product
        };
        if orders.a > 0 {
            made.push(with_d(samples.output), 1, orders.a, 1.0);
            last.push(None);
        }
        for (i, input) in samples.inputs.iter().enumerate().filter(|&(i, _)| orders.b[i] > 0) {
            made.push(with_d(input), orders.delays[i], orders.b[i], -1.0);
            last.push(Some(orders.denominator(i)));
        }
        if orders.c > 0 {
            made.push(run.error.clone(), 1, orders.c, -1.0);
            last.push(None);
        }
        if orders.d > 0 {
            made.push(run.disturbance.clone(), 1, orders.d, 1.0);
            last.push(None);
        }
        for (j, response) in run.responses.iter().enumerate().filter(|&(j, _)| orders.f[j] > 0) {
            made.push(with_d(response), 1, orders.f[j], 1.0);
            last.push(Some(j));
        }
        // Each recursion waits for its own last sample: three side by side fill the wait.
        for group in made.signals.chunks_mut(3) {
            match group {
                [x, y, z] => divide_together(&p.c, [x, y, z]),
                [x, y] => divide_together(&p.c, [x, y]),
                others => others.iter_mut().for_each(|x| divide(&p.c, x)),
            }
        }
        for (signal, denominator) in made.signals.iter_mut().zip(last) {
            if let Some(j) = denominator {
                divide(&p.f[j], signal);
            }
        }
        made
    }

    fn push(&mut self, signal: Vec<f64>, first: usize, count: usize, sign: f64) {
        let place = self.signals.len();
        self.signals.push(signal);
        let columns = (first..first + count).map(|shift| Column { signal: place, shift, sign });
        self.columns.extend(columns);
    }

    /// Rows `first` to `first + count` into a column-major block that is `height` rows high, from
    /// its row `at` on.
    pub fn fill(&self, first: usize, count: usize, block: &mut [f64], height: usize, at: usize) {
        for (column, target) in self.columns.iter().zip(block.chunks_exact_mut(height)) {
            let signal = &self.signals[column.signal];
            let target = &mut target[at..at + count];
            let rest = column.shift.saturating_sub(first).min(count);
            target[..rest].fill(0.0);
            let source = &signal[first + rest - column.shift.min(first + rest)..];
            for (value, sample) in target[rest..].iter_mut().zip(source) {
                *value = column.sign * sample;
            }
        }
    }
}

/// Orthonormal directions in which the unknown past, and an unknown level, move the errors of a
/// record.
#[derive(Debug, Clone)]
pub struct Past {
    /// Directions of the past, each as long as it lasts.
    pub directions: Vec<Vec<f64>>,
    /// Direction of the level, as long as the record.
    pub level: Option<Vec<f64>>,
    /// Which unknown each direction came from, and its coordinates on the directions before it.
    factors: Vec<(usize, Vec<f64>)>,
    n_unknowns: usize,
}

/// Below this share of its largest value an impulse response is over.
const FORGOTTEN: f64 = 1e-14;
/// Below this share of its length a direction counts as a combination of those before it.
const DEPENDENT: f64 = 1e-9;

impl Past {
    /// Directions for a record of `n` samples whose first `skip` errors do not count.
    pub fn new(orders: &Orders, p: &Polynomials, n: usize, skip: usize) -> Self {
        let (through_f, of_noise) = orders.memory();
        let mut made = Self::empty();
        made.n_unknowns = through_f.iter().sum::<usize>() + of_noise;
        let mut unknown = 0;
        for (j, &count) in through_f.iter().enumerate().filter(|&(_, &count)| count > 0) {
            let mut response = impulse(&p.d, n);
            divide_together(&p.c, [&mut response]);
            divide(&p.f[j], &mut response);
            made.add(&response, -1.0, count, &mut unknown, skip);
        }
        if of_noise > 0 {
            let mut response = impulse(&[1.0], n);
            divide(&p.c, &mut response);
            made.add(&response, 1.0, of_noise, &mut unknown, skip);
        }
        made
    }

    /// Nothing unknown.
    pub fn empty() -> Self {
        Self { directions: Vec::new(), level: None, factors: Vec::new(), n_unknowns: 0 }
    }

    /// Add a constant before 1/C: an unknown level of the output, whatever A and D make of it.
    pub fn add_level(&mut self, p: &Polynomials, n: usize, skip: usize) {
        let mut response = vec![1.0; n];
        divide(&p.c, &mut response);
        response[..skip.min(n)].fill(0.0);
        let place = self.n_unknowns;
        self.n_unknowns += 1;
        let before = self.directions.len();
        self.orthogonalise(response, place);
        if self.directions.len() > before {
            self.level = self.directions.pop();
        }
    }

    fn add(&mut self, response: &[f64], sign: f64, count: usize, unknown: &mut usize, skip: usize) {
        let largest = response.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let lasting = response.iter().rposition(|x| x.abs() > FORGOTTEN * largest).unwrap_or(0);
        for shift in 0..count {
            let length = (lasting + 1 + shift).min(response.len());
            let mut column = vec![0.0; length];
            for t in shift.max(skip)..length {
                column[t] = sign * response[t - shift];
            }
            self.orthogonalise(column, *unknown);
            *unknown += 1;
        }
    }

    fn orthogonalise(&mut self, mut column: Vec<f64>, unknown: usize) {
        let before = norm(&column);
        let mut coordinates = vec![0.0; self.directions.len() + 1];
        // Once leaves rounding errors along nearly parallel directions; twice is enough.
        for _ in 0..2 {
            for (direction, coordinate) in self.directions.iter().zip(&mut coordinates) {
                let shared = direction.len().min(column.len());
                let part = dot(&direction[..shared], &column[..shared]);
                *coordinate += part;
                column.resize(column.len().max(direction.len()), 0.0);
                column.iter_mut().zip(direction).for_each(|(x, d)| *x -= part * d);
            }
        }
        let after = norm(&column);
        if after > DEPENDENT * before {
            coordinates[self.directions.len()] = after;
            column.iter_mut().for_each(|x| *x /= after);
            self.directions.push(column);
            self.factors.push((unknown, coordinates));
        }
    }

    /// Length of the longest direction of the past.
    pub fn lasting(&self) -> usize {
        self.directions.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// Values of the unknowns that make these errors smallest, the level's last.
    pub fn best(&self, error: &[f64]) -> Vec<f64> {
        let mut wanted: Vec<f64> =
            self.directions.iter().chain(&self.level).map(|d| -dot(d, &error[..d.len()])).collect();
        let mut values = vec![0.0; self.n_unknowns];
        for k in (0..wanted.len()).rev() {
            let (unknown, coordinates) = &self.factors[k];
            let value = wanted[k] / coordinates[k];
            values[*unknown] = value;
            wanted[..k].iter_mut().zip(coordinates).for_each(|(w, c)| *w -= value * c);
        }
        values
    }

    /// Take out of a signal what the past can explain.
    pub fn remove_from(&self, signal: &mut [f64]) {
        for direction in &self.directions {
            let part = dot(direction, &signal[..direction.len()]);
            signal.iter_mut().zip(direction).for_each(|(x, d)| *x -= part * d);
        }
    }

    /// Coordinates of the derivatives on the direction of the level.
    pub fn level_shares(&self, made: &Derivatives) -> Vec<f64> {
        let Some(level) = &self.level else { return Vec::new() };
        let share = |column: &Column| {
            let shift = column.shift.min(level.len());
            column.sign * dot(&level[shift..], &made.signals[column.signal][..level.len() - shift])
        };
        made.columns.iter().map(share).collect()
    }
}

fn impulse(polynomial: &[f64], n: usize) -> Vec<f64> {
    let mut signal = vec![0.0; n];
    signal.iter_mut().zip(polynomial).for_each(|(x, p)| *x = *p);
    signal
}
