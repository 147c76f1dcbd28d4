//! Rows of samples with other rows at many lags: their products, and what weighted pasts leave.
//! (Python side: uncertainty/lagged_products.py)

use super::lagged_forms::products;
use super::widest::widest;

/// Samples that all lags meet together: they stay in the nearest cache.
const SPAN: usize = 1024;
/// Lags that one reading of a sample serves.
const TOGETHER: usize = 4;

/// Σ a(t) b(t − k) for the rows a of `now` (n samples each), the rows b of `past`, which begin
/// `longest` samples earlier, and lags k from zero to `longest`: by lag, then b, then a.
pub fn lagged_products(now: &[f64], past: &[f64], n: usize, longest: usize) -> Vec<f64> {
    let count = |rows: &[f64], length: usize| if n == 0 { 0 } else { rows.len() / length };
    let (p, q) = (count(now, n), count(past, n + longest));
    let mut found = vec![0.0; (longest + 1) * q * p];
    if p > 0 && q > 0 {
        widest(
            #[inline(always)]
            || add_products(now, past, (n, longest), (p, q), &mut found),
        );
    }
    found
}

#[inline(always)]
fn add_products(
    now: &[f64],
    past: &[f64],
    (n, longest): (usize, usize),
    (p, q): (usize, usize),
    found: &mut [f64],
) {
    for first in (0..n).step_by(SPAN) {
        let count = SPAN.min(n - first);
        for (b, past) in past.chunks_exact(n + longest).enumerate() {
            let behind = |lag: usize| &past[first + longest - lag..][..count];
            for (a, now) in now.chunks_exact(n).enumerate() {
                let own = &now[first..first + count];
                let mut lag = 0;
                while lag + TOGETHER <= longest + 1 {
                    let parts = [behind(lag), behind(lag + 1), behind(lag + 2), behind(lag + 3)];
                    for (next, sum) in products(own, parts).into_iter().enumerate() {
                        found[((lag + next) * q + b) * p + a] += sum;
                    }
                    lag += TOGETHER;
                }
                for lag in lag..=longest {
                    found[(lag * q + b) * p + a] += products(own, [behind(lag)])[0];
                }
            }
        }
    }
}

/// Rows less their weighted neighbours in others: a(t) − Σ w(a, k, b) b(t + k), for the rows a of
/// `rows` (n samples each) and the rows b of `past`, n + m − 1 samples each; `weights` are by a, then
/// k from zero to m − 1, then b.
pub fn left_of_neighbours(
    rows: &[f64],
    past: &[f64],
    weights: &[f64],
    n: usize,
    m: usize,
) -> Vec<f64> {
    let mut left = rows.to_vec();
    if n > 0 && m > 0 && !past.is_empty() {
        let width = m * (past.len() / (n + m - 1));
        widest(
            #[inline(always)]
            || take_neighbours(&mut left, past, weights, (n, m, width)),
        );
    }
    left
}

#[inline(always)]
fn take_neighbours(
    left: &mut [f64],
    past: &[f64],
    weights: &[f64],
    (n, m, width): (usize, usize, usize),
) {
    let q = width / m;
    for (left, weights) in left.chunks_exact_mut(n).zip(weights.chunks_exact(width.max(1))) {
        for (place, into) in left.chunks_mut(SPAN).enumerate() {
            let count = into.len();
            for (b, past) in past.chunks_exact(n + m - 1).enumerate() {
                let near = |k: usize| &past[place * SPAN + k..][..count];
                let mut k = 0;
                while k + TOGETHER <= m {
                    let [r, s, t, u] = [0, 1, 2, 3].map(|next| weights[(k + next) * q + b]);
                    let later = near(k + 2).iter().zip(near(k + 3));
                    let four = near(k).iter().zip(near(k + 1)).zip(later);
                    for (value, ((a, b), (c, d))) in into.iter_mut().zip(four) {
                        *value -= (r * a + s * b) + (t * c + u * d);
                    }
                    k += TOGETHER;
                }
                for k in k..m {
                    let weight = weights[k * q + b];
                    into.iter_mut().zip(near(k)).for_each(|(value, a)| *value -= weight * a);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;

    #[test]
    fn lags_meet_the_samples_that_they_say() {
        let mut source = Random::new(5);
        for (n, longest, p, q) in [(1, 0, 1, 1), (7, 3, 2, 1), (1500, 9, 1, 3), (2049, 6, 2, 2)] {
            let mut drawn = |count: usize| (0..count).map(|_| source.normal()).collect::<Vec<_>>();
            let (now, past) = (drawn(p * n), drawn(q * (n + longest)));
            let weights = drawn(p * q * (longest + 1));
            let found = lagged_products(&now, &past, n, longest);
            let left = left_of_neighbours(&now, &past, &weights, n, longest + 1);
            let past = |b: usize, at: usize| past[b * (n + longest) + at];
            for lag in 0..=longest {
                for (a, b) in (0..p).flat_map(|a| (0..q).map(move |b| (a, b))) {
                    let wanted: f64 =
                        (0..n).map(|t| now[a * n + t] * past(b, t + longest - lag)).sum();
                    let each = found[(lag * q + b) * p + a];
                    assert!((each - wanted).abs() < 1e-10, "{n} {lag}: {each} {wanted}");
                }
            }
            for (a, t) in (0..p).flat_map(|a| (0..n).map(move |t| (a, t))) {
                let weight = |k: usize, b: usize| weights[(a * (longest + 1) + k) * q + b];
                let taken = |k: usize| (0..q).map(|b| weight(k, b) * past(b, t + k)).sum::<f64>();
                let wanted = now[a * n + t] - (0..=longest).map(taken).sum::<f64>();
                assert!((left[a * n + t] - wanted).abs() < 1e-12, "{n} {t}");
            }
        }
        assert_eq!(left_of_neighbours(&[1.0], &[], &[], 1, 1), [1.0]);
        assert!(lagged_products(&[], &[], 0, 2).is_empty());
    }
}
