use super::*;

const ROUNDS: Rounds = Rounds { most: 60, settled: 1e-12, sharpest: 1e6, cut: 1e-6 };

fn cosines(length: usize, n_lags: usize) -> Vec<f64> {
    let n_bins = length / 2 + 1;
    let twice = |bin: usize| if bin == 0 || 2 * bin == length { 1.0 } else { 2.0 };
    let angle = 2.0 * std::f64::consts::PI / length as f64;
    (0..n_lags * n_bins)
        .map(|k| (k / n_bins, k % n_bins))
        .map(|(lag, bin)| {
            twice(bin) * (angle * ((lag * bin) % length) as f64).cos() / length as f64
        })
        .collect()
}

/// The expected power of a drift of variance 3 beside x(t) = 0.5 x(t − 1) + e is theirs: they
/// are where the rounds stay.
#[test]
fn the_parts_of_their_own_power_stay() {
    let (length, n_lags, corner) = (1000, 3, 0.01);
    let n_bins = length / 2 + 1;
    let lags: Vec<f64> = (0..n_lags).map(|k| 0.5_f64.powi(k as i32) / 0.75).collect();
    let pole: f64 = 1.0 - corner;
    let power: Vec<f64> = (0..n_bins)
        .map(|bin| {
            let cosine = (2.0 * std::f64::consts::PI * bin as f64 / length as f64).cos();
            let fast = 1.0 / (1.25 - cosine);
            fast + 3.0 * (1.0 - pole * pole) / (1.0 + pole * pole - 2.0 * pole * cosine)
        })
        .collect();
    let table = cosines(length, n_lags);
    let angle = 2.0 * std::f64::consts::PI / length as f64;
    let turns: Vec<f64> = (0..n_bins).map(|bin| 1.0 - (angle * bin as f64).cos()).collect();
    let spectrum = Spectrum { power: &power, cosines: &table, turns: &turns, length, n: 500 };
    let begun = Parts { lags, weights: vec![0.5], variance: 3.0 };
    let found = spectrum.apart(begun.clone(), corner, ROUNDS).unwrap();
    assert!((found.variance - 3.0).abs() < 1e-3, "{found:?}");
    assert!((found.weights[0] - 0.5).abs() < 1e-3, "{found:?}");
    // And where they come to from elsewhere.
    let other = Parts { lags: vec![2.0, 0.0, 0.0], weights: vec![], variance: 1.0 };
    let rounds = Rounds { most: 3000, ..ROUNDS };
    let (there, here) =
        [other, begun].map(|each| spectrum.apart(each, corner, rounds).unwrap()).into();
    assert!((there.variance / here.variance - 1.0).abs() < 1e-5, "{there:?} {here:?}");
}

/// −n (mean of ln S + P / S) by its terms, over numbers of any size.
#[test]
fn a_likelihood_is_the_sum_of_its_terms() {
    let (length, corner) = (34_003, 0.01);
    let n_bins = length / 2 + 1;
    let angle = 2.0 * std::f64::consts::PI / length as f64;
    let turns: Vec<f64> = (0..n_bins).map(|bin| 1.0 - (angle * bin as f64).cos()).collect();
    let power: Vec<f64> = (0..n_bins).map(|bin| 1.0 + (bin % 7) as f64).collect();
    let cosines = vec![0.0; n_bins];
    let spectrum = Spectrum { power: &power, cosines: &cosines, turns: &turns, length, n: 900 };
    for scale in [1.0, 1e-300, 1e280, 0.0] {
        let parts = Parts { lags: vec![2.0 * scale], weights: vec![], variance: 3.0 * scale };
        let found = spectrum.likelihood(&parts, corner, 1e6).unwrap();
        let pole: f64 = 1.0 - corner;
        let terms = turns.iter().zip(&power).map(|(turn, p)| {
            let drift = (1.0 - pole * pole) / (corner * corner + 2.0 * pole * turn);
            let s = 2.0 * scale + 3.0 * scale * drift;
            s.ln() + p / s
        });
        let wanted = -900.0 * terms.sum::<f64>() / n_bins as f64;
        let close = (found - wanted).abs() <= 1e-12 * wanted.abs();
        assert!(close || (found.is_nan() && wanted.is_nan()), "{scale}: {found} {wanted}");
    }
    let short = Parts { lags: vec![], weights: vec![], variance: 0.0 };
    assert!(spectrum.likelihood(&short, corner, 1e6).is_err());
}

#[test]
fn no_table_gives_what_the_table_gives() {
    // Bins meet twice, not at all, once.
    for length in [1000, 1001, 1002] {
        let n_bins = length / 2 + 1;
        let power: Vec<f64> = (0..n_bins).map(|k| 2.0 + (k as f64).sin()).collect();
        let angle = 2.0 * std::f64::consts::PI / length as f64;
        let turns: Vec<f64> = (0..n_bins).map(|bin| 1.0 - (angle * bin as f64).cos()).collect();
        let table = cosines(length, 21);
        let [with, without] = [&table[..], &[]].map(|cosines| {
            let spectrum = Spectrum { power: &power, cosines, turns: &turns, length, n: 500 };
            let begun = Parts { lags: vec![0.0; 21], weights: vec![0.3], variance: 1.0 };
            (spectrum.lags_of(&power, 21), spectrum.apart(begun, 0.02, ROUNDS).unwrap())
        });
        let same = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).for_each(|(a, b)| assert!((a - b).abs() < 1e-12, "{a} {b}"));
        };
        same(&with.0, &without.0);
        same(&with.1.lags, &without.1.lags);
        assert!((with.1.variance / without.1.variance - 1.0).abs() < 1e-10);
    }
}

#[test]
fn a_level_is_that_of_its_recursion() {
    let parts = Parts { lags: vec![2.0, 1.0, 0.2], weights: vec![0.6, -0.2], variance: 0.0 };
    let level = Level::of(&parts, 64, 1e6);
    let omega: [f64; LANES] = std::array::from_fn(|k| 0.3 * k as f64);
    let found = level.at(&omega.map(|w| 1.0 - w.cos()));
    for (w, value) in omega.iter().zip(found) {
        let z = num_complex::Complex64::cis(-w);
        let gain = (1.0 - 0.6 * z + 0.2 * z * z).norm_sqr();
        assert!((value - (2.0 - 0.6 + 0.04) / gain).abs() < 1e-13);
    }
}
