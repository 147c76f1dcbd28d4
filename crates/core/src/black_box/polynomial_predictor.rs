//! The one-step predictor of A y = Σ (Bᵢ/Fᵢ) uᵢ + (C/D) e: its errors, and their derivatives as shifts
//! of a few filtered signals. (Python side: models/polynomial/model.py)
//!
//! With wᵢ = (Bᵢ/Fᵢ) uᵢ and s = A y − Σ wᵢ the prediction error is e = (D/C) s. One F may stand under
//! all inputs: w = (Σ Bᵢ uᵢ)/F.
//!
//! Reference: Ljung, *System Identification*, 2nd ed., sections 4.2 and 10.3, eqs. 10.50 to 10.53.

use crate::black_box::digital_filter::{add_product, divide, divide_all};
use crate::black_box::polynomial_orders::Orders;
use crate::error::CoreError;

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
        divide_all(&p.c, made.signals.iter_mut().collect());
        for (j, denominator) in p.f.iter().enumerate() {
            let over = made.signals.iter_mut().zip(&last).filter(|&(_, &of)| of == Some(j));
            divide_all(denominator, over.map(|(signal, _)| signal).collect());
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
