//! Quadratic forms of rows with later rows, summed over a record. (Python side:
//! uncertainty/fitted_directions.py)

use super::widest::widest;

/// Rows that are turned together: they and those behind them stay in the nearest cache.
const SPAN: usize = 192;
/// Running sums of a product, so that additions need not wait for one another.
const LANES: usize = 8;
/// Lags that one reading of the turned rows serves.
const TOGETHER: usize = 4;

/// Σ q(t)ᵀ M q(t + k) for the rows q, `width` numbers each, and lags k from zero on.
///
/// Numbers beyond whole rows, and a form of another size, count as none.
pub fn lags_of_form(columns: &[f64], width: usize, form: &[f64], n_lags: usize) -> Vec<f64> {
    let mut found = vec![0.0; n_lags];
    if width > 0 && form.len() == width * width {
        widest(
            #[inline(always)]
            || add_forms(columns, width, form, &mut found),
        );
    }
    found
}

#[inline(always)]
fn add_forms(columns: &[f64], width: usize, form: &[f64], found: &mut [f64]) {
    let columns = &columns[..columns.len() / width * width];
    let mut turned = vec![0.0; SPAN * width];
    for (place, rows) in columns.chunks(SPAN * width).enumerate() {
        let turned = &mut turned[..rows.len()];
        turned.fill(0.0);
        for (into, row) in turned.chunks_exact_mut(width).zip(rows.chunks_exact(width)) {
            for (&value, line) in row.iter().zip(form.chunks_exact(width)) {
                into.iter_mut().zip(line).for_each(|(sum, weight)| *sum += value * weight);
            }
        }
        let later = &columns[place * SPAN * width..];
        for (first, sums) in found.chunks_mut(TOGETHER).enumerate() {
            let behind = |lag: usize| later.get((first * TOGETHER + lag) * width..).unwrap_or(&[]);
            match sums {
                [a, b, c, d] if behind(TOGETHER - 1).len() >= turned.len() => {
                    let parts = [behind(0), behind(1), behind(2), behind(3)];
                    let [p, q, r, s] = products(turned, parts);
                    (*a, *b, *c, *d) = (*a + p, *b + q, *c + r, *d + s);
                }
                _ => {
                    for (lag, sum) in sums.iter_mut().enumerate() {
                        let part = behind(lag);
                        let count = part.len().min(turned.len());
                        *sum += products(&turned[..count], [part])[0];
                    }
                }
            }
        }
    }
}

/// Inner products of one row with the beginnings of others, at least as long.
#[inline(always)]
fn products<const K: usize>(x: &[f64], others: [&[f64]; K]) -> [f64; K] {
    let others = others.map(|other| &other[..x.len()]);
    let mut sums = [[0.0; LANES]; K];
    let (chunks, rest) = x.as_chunks::<LANES>();
    let mut chunked = others.map(|other| other.as_chunks::<LANES>().0.iter());
    for own in chunks {
        for (sum, other) in sums.iter_mut().zip(&mut chunked) {
            if let Some(other) = other.next() {
                sum.iter_mut().zip(own.iter().zip(other)).for_each(|(s, (a, b))| *s += a * b);
            }
        }
    }
    let mut found = sums.map(|sum| sum.iter().sum::<f64>());
    for (sum, other) in found.iter_mut().zip(others) {
        let tail = &other[chunks.len() * LANES..];
        *sum += rest.iter().zip(tail).map(|(a, b)| a * b).sum::<f64>();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;

    #[test]
    fn forms_are_the_sums_that_they_say() {
        let mut source = Random::new(3);
        for (n, width) in [(1, 1), (5, 3), (191, 2), (192, 3), (401, 5)] {
            let rows: Vec<f64> = (0..n * width).map(|_| source.normal()).collect();
            let form: Vec<f64> = (0..width * width).map(|_| source.normal()).collect();
            let found = lags_of_form(&rows, width, &form, 11);
            for (lag, value) in found.iter().enumerate() {
                let mut wanted = 0.0;
                for t in 0..n.saturating_sub(lag) {
                    for i in 0..width {
                        for j in 0..width {
                            let later = rows[(t + lag) * width + j];
                            wanted += rows[t * width + i] * form[i * width + j] * later;
                        }
                    }
                }
                assert!((value - wanted).abs() < 1e-10, "{n} {width} {lag}: {value} {wanted}");
            }
        }
        assert_eq!(lags_of_form(&[1.0], 2, &[1.0], 2), [0.0, 0.0]);
    }
}
