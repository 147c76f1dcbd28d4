//! Derivatives of what a linear recursion shows, by many unknowns at once: every predictor's
//! slopes share its transition, and their forces are its own signals. (Python side:
//! identification/filter_error/innovations.py, identification/subspace/prediction_errors.py)

use crate::error::CoreError;
use crate::linear::block_recursion::{Acting, BLOCK, Line, carry};
use crate::numerics::widest::widest;

const LANES: usize = 4;

/// A predictor and how the unknowns move it.
#[derive(Debug, Clone, Copy)]
pub struct Slopes<'a> {
    /// n × n, row-major.
    pub transition: &'a [f64],
    /// p × n, row-major.
    pub output: &'a [f64],
    /// Of each unknown, n × q: what the signals push.
    pub forced: &'a [f64],
    /// Of each unknown, p × q: what the signals show at once.
    pub direct: &'a [f64],
    /// n, p, q.
    pub sizes: [usize; 3],
    /// Of unknowns.
    pub count: usize,
}

impl Slopes<'_> {
    fn check(&self, signals: &[f64], n_samples: usize) -> Result<(), CoreError> {
        let (found, needed) = (signals.len(), self.sizes[2] * n_samples);
        if found != needed {
            return Err(CoreError::Shape { what: "signals", found, needed });
        }
        self.check_matrices()
    }

    /// Whether every matrix has its size.
    pub(crate) fn check_matrices(&self) -> Result<(), CoreError> {
        let [n, p, q] = self.sizes;
        for (what, found, needed) in [
            ("transition matrix", self.transition.len(), n * n),
            ("output matrix", self.output.len(), p * n),
            ("forces", self.forced.len(), self.count * n * q),
            ("direct parts", self.direct.len(), self.count * p * q),
        ] {
            if found != needed {
                return Err(CoreError::Shape { what, found, needed });
            }
        }
        Ok(())
    }

    /// Of each group of unknowns, what acts on their states, and on what they show.
    pub(crate) fn by_group<const L: usize>(&self) -> (Vec<Acting<L>>, Vec<Acting<L>>) {
        let (unknowns, [n, p, _]): (Vec<usize>, _) = ((0..self.count).collect(), self.sizes);
        let all = |matrix: &[f64], rows: usize| {
            unknowns.chunks(L).flat_map(|group| self.acting(matrix, rows, group)).collect()
        };
        (all(self.forced, n), all(self.direct, p))
    }

    /// Of one group of unknowns, the signals that act on each of so many rows.
    fn acting<const L: usize>(
        &self,
        matrix: &[f64],
        rows: usize,
        group: &[usize],
    ) -> Vec<Acting<L>> {
        let q = self.sizes[2];
        let weight = |lane: usize, row: usize, signal: usize| {
            group.get(lane).map_or(0.0, |unknown| matrix[(unknown * rows + row) * q + signal])
        };
        (0..rows)
            .map(|row| {
                Acting::of(
                    (0..q).map(|signal| (signal, std::array::from_fn(|l| weight(l, row, signal)))),
                )
            })
            .collect()
    }
}

/// Slopes of G s − C x by every unknown, n_samples × p × count, from rest: δx⁺ = A δx + F s and
/// δe = G s − C δx for each. `signals` are q × n_samples.
///
/// # Errors
/// `Shape` where lengths do not fit, `NotFinite` where a slope runs away.
pub fn slopes(of: Slopes<'_>, signals: &[f64], n_samples: usize) -> Result<Vec<f64>, CoreError> {
    let (states, found) = run(of, signals, n_samples)?;
    match states.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "slopes of a linear recursion", index }),
        None => Ok(found),
    }
}

/// As `slopes`, of those that run away as far as they are finite.
///
/// # Errors
/// `Shape` where lengths do not fit.
pub fn slopes_anyhow(
    of: Slopes<'_>,
    signals: &[f64],
    n_samples: usize,
) -> Result<Vec<f64>, CoreError> {
    Ok(run(of, signals, n_samples)?.1)
}

/// States after the last block, and the slopes.
fn run(
    of: Slopes<'_>,
    signals: &[f64],
    n_samples: usize,
) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
    of.check(signals, n_samples)?;
    // One run alone, as errors of a predictor are, leaves no lanes empty.
    Ok(match of.count {
        1 => through::<1>(of, signals, n_samples),
        _ => through::<LANES>(of, signals, n_samples),
    })
}

fn through<const L: usize>(
    of: Slopes<'_>,
    signals: &[f64],
    n_samples: usize,
) -> (Vec<f64>, Vec<f64>) {
    let [n, p, _] = of.sizes;
    let (forced, direct) = of.by_group::<L>();
    let n_groups = of.count.div_ceil(L);
    let mut found = vec![0.0; n_samples * p * of.count];
    let mut states = vec![[0.0; L]; n_groups * n];
    let (mut sources, mut lines) = (Vec::new(), vec![[[0.0; L]; BLOCK]; n_groups * n]);
    for (block, into) in found.chunks_mut((BLOCK * p * of.count).max(1)).enumerate() {
        gather(&mut sources, signals, n_samples, block * BLOCK);
        widest(
            #[inline(always)]
            || {
                for (line, acting) in lines.iter_mut().zip(&forced) {
                    *line = [[0.0; L]; BLOCK];
                    acting.drive(line, &sources, 0);
                }
                carry(of.transition, &mut states, &mut lines);
                for (at, acting) in direct.iter().enumerate() {
                    let (group, row) = (at / p, at % p);
                    let mut shown = [[0.0; L]; BLOCK];
                    acting.drive(&mut shown, &sources, 0);
                    let factors = &of.output[row * n..(row + 1) * n];
                    for (factor, line) in factors.iter().zip(&lines[group * n..]) {
                        take(&mut shown, *factor, line);
                    }
                    put(into, &shown, (row * of.count + group * L, of.count), p);
                }
            },
        );
    }
    (states.into_flattened(), found)
}

/// One block of each signal; zeros after the last sample.
pub(crate) fn gather(sources: &mut Vec<Line<1>>, signals: &[f64], n_samples: usize, first: usize) {
    sources.clear();
    sources.extend(
        signals
            .chunks_exact(n_samples.max(1))
            .map(|signal| std::array::from_fn(|k| [signal.get(first + k).copied().unwrap_or(0.0)])),
    );
}

/// Less a factor times another line.
#[inline(always)]
pub(crate) fn take<const L: usize>(from: &mut Line<L>, factor: f64, line: &Line<L>) {
    for (sums, values) in from.iter_mut().zip(line) {
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum -= factor * value;
        }
    }
}

/// What a group shows of one row goes to its place, `count` unknowns a row, p rows a sample.
#[inline(always)]
fn put<const L: usize>(
    into: &mut [f64],
    shown: &Line<L>,
    (first, count): (usize, usize),
    p: usize,
) {
    let lanes = L.min(count - first % count);
    for (sample, values) in into.chunks_exact_mut(p * count).zip(shown) {
        sample[first..first + lanes].copy_from_slice(&values[..lanes]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sines(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|k| (seed + 1.7 * k as f64).sin() / 3.0).collect()
    }

    #[test]
    fn slopes_are_those_of_samples_one_by_one() {
        for (n, p, q, count, n_samples) in
            [(2, 1, 3, 5, 150), (3, 2, 4, 4, 64), (7, 2, 2, 9, 65), (1, 1, 1, 1, 1)]
        {
            let (a, c) = (sines(n * n, 0.1), sines(p * n, 0.5));
            let a: Vec<f64> = a.iter().map(|each| each / n as f64).collect();
            let (f, g) = (sines(count * n * q, 1.0), sines(count * p * q, 2.0));
            let signals = sines(q * n_samples, 3.0);
            let of = Slopes {
                transition: &a,
                output: &c,
                forced: &f,
                direct: &g,
                sizes: [n, p, q],
                count,
            };
            let found = slopes(of, &signals, n_samples).unwrap();
            for unknown in 0..count {
                let mut x = vec![0.0; n];
                for k in 0..n_samples {
                    let by = |matrix: &[f64], rows: usize, row: usize| -> f64 {
                        (0..q)
                            .map(|s| {
                                matrix[(unknown * rows + row) * q + s] * signals[s * n_samples + k]
                            })
                            .sum()
                    };
                    let row = |matrix: &[f64], i: usize| -> f64 {
                        (0..n).map(|j| matrix[i * n + j] * x[j]).sum()
                    };
                    for o in 0..p {
                        let wanted = by(&g, p, o) - row(&c, o);
                        assert!((found[(k * p + o) * count + unknown] - wanted).abs() < 1e-13);
                    }
                    x = (0..n).map(|i| row(&a, i) + by(&f, n, i)).collect();
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_or_runs_away_is_refused() {
        let grown = Slopes {
            transition: &[1e200],
            output: &[1.0],
            forced: &[1.0],
            direct: &[0.0],
            sizes: [1, 1, 1],
            count: 1,
        };
        let found = slopes(grown, &[1.0; 100], 100);
        assert!(matches!(found, Err(CoreError::NotFinite { .. })));
        assert!(matches!(slopes(grown, &[1.0; 3], 2), Err(CoreError::Shape { .. })));
    }
}
