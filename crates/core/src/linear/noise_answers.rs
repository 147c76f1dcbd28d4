//! Outputs that past outputs alone move on, after a first sample of noise.
//! (Python side: uncertainty/feedback_power.py)

use crate::numerics::lagged_forms::products;
use crate::numerics::widest::widest;

/// Answers of `n` outputs to `n` noises over `count` samples: by sample, output, noise.
///
/// `weights` (n × order n) are by output, then lag from one on, then past output; `start` (n × n) is the
/// first sample by output and noise. What passes `largest` stops there.
pub fn noise_answers(
    weights: &[f64],
    start: &[f64],
    n: usize,
    count: usize,
    largest: f64,
) -> Vec<f64> {
    let mut found = vec![0.0; count * n * n];
    if n > 0 && count > 0 {
        widest(
            #[inline(always)]
            || (0..n).for_each(|noise| follow(weights, start, (n, noise, largest), &mut found)),
        );
    }
    found
}

/// Outputs after one noise. What is past lies side by side, latest first.
#[inline(always)]
fn follow(
    weights: &[f64],
    start: &[f64],
    (n, noise, largest): (usize, usize, f64),
    found: &mut [f64],
) {
    let (count, width) = (found.len() / (n * n), weights.len() / n);
    let mut back = vec![0.0; count * n];
    for now in 0..count {
        let (to, past) = back[(count - 1 - now) * n..].split_at_mut(n);
        let past = &past[..past.len().min(width)];
        for (output, to) in to.iter_mut().enumerate() {
            *to = if now == 0 {
                start[output * n + noise]
            } else {
                let weights = &weights[output * width..][..width];
                let value = products(past, [weights])[0];
                // No clamp, which ends the process where the bound is no number.
                if value.abs() > largest { largest.copysign(value) } else { value }
            };
            found[(now * n + output) * n + noise] = *to;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;

    #[test]
    fn each_sample_is_what_its_past_makes() {
        let mut source = Random::new(4);
        for (n, order, count) in [(1, 3, 50), (2, 1, 9), (3, 20, 60), (2, 0, 4)] {
            let mut drawn =
                |size: usize| (0..size).map(|_| 0.2 * source.normal()).collect::<Vec<_>>();
            let (weights, start) = (drawn(n * order * n), drawn(n * n));
            let found = noise_answers(&weights, &start, n, count, 1e6);
            assert_eq!(found[..n * n], start);
            for now in 1..count {
                for (output, noise) in (0..n * n).map(|k| (k / n, k % n)) {
                    let from = |lag: usize| (0..n).map(move |past| (lag, past));
                    let wanted: f64 = (1..=order.min(now))
                        .flat_map(from)
                        .map(|(lag, past)| {
                            weights[(output * order + lag - 1) * n + past]
                                * found[((now - lag) * n + past) * n + noise]
                        })
                        .sum();
                    let value = found[(now * n + output) * n + noise];
                    assert!((value - wanted).abs() < 1e-13, "{n} {order} {now}");
                }
            }
        }
        assert_eq!(noise_answers(&[-3.0], &[1.0], 1, 5, 10.0), [1.0, -3.0, 9.0, -10.0, 10.0]);
        assert!(noise_answers(&[], &[], 0, 5, 1.0).is_empty());
    }
}
