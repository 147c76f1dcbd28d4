//! Products of rows with later rows of another series, summed over a record. (Python side:
//! uncertainty/fitted_directions.py)

use super::widest::widest;

/// Numbers of rows that all lags meet together: they and those behind them stay in the nearest cache.
const SPAN: usize = 1536;
/// Running sums of a product, so that additions need not wait for one another.
const LANES: usize = 8;
/// Lags that one reading of the earlier rows serves.
const TOGETHER: usize = 4;

/// Σ p(t)ᵀ q(t + k) for the rows p of `earlier` and q of `later`, `width` numbers each, and lags k
/// from zero on.
///
/// Numbers beyond whole rows count as none; `later` may go on where `earlier` ends.
pub fn lagged_sums(earlier: &[f64], later: &[f64], width: usize, n_lags: usize) -> Vec<f64> {
    let mut found = vec![0.0; n_lags];
    if width > 0 {
        let [earlier, later] = [earlier, later].map(|rows| &rows[..rows.len() / width * width]);
        widest(
            #[inline(always)]
            || add_sums(earlier, later, width, &mut found),
        );
    }
    found
}

#[inline(always)]
fn add_sums(earlier: &[f64], later: &[f64], width: usize, found: &mut [f64]) {
    let span = SPAN.div_ceil(width) * width;
    for (place, rows) in earlier.chunks(span).enumerate() {
        let later = later.get(place * span..).unwrap_or(&[]);
        for (first, sums) in found.chunks_mut(TOGETHER).enumerate() {
            let behind = |lag: usize| later.get((first * TOGETHER + lag) * width..).unwrap_or(&[]);
            match sums {
                [a, b, c, d] if behind(TOGETHER - 1).len() >= rows.len() => {
                    let parts = [behind(0), behind(1), behind(2), behind(3)];
                    let [p, q, r, s] = products(rows, parts);
                    (*a, *b, *c, *d) = (*a + p, *b + q, *c + r, *d + s);
                }
                _ => {
                    for (lag, sum) in sums.iter_mut().enumerate() {
                        let part = behind(lag);
                        let count = part.len().min(rows.len());
                        *sum += products(&rows[..count], [part])[0];
                    }
                }
            }
        }
    }
}

/// Inner products of one row with the beginnings of others, at least as long.
#[inline(always)]
pub(crate) fn products<const K: usize>(x: &[f64], others: [&[f64]; K]) -> [f64; K] {
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
    fn sums_are_those_that_they_say() {
        let mut source = Random::new(3);
        for (n, width) in [(1, 1), (5, 3), (191, 2), (768, 2), (769, 3), (1601, 5)] {
            let mut drawn = || (0..n * width).map(|_| source.normal()).collect::<Vec<f64>>();
            let (earlier, later) = (drawn(), drawn());
            let found = lagged_sums(&earlier, &later, width, 11);
            for (lag, value) in found.iter().enumerate() {
                let behind = later.iter().skip(lag * width);
                let wanted: f64 = earlier.iter().zip(behind).map(|(a, b)| a * b).sum();
                assert!((value - wanted).abs() < 1e-10, "{n} {width} {lag}: {value} {wanted}");
            }
        }
        // The number beyond whole rows meets nothing.
        assert_eq!(lagged_sums(&[1.0, 2.0, 9.0], &[1.0, 2.0, 9.0], 2, 2), [5.0, 0.0]);
        assert_eq!(lagged_sums(&[1.0], &[1.0], 0, 1), [0.0]);
        // Either may be the longer.
        let (short, long) = ([1.0, 2.0], [1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(lagged_sums(&short, &long, 1, 3), [21.0, 210.0, 2100.0]);
        assert_eq!(lagged_sums(&long, &short, 1, 3), [21.0, 2.0, 0.0]);
    }
}
