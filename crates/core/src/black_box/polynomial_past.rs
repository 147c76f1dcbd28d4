//! What the time before a record, and an unknown level, add to the errors of a polynomial predictor.
//! (Python side: models/polynomial/model.py)
//!
//! Both are linear in the errors: directions that are eliminated, and a run's rest that is added.
//! What the past adds runs out; only as many samples as it takes are worked on.

use crate::black_box::digital_filter::divide;
use crate::black_box::polynomial_orders::Orders;
use crate::black_box::polynomial_predictor::{Column, Derivatives, Polynomials, Run, Samples, run};
use crate::numerics::gram_schmidt::dot;
use crate::numerics::householder::norm;

/// Orthonormal directions in which the unknown past, and an unknown level, move the errors of a
/// record.
#[derive(Debug, Clone)]
pub struct Past {
    /// Directions of the past, each as long as it lasts.
    pub directions: Vec<Vec<f64>>,
    /// Direction of the level, as long as the record.
    pub level: Option<Vec<f64>>,
    /// Errors by a level of one.
    steady: Option<Vec<f64>>,
    /// Which unknown each direction came from, and its coordinates on the directions before it.
    factors: Vec<(usize, Vec<f64>)>,
    n_unknowns: usize,
}

/// Below this share of its largest value an impulse response is over.
const FORGOTTEN: f64 = 1e-14;
/// The same of its second half, for the rest of it not to be looked at.
const OVER: f64 = 1e-17;
/// Samples that are looked at, at least.
const SHORTEST: usize = 64;
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
            let response = until_over(0, n, |length| {
                let mut response = impulse(&p.d, length);
                divide(&p.c, &mut response);
                divide(&p.f[j], &mut response);
                response
            });
            made.add(&response, -1.0, count, &mut unknown, (skip, n));
        }
        if of_noise > 0 {
            let response = until_over(0, n, |length| {
                let mut response = impulse(&[1.0], length);
                divide(&p.c, &mut response);
                response
            });
            made.add(&response, 1.0, of_noise, &mut unknown, (skip, n));
        }
        made
    }

    /// Nothing unknown.
    pub fn empty() -> Self {
        let (directions, factors) = (Vec::new(), Vec::new());
        Self { directions, level: None, steady: None, factors, n_unknowns: 0 }
    }

    /// Add a constant before 1/C: an unknown level of the output, whatever A and D make of it.
    pub fn add_level(&mut self, p: &Polynomials, n: usize, skip: usize) {
        let mut response = vec![1.0; n];
        divide(&p.c, &mut response);
        self.steady = Some(response.clone());
        response[..skip.min(n)].fill(0.0);
        let place = self.n_unknowns;
        self.n_unknowns += 1;
        let before = self.directions.len();
        self.orthogonalise(response, place);
        if self.directions.len() > before {
            self.level = self.directions.pop();
        }
    }

    /// Directions of `count` unknowns by the response to one, which is over at its end or lasts all
    /// `n` samples, of which the first `skip` do not count.
    fn add(
        &mut self,
        response: &[f64],
        sign: f64,
        count: usize,
        unknown: &mut usize,
        (skip, n): (usize, usize),
    ) {
        let largest = response.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let lasting = response.iter().rposition(|x| x.abs() > FORGOTTEN * largest).unwrap_or(0);
        for shift in 0..count {
            let length = (lasting + 1 + shift).min(n);
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

impl Run {
    /// Add what the past and the level bring to a run from rest: a run is linear in them.
    pub fn add_past(&mut self, orders: &Orders, p: &Polynomials, past: &Past, values: &[f64]) {
        let n = self.error.len();
        let unknown = past.n_unknowns - usize::from(past.steady.is_some());
        if unknown > 0 {
            let moved = until_over(past.lasting(), n, |length| {
                let rest = vec![0.0; length];
                let inputs = vec![&rest[..]; orders.b.len()];
                run(orders, p, &Samples { output: &rest, inputs }, &values[..unknown])
            });
            let targets = self.responses.iter_mut().chain([&mut self.error, &mut self.disturbance]);
            let parts = moved.responses.iter().chain([&moved.error, &moved.disturbance]);
            for (target, part) in targets.zip(parts) {
                target.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
            }
        }
        if let Some(steady) = &past.steady {
            self.level = values.last().copied().unwrap_or(0.0);
            self.error.iter_mut().zip(steady).for_each(|(sum, r)| *sum += self.level * r);
        }
    }
}

/// What is made of so many samples, as many of `n` as it takes for all of it to be over.
fn until_over<M: Fades>(first: usize, n: usize, make: impl Fn(usize) -> M) -> M {
    let mut length = first.max(SHORTEST).min(n);
    loop {
        let made = make(length);
        if length == n || made.is_over() {
            return made;
        }
        length = (4 * length).min(n);
    }
}

/// Signals that run out.
trait Fades {
    /// Whether nothing of the second half matters, or will.
    fn is_over(&self) -> bool;
}

impl Fades for Vec<f64> {
    fn is_over(&self) -> bool {
        let largest = |part: &[f64]| part.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        largest(&self[self.len() / 2..]) <= OVER * largest(self)
    }
}

impl Fades for Run {
    fn is_over(&self) -> bool {
        self.responses.iter().chain([&self.error, &self.disturbance]).all(Fades::is_over)
    }
}

#[cfg(test)]
#[path = "tests/polynomial_past.rs"]
mod tests;
