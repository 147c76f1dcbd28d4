//! Products of what input matrices and own numbers of a record add to a predictor's errors, block by
//! block, by the transposed recursion. (Python side: identification/subspace/predictor_columns.py)

use crate::error::CoreError;
use crate::linear::block_recursion::{BLOCK, Line, carry};
use crate::linear::column_products::ColumnProducts;
use crate::linear::slope_recursion::take;
use crate::numerics::widest::widest;

/// Signals that are run side by side.
const LANES: usize = 4;

/// A predictor x⁺ = Ā x + K y, e = y − C x, and what of it is free.
#[derive(Debug, Clone, Copy)]
pub struct InputColumns<'a> {
    /// Āᵀ, n × n, row-major.
    pub turned: &'a [f64],
    /// C, p × n.
    pub output: &'a [f64],
    /// K, n × p.
    pub gain: &'a [f64],
    /// n, p, m.
    pub sizes: [usize; 3],
    /// Whether the inputs of the same sample act.
    pub direct: bool,
    /// Whether each output has a level.
    pub levels: bool,
    /// Samples after which nothing is left of a first state.
    pub lasting: usize,
}

impl InputColumns<'_> {
    /// Signals: inputs, one for levels, outputs, and nothing, which only a first state moves.
    fn n_signals(&self) -> usize {
        self.sizes[2] + usize::from(self.levels) + self.sizes[1] + 1
    }

    /// Columns: entries of B, those of D, first states, levels, and the errors without these.
    fn n_columns(&self) -> usize {
        let [n, p, m] = self.sizes;
        n * m + p * m * usize::from(self.direct) + n + p * usize::from(self.levels) + 1
    }

    fn check(&self, outputs: &[f64], inputs: &[f64], n_samples: usize) -> Result<(), CoreError> {
        let [n, p, m] = self.sizes;
        for (what, found, needed) in [
            ("transition matrix", self.turned.len(), n * n),
            ("output matrix", self.output.len(), p * n),
            ("gain", self.gain.len(), n * p),
            ("outputs", outputs.len(), p * n_samples),
            ("inputs", inputs.len(), m * n_samples),
        ] {
            if found != needed {
                return Err(CoreError::Shape { what, found, needed });
            }
        }
        Ok(())
    }

    /// Products of all columns with all over a record of `outputs` (p × n_samples) and `inputs` (m ×
    /// n_samples).
    ///
    /// # Errors
    /// `Shape` where lengths do not fit, `NotFinite` where the predictor runs away.
    pub fn products(
        &self,
        outputs: &[f64],
        inputs: &[f64],
        n_samples: usize,
    ) -> Result<Vec<f64>, CoreError> {
        self.check(outputs, inputs, n_samples)?;
        let ([n, p, _], n_signals) = (self.sizes, self.n_signals());
        let n_groups = n_signals.div_ceil(LANES);
        let mut runs = vec![vec![[0.0; LANES]; n_groups * n]; p];
        for (states, row) in runs.iter_mut().zip(self.output.chunks_exact(n.max(1))) {
            let last = (n_groups - 1) * n;
            for (state, &value) in states[last..].iter_mut().zip(row) {
                state[(n_signals - 1) % LANES] = value;
            }
        }
        let mut lines = vec![[[0.0; LANES]; BLOCK]; n_groups * n];
        let mut packed = vec![[[0.0; LANES]; BLOCK]; n_groups];
        let mut sums = ColumnProducts::new(self.n_columns());
        for first in (0..n_samples).step_by(BLOCK) {
            let count = BLOCK.min(n_samples - first);
            self.pack(&mut packed, [outputs, inputs], (first, count), n_samples);
            for (row, states) in runs.iter_mut().enumerate() {
                if first >= self.lasting {
                    // Nothing to rounding is not left to become the smallest numbers there are.
                    let last = (n_groups - 1) * n;
                    states[last..].iter_mut().for_each(|s| s[(n_signals - 1) % LANES] = 0.0);
                }
                let factors = &self.output[row * n..(row + 1) * n];
                widest(
                    #[inline(always)]
                    || {
                        push(&mut lines, &packed, factors);
                        carry(self.turned, states, &mut lines);
                        self.show(row, &lines, &packed, (count, &mut sums));
                    },
                );
            }
        }
        let last = runs.iter().flatten().flatten();
        match last.clone().position(|value| !value.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "a predictor", index }),
            None => Ok(sums.filled()),
        }
    }

    /// A block of the signals, side by side; zeros after the last sample.
    fn pack(
        &self,
        packed: &mut [Line<LANES>],
        [outputs, inputs]: [&[f64]; 2],
        (first, count): (usize, usize),
        n_samples: usize,
    ) {
        let [_, p, m] = self.sizes;
        let levels = usize::from(self.levels);
        for line in packed.iter_mut() {
            *line = [[0.0; LANES]; BLOCK];
        }
        for signal in 0..m + levels + p {
            let (line, lane) = (&mut packed[signal / LANES], signal % LANES);
            let from = match signal {
                at if at < m => &inputs[at * n_samples + first..][..count],
                at if at < m + levels => {
                    line[..count].iter_mut().for_each(|values| values[lane] = 1.0);
                    continue;
                }
                at => &outputs[(at - m - levels) * n_samples + first..][..count],
            };
            line.iter_mut().zip(from).for_each(|(values, &value)| values[lane] = value);
        }
    }

    /// Columns of one output through a block, and their products.
    #[inline(always)]
    fn show(
        &self,
        row: usize,
        lines: &[Line<LANES>],
        packed: &[Line<LANES>],
        (count, sums): (usize, &mut ColumnProducts),
    ) {
        let ([n, p, m], levels) = (self.sizes, usize::from(self.levels));
        let answer = |signal: usize, state: usize| &lines[signal / LANES * n + state];
        let n_groups = packed.len();
        // What each output's gain makes of the answers, by output and group.
        let mut turned = vec![[[0.0; LANES]; BLOCK]; p * n_groups];
        for (at, into) in turned.iter_mut().enumerate() {
            let (output, group) = (at / n_groups, at % n_groups);
            for state in 0..n {
                take(into, -self.gain[state * p + output], &lines[group * n + state]);
            }
        }
        let turned = |signal: usize, output: usize| &turned[output * n_groups + signal / LANES];
        let mut at = 0;
        for state in 0..n {
            for input in 0..m {
                lane(answer(input, state), input, sums.column(at));
                at += 1;
            }
        }
        for (output, input) in (0..p).flat_map(|o| (0..m).map(move |i| (o, i))) {
            if self.direct {
                let column = sums.column(at);
                column.fill(0.0);
                if output == row {
                    lane(&packed[input / LANES], input, column);
                }
                less(turned(input, output), input, column);
                at += 1;
            }
        }
        let none = self.n_signals() - 1;
        for state in 0..n {
            lane(answer(none, state), none, sums.column(at));
            at += 1;
        }
        for output in 0..p * levels {
            let column = sums.column(at);
            column.fill(if output == row { 1.0 } else { 0.0 });
            less(turned(m, output), m, column);
            at += 1;
        }
        let (y, column) = (m + levels, sums.column(at));
        lane(&packed[(y + row) / LANES], y + row, column);
        for output in 0..p {
            less(turned(y + output, output), y + output, column);
        }
        (0..=at).for_each(|each| sums.column(each)[count..].fill(0.0));
        sums.add();
    }
}

/// One signal of a line.
#[inline(always)]
fn lane(line: &Line<LANES>, signal: usize, into: &mut [f64; BLOCK]) {
    for (value, values) in into.iter_mut().zip(line) {
        *value = values[signal % LANES];
    }
}

/// Less one signal of a line.
#[inline(always)]
fn less(line: &Line<LANES>, signal: usize, from: &mut [f64; BLOCK]) {
    for (value, values) in from.iter_mut().zip(line) {
        *value -= values[signal % LANES];
    }
}

/// Cᵀ s of each state and each group of signals.
#[inline(always)]
fn push(lines: &mut [Line<LANES>], packed: &[Line<LANES>], factors: &[f64]) {
    for (lines, signals) in lines.chunks_exact_mut(factors.len().max(1)).zip(packed) {
        for (line, factor) in lines.iter_mut().zip(factors) {
            for (into, values) in line.iter_mut().zip(signals) {
                *into = values.map(|value| factor * value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sines(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|k| (seed + 1.7 * k as f64).sin() / 3.0).collect()
    }

    /// Errors of the predictor with these free numbers, sample by sample, as the definition says.
    fn errors(
        of: &InputColumns<'_>,
        free: &[f64],
        y: &[f64],
        u: &[f64],
        n_samples: usize,
    ) -> Vec<f64> {
        let [n, p, m] = of.sizes;
        let (b, others) = free.split_at(n * m);
        let (d, others) = others.split_at(if of.direct { p * m } else { 0 });
        let (start, levels) = others.split_at(n);
        let level = |o: usize| levels.get(o).copied().unwrap_or(0.0);
        let (mut x, mut found) = (start.to_vec(), Vec::new());
        for k in 0..n_samples {
            let fed = |o: usize| -> f64 {
                let direct: f64 =
                    (0..m).map(|i| d.get(o * m + i).unwrap_or(&0.0) * u[i * n_samples + k]).sum();
                y[o * n_samples + k] - direct - level(o)
            };
            found.extend(
                (0..p).map(|o| fed(o) - (0..n).map(|i| of.output[o * n + i] * x[i]).sum::<f64>()),
            );
            x = (0..n)
                .map(|i| {
                    (0..n).map(|j| of.turned[j * n + i] * x[j]).sum::<f64>()
                        + (0..m).map(|j| b[i * m + j] * u[j * n_samples + k]).sum::<f64>()
                        + (0..p).map(|o| of.gain[i * p + o] * fed(o)).sum::<f64>()
                })
                .collect();
        }
        found
    }

    #[test]
    fn products_are_those_of_the_errors_slopes() {
        for (n, p, m, direct, levels, n_samples) in [
            (2, 1, 1, true, false, 150),
            (3, 2, 2, true, true, 130),
            (2, 2, 1, false, true, 64),
            (1, 1, 3, false, false, 40),
        ] {
            let turned: Vec<f64> = sines(n * n, 0.1).iter().map(|each| each / n as f64).collect();
            let (output, gain) = (sines(p * n, 0.5), sines(n * p, 0.9));
            let (y, u) = (sines(p * n_samples, 2.0), sines(m * n_samples, 3.0));
            let (turned, output, gain) = (&turned[..], &output[..], &gain[..]);
            let sizes = [n, p, m];
            let of =
                InputColumns { turned, output, gain, sizes, direct, levels, lasting: n_samples };
            let found = of.products(&y, &u, n_samples).unwrap();
            let count = of.n_columns();
            let plain = errors(&of, &vec![0.0; count - 1], &y, &u, n_samples);
            let mut columns: Vec<Vec<f64>> = (0..count - 1)
                .map(|free| {
                    let mut one = vec![0.0; count - 1];
                    one[free] = 1.0;
                    let moved = errors(&of, &one, &y, &u, n_samples);
                    plain.iter().zip(moved).map(|(a, b)| a - b).collect()
                })
                .collect();
            columns.push(plain);
            for (i, a) in columns.iter().enumerate() {
                for (j, b) in columns.iter().enumerate() {
                    let wanted: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                    assert!((found[i * count + j] - wanted).abs() < 1e-11, "{i} {j}");
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_or_runs_away_is_refused() {
        let of = InputColumns {
            turned: &[1e200],
            output: &[1.0],
            gain: &[1.0],
            sizes: [1, 1, 1],
            direct: false,
            levels: false,
            lasting: 100,
        };
        let found = of.products(&[1.0; 100], &[1.0; 100], 100);
        assert!(matches!(found, Err(CoreError::NotFinite { .. })));
        assert!(matches!(of.products(&[1.0; 3], &[1.0; 2], 2), Err(CoreError::Shape { .. })));
    }
}
