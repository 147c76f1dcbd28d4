//! Outputs alone of a linear system over sampled inputs, at every sample or at some.
//! (Python side: simulation/model_outputs.py)
//!
//! A step is one product of a matrix with states and inputs together, four rows at a time, and goes from
//! one sample that is asked for to the next; outputs are taken block by block of those samples. No state
//! is kept: `linear_simulation` keeps them.

use crate::error::CoreError;
use crate::linear::discretisation::{Sampled, Tap};
use crate::linear::linear_simulation::sample;
use crate::numerics::householder::dot;
use crate::numerics::widest::widest;

/// Samples whose outputs are worked out together.
const BLOCK: usize = 64;
const LANES: usize = 4;
/// Groups of rows up to which a step stays in registers; larger systems go row by row.
const MOST_GROUPS: usize = 8;

/// A discretised system, from one wanted sample to the next, and what it is driven by.
struct Driven<'a> {
    sampled: Sampled,
    c: &'a [f64],
    inputs: &'a [f64],
    n_samples: usize,
    every: usize,
    n: usize,
    p: usize,
}

/// States and tapped inputs that outputs are made of at up to `BLOCK` samples, and the outputs.
struct Lines {
    places: Vec<usize>,
    sources: Vec<[f64; BLOCK]>,
    filled: usize,
    begun: usize,
    outputs: Vec<f64>,
}

/// Outputs (p × ⌈n_samples / every⌉) at samples 0, `every`, 2 `every` …, from an initial state; C with
/// its number of rows.
///
/// # Errors
/// `Shape` where matrices, inputs or the state do not fit, `NotFinite` where the run diverges.
pub fn outputs(
    sampled: &Sampled,
    (c, p): (&[f64], usize),
    inputs: &[f64],
    n_samples: usize,
    initial: &[f64],
    every: usize,
) -> Result<Vec<f64>, CoreError> {
    let n = initial.len();
    let m = sampled.taps.iter().map(|tap| tap.input + 1).max().unwrap_or(0);
    for (what, found, needed) in [
        ("transition matrix", sampled.transition.len(), n * n),
        ("output matrix", c.len(), p * n),
        ("step between outputs", every.min(1), 1),
    ] {
        if found != needed {
            return Err(CoreError::Shape { what, found, needed });
        }
    }
    if inputs.len() < m * n_samples {
        let (found, needed) = (inputs.len(), m * n_samples);
        return Err(CoreError::Shape { what: "inputs of the simulation", found, needed });
    }
    let driven = Driven {
        sampled: several_steps(sampled, n, every.min(n_samples)),
        c,
        inputs,
        n_samples,
        every,
        n,
        p,
    };
    let found = widest(
        #[inline(always)]
        || match n.div_ceil(LANES) {
            0 | 1 => driven.run::<1>(initial),
            2 => driven.run::<2>(initial),
            3 => driven.run::<3>(initial),
            4 => driven.run::<4>(initial),
            5 => driven.run::<5>(initial),
            6 => driven.run::<6>(initial),
            7 => driven.run::<7>(initial),
            MOST_GROUPS => driven.run::<MOST_GROUPS>(initial),
            _ => driven.run_long(initial),
        },
    );
    match found.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "simulated output", index }),
        None => Ok(found),
    }
}

impl Driven<'_> {
    #[inline(always)]
    fn run<const G: usize>(&self, initial: &[f64]) -> Vec<f64> {
        let columns = self.columns::<G>();
        let mut sources = vec![0.0; columns.len()];
        sources[..self.n].copy_from_slice(initial);
        let mut lines = self.lines();
        for k in (0..self.n_samples).step_by(self.every) {
            self.tap(k, &mut sources[self.n..]);
            self.keep(&sources, &mut lines);
            let next = product(&columns, &sources);
            let values = next.as_flattened();
            sources[..self.n].copy_from_slice(&values[..self.n]);
        }
        self.finish(lines)
    }

    /// As `run`, for systems whose step does not fit into registers.
    #[inline(always)]
    fn run_long(&self, initial: &[f64]) -> Vec<f64> {
        let n = self.n;
        let rows: Vec<Vec<f64>> = (0..n).map(|row| self.row(row)).collect();
        let mut sources = vec![0.0; n + self.sampled.taps.len()];
        sources[..n].copy_from_slice(initial);
        let (mut lines, mut next) = (self.lines(), vec![0.0; n]);
        for k in (0..self.n_samples).step_by(self.every) {
            self.tap(k, &mut sources[n..]);
            self.keep(&sources, &mut lines);
            for (value, row) in next.iter_mut().zip(&rows) {
                *value = dot(row, &sources);
            }
            sources[..n].copy_from_slice(&next);
        }
        self.finish(lines)
    }

    /// One row of the step's matrix: of the states, then of the tapped inputs.
    fn row(&self, row: usize) -> Vec<f64> {
        let states = &self.sampled.transition[row * self.n..(row + 1) * self.n];
        states.iter().copied().chain(self.sampled.taps.iter().map(|tap| tap.state[row])).collect()
    }

    /// The step's matrix by columns, rows in groups; an even number of columns.
    fn columns<const G: usize>(&self) -> Vec<[[f64; LANES]; G]> {
        let count = (self.n + self.sampled.taps.len()).next_multiple_of(2);
        let mut columns = vec![[[0.0; LANES]; G]; count];
        for row in 0..self.n {
            for (column, value) in columns.iter_mut().zip(self.row(row)) {
                column[row / LANES][row % LANES] = value;
            }
        }
        columns
    }

    fn lines(&self) -> Lines {
        let count = self.n + self.sampled.taps.len();
        let is_seen = |&place: &usize| (0..self.p).any(|row| self.factor(row, place) != 0.0);
        let places: Vec<usize> = (0..count).filter(is_seen).collect();
        let sources = vec![[0.0; BLOCK]; places.len()];
        let outputs = vec![0.0; self.p * self.n_samples.div_ceil(self.every)];
        Lines { places, sources, filled: 0, begun: 0, outputs }
    }

    /// By which a state or tapped input enters an output.
    #[inline(always)]
    fn factor(&self, row: usize, place: usize) -> f64 {
        match place.checked_sub(self.n) {
            Some(tap) => self.sampled.taps[tap].output[row],
            None => self.c[row * self.n + place],
        }
    }

    #[inline(always)]
    fn tap(&self, k: usize, into: &mut [f64]) {
        for (value, tap) in into.iter_mut().zip(&self.sampled.taps) {
            let input = &self.inputs[tap.input * self.n_samples..(tap.input + 1) * self.n_samples];
            *value = sample(input, k, tap.ahead);
        }
    }

    /// Keep what outputs are made of.
    #[inline(always)]
    fn keep(&self, sources: &[f64], lines: &mut Lines) {
        for (line, &place) in lines.sources.iter_mut().zip(&lines.places) {
            line[lines.filled] = sources[place];
        }
        lines.filled += 1;
        if lines.filled == BLOCK {
            self.flush(lines);
        }
    }

    #[inline(always)]
    fn flush(&self, lines: &mut Lines) {
        let count = self.n_samples.div_ceil(self.every);
        for row in 0..self.p {
            let mut sums = [0.0; BLOCK];
            for (&place, line) in lines.places.iter().zip(&lines.sources) {
                let factor = self.factor(row, place);
                if factor != 0.0 {
                    for k in 0..BLOCK {
                        sums[k] += factor * line[k];
                    }
                }
            }
            let at = row * count + lines.begun;
            lines.outputs[at..at + lines.filled].copy_from_slice(&sums[..lines.filled]);
        }
        lines.begun += lines.filled;
        lines.filled = 0;
    }

    #[inline(always)]
    fn finish(&self, mut lines: Lines) -> Vec<f64> {
        self.flush(&mut lines);
        lines.outputs
    }
}

/// A system that takes several steps at once: x⁺ = Φˢ x + Σ Φˢ⁻¹⁻ⁱ taps, outputs at the first of them.
fn several_steps(sampled: &Sampled, n: usize, steps: usize) -> Sampled {
    let mut found = sampled.clone();
    for later in 1..steps {
        // What was gathered goes one step on, and the next step's inputs join it.
        found.transition = times(&sampled.transition, &found.transition, n);
        for tap in &mut found.taps {
            tap.state = times(&sampled.transition, &tap.state, n);
        }
        for tap in &sampled.taps {
            let ahead = tap.ahead.saturating_add_unsigned(later);
            let is_same = |each: &&mut Tap| each.input == tap.input && each.ahead == ahead;
            match found.taps.iter_mut().find(is_same) {
                Some(known) => {
                    for (sum, value) in known.state.iter_mut().zip(&tap.state) {
                        *sum += value;
                    }
                }
                None => found.taps.push(Tap {
                    ahead,
                    output: vec![0.0; tap.output.len()],
                    ..tap.clone()
                }),
            }
        }
    }
    found
}

/// A square matrix times another of as many rows, both row by row.
fn times(square: &[f64], other: &[f64], n: usize) -> Vec<f64> {
    let columns = other.len().checked_div(n).unwrap_or(0);
    let mut found = vec![0.0; other.len()];
    for (row, into) in found.chunks_exact_mut(columns.max(1)).enumerate() {
        for (factor, from) in square[row * n..].iter().zip(other.chunks_exact(columns)) {
            for (sum, value) in into.iter_mut().zip(from) {
                *sum += factor * value;
            }
        }
    }
    found
}

/// A matrix by columns times a vector: even and odd columns in sums of their own, which need not wait.
#[inline(always)]
fn product<const G: usize>(columns: &[[[f64; LANES]; G]], sources: &[f64]) -> [[f64; LANES]; G] {
    let mut sums = [[[0.0; LANES]; G]; 2];
    for (pair, values) in columns.as_chunks::<2>().0.iter().zip(sources.as_chunks::<2>().0) {
        for (sums, (column, value)) in sums.iter_mut().zip(pair.iter().zip(values)) {
            for (sum, factors) in sums.iter_mut().zip(column) {
                for (entry, factor) in sum.iter_mut().zip(factors) {
                    *entry += factor * value;
                }
            }
        }
    }
    let [mut even, odd] = sums;
    for (sum, other) in even.as_flattened_mut().iter_mut().zip(odd.as_flattened()) {
        *sum += other;
    }
    even
}

#[cfg(test)]
#[path = "tests/linear_outputs.rs"]
mod tests;
