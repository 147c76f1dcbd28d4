//! Outputs alone of a linear system over sampled inputs, at every sample or at some.
//! (Python side: simulation/model_outputs.py)
//!
//! A step is one product of a matrix with states and inputs together, four rows at a time; outputs are
//! taken block by block of samples. No state is kept: `linear_simulation` keeps them.

use crate::error::CoreError;
use crate::linear::discretisation::Sampled;
use crate::linear::linear_simulation::sample;
use crate::numerics::householder::dot;
use crate::numerics::widest::widest;

/// Samples whose outputs are worked out together.
const BLOCK: usize = 64;
const LANES: usize = 4;
/// Groups of rows up to which a step stays in registers; larger systems go row by row.
const MOST_GROUPS: usize = 8;

/// A discretised system and what it is driven by.
struct Driven<'a> {
    sampled: &'a Sampled,
    c: &'a [f64],
    inputs: &'a [f64],
    n_samples: usize,
    every: usize,
    n: usize,
    p: usize,
}

/// States and tapped inputs at up to `BLOCK` samples, row by row, and the outputs made of them.
struct Lines {
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
    let driven = Driven { sampled, c, inputs, n_samples, every, n, p };
    let found = widest(|| match n.div_ceil(LANES) {
        0 | 1 => driven.run::<1>(initial),
        2 => driven.run::<2>(initial),
        3 => driven.run::<3>(initial),
        4 => driven.run::<4>(initial),
        5 => driven.run::<5>(initial),
        6 => driven.run::<6>(initial),
        7 => driven.run::<7>(initial),
        MOST_GROUPS => driven.run::<MOST_GROUPS>(initial),
        _ => driven.run_long(initial),
    });
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
        for k in 0..self.n_samples {
            self.tap(k, &mut sources[self.n..]);
            self.keep(k, &sources, &mut lines);
            let next = product(&columns, &sources);
            let values = next.as_flattened();
            sources[..self.n].copy_from_slice(&values[..self.n]);
        }
        self.finish(lines)
    }

    /// As `run`, for systems whose step does not fit into registers.
    fn run_long(&self, initial: &[f64]) -> Vec<f64> {
        let n = self.n;
        let rows: Vec<Vec<f64>> = (0..n).map(|row| self.row(row)).collect();
        let mut sources = vec![0.0; n + self.sampled.taps.len()];
        sources[..n].copy_from_slice(initial);
        let (mut lines, mut next) = (self.lines(), vec![0.0; n]);
        for k in 0..self.n_samples {
            self.tap(k, &mut sources[n..]);
            self.keep(k, &sources, &mut lines);
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
        let sources = vec![[0.0; BLOCK]; self.n + self.sampled.taps.len()];
        let outputs = vec![0.0; self.p * self.n_samples.div_ceil(self.every)];
        Lines { sources, filled: 0, begun: 0, outputs }
    }

    #[inline(always)]
    fn tap(&self, k: usize, into: &mut [f64]) {
        for (value, tap) in into.iter_mut().zip(&self.sampled.taps) {
            let input = &self.inputs[tap.input * self.n_samples..(tap.input + 1) * self.n_samples];
            *value = sample(input, k, tap.ahead);
        }
    }

    /// Keep what outputs are made of, at samples that are asked for.
    #[inline(always)]
    fn keep(&self, k: usize, sources: &[f64], lines: &mut Lines) {
        if !k.is_multiple_of(self.every) {
            return;
        }
        for (line, value) in lines.sources.iter_mut().zip(sources) {
            line[lines.filled] = *value;
        }
        lines.filled += 1;
        if lines.filled == BLOCK {
            self.flush(lines);
        }
    }

    #[inline(always)]
    fn flush(&self, lines: &mut Lines) {
        let count = self.n_samples.div_ceil(self.every);
        let taps = &self.sampled.taps;
        for row in 0..self.p {
            let mut sums = [0.0; BLOCK];
            let states = self.c[row * self.n..(row + 1) * self.n].iter().copied();
            let factors = states.chain(taps.iter().map(|tap| tap.output[row]));
            for (factor, line) in factors.zip(&lines.sources) {
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
