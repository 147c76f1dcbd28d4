//! Most that a row's ranks may go together with others, by counts in buckets: without sorting it.
//! (Python side: `uncertainty/unequal_noise.py`)

/// Buckets to each doubling of a number.
const FINE: u32 = 8;
/// Doublings below the largest number that are told apart; smaller ones share a bucket.
const DOUBLINGS: u64 = 16;

/// Upper bound of the mean product of `ranks`, of unit mean square, with the ranks of a row of
/// numbers that are not negative; zero at least, infinite where some number is not finite.
///
/// A bucket's numbers share the middle of its ranks. What that leaves of c ranks has squares of at
/// most (c³ − c)/12, and products with unit ranks follow by the inequality of Cauchy and Schwarz.
pub fn rank_bound(row: &[f64], ranks: &[f64]) -> f64 {
    let n = row.len().min(ranks.len());
    let largest = row[..n].iter().fold(0.0_f64, |most, &value| most.max(value));
    if !row[..n].iter().all(|value| value.is_finite()) {
        return f64::INFINITY;
    }
    let key = |value: f64| value.max(0.0).to_bits() >> (52 - FINE);
    let top = key(largest);
    let lowest = top.saturating_sub(DOUBLINGS << FINE);
    let mut buckets = vec![(0.0_f64, 0.0_f64); (top - lowest) as usize + 1];
    for (&value, &rank) in row[..n].iter().zip(ranks) {
        let bucket = &mut buckets[key(value).saturating_sub(lowest) as usize];
        bucket.0 += 1.0;
        bucket.1 += rank;
    }
    let (mut below, mut together, mut squares, mut hidden) = (0.0, 0.0, 0.0, 0.0);
    for (count, sum) in buckets {
        let middle = below + 0.5 * (count - n as f64);
        together += middle * sum;
        squares += count * middle * middle;
        hidden += (count * count - 1.0).max(0.0) * count / 12.0;
        below += count;
    }
    let most = together + (hidden * n as f64).sqrt();
    if squares > 0.0 { (most / (n as f64 * squares).sqrt()).max(0.0) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;
    use crate::numerics::ranks::ranks;

    #[test]
    fn no_ranks_go_together_more() {
        let mut source = Random::new(11);
        let noise: Vec<f64> = (0..4000).map(|_| source.normal().abs()).collect();
        let own = ranks(&noise);
        for (power, share) in [(1, 0.0), (2, 0.02), (6, 0.1), (2, 1.0), (40, 0.5)] {
            let mix =
                |(k, each): (usize, &f64)| (share * each + ((k * k) as f64).sin()).powi(power);
            let mut row: Vec<f64> = noise.iter().enumerate().map(mix).map(f64::abs).collect();
            row[..100].fill(0.5);
            let exact: f64 = ranks(&row).iter().zip(&own).map(|(a, b)| a * b).sum::<f64>() / 4000.0;
            let most = rank_bound(&row, &own);
            assert!(most >= exact, "{power} {share}: {most} {exact}");
            // Of numbers of some size all but a little is told.
            assert!(power > 2 || most < exact.max(0.0) + 0.02, "{power} {share}: {most} {exact}");
        }
    }

    #[test]
    fn what_buckets_do_not_tell_is_open() {
        assert_eq!(rank_bound(&[2.0; 5], &[1.0, -1.0, 1.0, -1.0, 0.0]), f64::INFINITY);
        assert_eq!(rank_bound(&[f64::NAN, 1.0], &[1.0, -1.0]), f64::INFINITY);
        assert_eq!(rank_bound(&[1.0, 9.0, 2.0], &[1.0, -1.2, 0.2]), 0.0);
    }
}
