//! Products of a predictor's slopes with each other and with its errors, block by block: a search
//! needs no more of them, and of a long record they do not fit into memory. (Python side:
//! identification/subspace/prediction_errors.py)

use crate::error::CoreError;
use crate::linear::block_recursion::{Acting, BLOCK, Line, carry};
use crate::linear::column_products::ColumnProducts;
use crate::linear::slope_recursion::{Slopes, gather, take};
use crate::numerics::widest::widest;

/// Unknowns that are run side by side.
const LANES: usize = 4;

/// A predictor on a record: x⁺ = A x + F s and e = G s − C x, of signals s.
#[derive(Debug, Clone, Copy)]
pub struct Predictor<'a> {
    /// n × n, row-major.
    pub transition: &'a [f64],
    /// p × n.
    pub output: &'a [f64],
    /// n × q: what the signals push.
    pub forced: &'a [f64],
    /// p × q: what they show at once.
    pub direct: &'a [f64],
    /// State at the first sample.
    pub start: &'a [f64],
    /// n, p, q.
    pub sizes: [usize; 3],
}

/// Rows that slopes meet: p × `kept` each, of the first samples.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// Row after row, output after output.
    pub values: &'a [f64],
    /// Samples of a row, at most all.
    pub kept: usize,
}

/// Products of all columns with all, the upper half row-major and filled to the whole: slopes by every
/// unknown, the errors, then `rows`. The slopes are those of `slopes`, driven by the predictor's states,
/// its errors and its first `n_inputs` signals; `errors` (p × n_samples) are what is left of the errors,
/// in the unit of the slopes.
///
/// # Errors
/// `Shape` where lengths do not fit.
pub fn products(
    of: Predictor<'_>,
    by: Slopes<'_>,
    signals: &[f64],
    errors: &[f64],
    rows: Rows<'_>,
) -> Result<Vec<f64>, CoreError> {
    let [n, p, q] = of.sizes;
    let (n_samples, n_inputs) = (errors.len() / p.max(1), by.sizes[2].saturating_sub(n + p));
    check(of, by, signals, errors, rows)?;
    let n_rows = rows.values.len() / (p * rows.kept).max(1);
    let mut pass = Pass::new(of, by, by.count + 1 + n_rows);
    let mut sources = Vec::with_capacity(q);
    for first in (0..n_samples).step_by(BLOCK) {
        gather(&mut sources, signals, n_samples, first);
        widest(
            #[inline(always)]
            || {
                pass.advance(&sources, n_inputs);
                for row in 0..p {
                    pass.show(row, BLOCK.min(n_samples - first));
                    pass.sums.take(by.count, &errors[row * n_samples..][..n_samples], first);
                    let n_seen = if first < rows.kept { n_rows } else { 0 };
                    for at in 0..n_seen {
                        let row = &rows.values[(at * p + row) * rows.kept..][..rows.kept];
                        pass.sums.take(by.count + 1 + at, row, first);
                    }
                    pass.sums.add_first(by.count + 1 + n_seen);
                }
            },
        );
    }
    Ok(pass.sums.filled())
}

fn check(
    of: Predictor<'_>,
    by: Slopes<'_>,
    signals: &[f64],
    errors: &[f64],
    rows: Rows<'_>,
) -> Result<(), CoreError> {
    let [n, p, q] = of.sizes;
    let n_samples = errors.len() / p.max(1);
    for (what, found, needed) in [
        ("transition matrix", of.transition.len(), n * n),
        ("output matrix", of.output.len(), p * n),
        ("forces", of.forced.len(), n * q),
        ("direct parts", of.direct.len(), p * q),
        ("the first state", of.start.len(), n),
        ("signals", signals.len(), q * n_samples),
        ("errors", errors.len(), p * n_samples),
        ("states of slopes", by.sizes[0], n),
        ("outputs of slopes", by.sizes[1], p),
        ("signals of slopes", by.sizes[2], by.sizes[2].clamp(n + p, n + p + q)),
        ("samples of rows", rows.kept, rows.kept.min(n_samples)),
        ("rows", rows.values.len() % (p * rows.kept).max(1), 0),
    ] {
        if found != needed {
            return Err(CoreError::Shape { what, found, needed });
        }
    }
    by.check_matrices()
}

/// A pass over the blocks of a record.
struct Pass<'a> {
    of: Predictor<'a>,
    by: Slopes<'a>,
    /// What acts on states and errors of the predictor, and of the slopes.
    own: [Vec<Acting<1>>; 2],
    slopes: [Vec<Acting<LANES>>; 2],
    state: Vec<[f64; 1]>,
    states: Vec<[f64; LANES]>,
    /// States, errors and inputs of a block, and states of the slopes.
    lines: Vec<Line<1>>,
    moved: Vec<Line<LANES>>,
    sums: ColumnProducts,
}

impl<'a> Pass<'a> {
    fn new(of: Predictor<'a>, by: Slopes<'a>, count: usize) -> Self {
        let ([n, p, q], n_groups) = (of.sizes, by.count.div_ceil(LANES));
        let acting = |matrix: &[f64]| -> Vec<Acting<1>> {
            let rows = matrix.chunks_exact(q.max(1));
            rows.map(|row| Acting::of(row.iter().map(|&weight| [weight]).enumerate())).collect()
        };
        let (forced, direct) = by.by_group::<LANES>();
        Self {
            own: [acting(of.forced), acting(of.direct)],
            slopes: [forced, direct],
            state: of.start.iter().map(|&value| [value]).collect(),
            states: vec![[0.0; LANES]; n_groups * n],
            lines: vec![[[0.0]; BLOCK]; n + p + q],
            moved: vec![[[0.0; LANES]; BLOCK]; n_groups * n],
            sums: ColumnProducts::new(count),
            of,
            by,
        }
    }

    /// States and errors of the predictor through a block, and the states of the slopes.
    #[inline(always)]
    fn advance(&mut self, sources: &[Line<1>], n_inputs: usize) {
        let [n, p, _] = self.of.sizes;
        let (states, others) = self.lines.split_at_mut(n);
        for (line, acting) in states.iter_mut().zip(&self.own[0]) {
            *line = [[0.0]; BLOCK];
            acting.drive(line, sources, 0);
        }
        carry(self.of.transition, &mut self.state, states);
        let (errors, inputs) = others.split_at_mut(p);
        for (row, (error, acting)) in errors.iter_mut().zip(&self.own[1]).enumerate() {
            *error = [[0.0]; BLOCK];
            acting.drive(error, sources, 0);
            for (factor, line) in self.of.output[row * n..].iter().zip(&*states) {
                take(error, *factor, line);
            }
        }
        inputs.iter_mut().zip(&sources[..n_inputs]).for_each(|(line, source)| *line = *source);
        for (line, acting) in self.moved.iter_mut().zip(&self.slopes[0]) {
            *line = [[0.0; LANES]; BLOCK];
            acting.drive(line, &self.lines, 0);
        }
        carry(self.by.transition, &mut self.states, &mut self.moved);
    }

    /// Columns of the slopes of one output; zeros after so many samples.
    #[inline(always)]
    fn show(&mut self, row: usize, count: usize) {
        let [n, p, _] = self.by.sizes;
        let factors = &self.by.output[row * n..(row + 1) * n];
        for group in 0..self.by.count.div_ceil(LANES) {
            let mut shown = [[0.0; LANES]; BLOCK];
            self.slopes[1][group * p + row].drive(&mut shown, &self.lines, 0);
            for (factor, line) in factors.iter().zip(&self.moved[group * n..]) {
                take(&mut shown, *factor, line);
            }
            for unknown in group * LANES..self.by.count.min((group + 1) * LANES) {
                let column = self.sums.column(unknown);
                for k in 0..BLOCK {
                    column[k] = shown[k][unknown % LANES];
                }
                column[count..].fill(0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::slope_recursion::slopes;

    fn sines(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|k| (seed + 1.7 * k as f64).sin() / 3.0).collect()
    }

    #[test]
    fn products_are_those_of_the_slopes_themselves() {
        for (n, p, m, count, n_samples, kept) in [
            (2, 1, 1, 5, 150, 70),
            (3, 2, 2, 6, 130, 130),
            (1, 1, 1, 1, 20, 5),
            (2, 2, 1, 4, 64, 0),
        ] {
            let q = m + p;
            let a: Vec<f64> = sines(n * n, 0.1).iter().map(|each| each / n as f64).collect();
            let (c, f, d) = (sines(p * n, 0.5), sines(n * q, 1.0), sines(p * q, 1.5));
            let (start, signals) = (sines(n, 2.0), sines(q * n_samples, 3.0));
            let (by, shown) = (sines(count * n * (n + p + m), 4.0), sines(p * n, 4.5));
            let direct = sines(count * p * (n + p + m), 5.0);
            let sizes = [n, p, q];
            let of = Predictor {
                transition: &a,
                output: &c,
                forced: &f,
                direct: &d,
                start: &start,
                sizes,
            };
            let slope = Slopes {
                transition: &a,
                output: &shown,
                forced: &by,
                direct: &direct,
                sizes: [n, p, n + p + m],
                count,
            };
            let errors = sines(p * n_samples, 6.0);
            let values = sines(2 * p * kept, 7.0);
            let rows = Rows { values: &values, kept };
            let found = products(of, slope, &signals, &errors, rows).unwrap();

            // States, errors and inputs sample by sample drive the slopes.
            let mut drive = vec![0.0; (n + p + m) * n_samples];
            let mut x = start.clone();
            for k in 0..n_samples {
                let s = |j: usize| signals[j * n_samples + k];
                for i in 0..n {
                    drive[i * n_samples + k] = x[i];
                }
                for o in 0..p {
                    drive[(n + o) * n_samples + k] =
                        (0..q).map(|j| d[o * q + j] * s(j)).sum::<f64>()
                            - (0..n).map(|i| c[o * n + i] * x[i]).sum::<f64>();
                }
                for j in 0..m {
                    drive[(n + p + j) * n_samples + k] = s(j);
                }
                x = (0..n)
                    .map(|i| {
                        (0..n).map(|j| a[i * n + j] * x[j]).sum::<f64>()
                            + (0..q).map(|j| f[i * q + j] * s(j)).sum::<f64>()
                    })
                    .collect();
            }
            let whole = slopes(slope, &drive, n_samples).unwrap();
            let n_rows = if kept == 0 { 0 } else { 2 };
            let column = |at: usize, o: usize, k: usize| match at {
                at if at < count => whole[(k * p + o) * count + at],
                at if at == count => errors[o * n_samples + k],
                at if k < kept => values[((at - count - 1) * p + o) * kept + k],
                _ => 0.0,
            };
            let width = count + 1 + n_rows;
            assert_eq!(found.len(), width * width);
            for (i, j) in (0..width).flat_map(|i| (0..width).map(move |j| (i, j))) {
                let places = (0..p).flat_map(|o| (0..n_samples).map(move |k| (o, k)));
                let wanted: f64 = places.map(|(o, k)| column(i, o, k) * column(j, o, k)).sum();
                assert!((found[i * width + j] - wanted).abs() < 1e-11, "{i} {j}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let matrix = [0.5];
        let of = Predictor {
            transition: &matrix,
            output: &matrix,
            forced: &[1.0, 1.0],
            direct: &[1.0, 1.0],
            start: &[0.0],
            sizes: [1, 1, 2],
        };
        let by = Slopes {
            transition: &matrix,
            output: &matrix,
            forced: &[1.0; 3],
            direct: &[1.0; 3],
            sizes: [1, 1, 3],
            count: 1,
        };
        let rows = Rows { values: &[], kept: 0 };
        assert!(products(of, by, &[1.0; 4], &[1.0; 2], rows).is_ok());
        for (of, by, signals) in [
            (Predictor { start: &[], ..of }, by, 4),
            (of, Slopes { sizes: [2, 1, 3], ..by }, 4),
            (of, Slopes { forced: &[], ..by }, 4),
            (of, by, 3),
        ] {
            let found = products(of, by, &vec![1.0; signals], &[1.0; 2], rows);
            assert!(matches!(found, Err(CoreError::Shape { .. })));
        }
        let rows = Rows { values: &[1.0; 3], kept: 3 };
        assert!(products(of, by, &[1.0; 4], &[1.0; 2], rows).is_err());
    }
}
