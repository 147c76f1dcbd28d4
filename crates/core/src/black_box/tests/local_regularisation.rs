use super::*;
use crate::numerics::gram_schmidt::dot;
use crate::numerics::random::Random;

const N: usize = 120;

/// 40 candidates of which the target holds three; noise of deviation 0.5.
fn problem(seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = Random::new(seed);
    let columns: Vec<f64> = (0..N * 40).map(|_| random.normal()).collect();
    let at = |j: usize, t: usize| columns[j * N + t];
    let y = (0..N)
        .map(|t| at(3, t) - 0.7 * at(9, t) + 0.3 * at(20, t) + 0.5 * random.normal())
        .collect();
    (columns, y)
}

fn run(seed: u64, forced: usize, regularisation: Regularisation) -> Selection {
    let (columns, y) = problem(seed);
    let candidates = Candidates::given(&columns, N);
    select_regularised(&candidates, &y, forced, regularisation, Stop::Terms, 35).unwrap()
}

#[test]
fn penalties_are_the_fixed_point_of_the_evidence_update() {
    for (seed, forced) in [(1, 0), (2, 0), (3, 2), (4, 2)] {
        let found = run(seed, forced, Regularisation::Local(0.0));
        let k = found.kept;
        assert!(k > forced && k < 35, "{k} terms");
        let lengths: Vec<f64> = (0..k).map(|i| found.factor[i * k + i].powi(2)).collect();
        let gamma: Vec<f64> =
            lengths.iter().zip(&found.penalties).map(|(a, lambda)| a / (a + lambda)).collect();
        let noise = found.sum_of_squares[k - 1] / (N as f64 - gamma.iter().sum::<f64>());
        for i in forced..k {
            let g = gamma[i] * (found.explained[i] / lengths[i]).sqrt();
            let update = gamma[i] * noise / (g * g);
            assert!((update / found.penalties[i] - 1.0).abs() < 1e-10);
        }
        assert!(found.penalties[..forced].iter().all(|lambda| *lambda == 0.0));
    }
}

#[test]
fn evidence_drops_what_noise_explains_and_keeps_what_is_there() {
    for seed in 0..20 {
        let plain = run(seed, 0, Regularisation::Uniform(0.0));
        let found = run(seed, 0, Regularisation::Local(0.0));
        assert_eq!(plain.kept, 35);
        assert!(found.kept < 35);
        let kept = &found.terms[..found.kept];
        assert!([3, 9].iter().all(|j| kept.contains(j)));
        // Each kept term is above the noise: u > s.
        let s = found.unpenalised[found.kept - 1] / (N - found.kept) as f64;
        assert!(found.explained[..found.kept].iter().all(|u| *u > s));
    }
}

#[test]
fn a_uniform_penalty_is_ridge_along_the_orthogonal_directions() {
    let (columns, y) = problem(5);
    let two = &columns[..2 * N];
    let candidates = Candidates::given(two, N);
    let ridge = Regularisation::Uniform(30.0);
    let found = select_regularised(&candidates, &y, 0, ridge, Stop::Terms, 2).unwrap();
    let column = |place: usize| &two[found.terms[place] * N..(found.terms[place] + 1) * N];
    let (p, second) = (column(0), column(1));
    let slope = dot(p, second) / dot(p, p);
    let w: Vec<f64> = second.iter().zip(p).map(|(b, a)| b - slope * a).collect();
    let g = [dot(p, &y) / (dot(p, p) + 30.0), dot(&w, &y) / (dot(&w, &w) + 30.0)];
    assert!((found.weights[1] - g[1]).abs() < 1e-13);
    assert!((found.weights[0] - (g[0] - slope * g[1])).abs() < 1e-13);
    let left = |t: usize| y[t] - found.weights[0] * p[t] - found.weights[1] * second[t];
    let sum: f64 = (0..N).map(|t| left(t).powi(2)).sum();
    assert!((sum / found.sum_of_squares[1] - 1.0).abs() < 1e-12);
    let hat = |t: usize| p[t].powi(2) / (dot(p, p) + 30.0) + w[t].powi(2) / (dot(&w, &w) + 30.0);
    let press: f64 = (0..N).map(|t| (left(t) / (1.0 - hat(t))).powi(2)).sum();
    assert!((press / N as f64 / found.press[1] - 1.0).abs() < 1e-12);
}

#[test]
fn nothing_is_left_of_noise_alone_or_of_nothing() {
    let mut random = Random::new(8);
    // One weak candidate: its t-statistic is below one for this seed.
    let column: Vec<f64> = (0..N).map(|_| random.normal()).collect();
    let mut y: Vec<f64> = (0..N).map(|_| random.normal()).collect();
    let slope = dot(&column, &y) / dot(&column, &column);
    y.iter_mut().zip(&column).for_each(|(value, p)| *value -= (slope - 0.01) * p);
    let candidates = Candidates::given(&column, N);
    let local = Regularisation::Local(0.0);
    let found = select_regularised(&candidates, &y, 0, local, Stop::Terms, 1).unwrap();
    assert_eq!((found.kept, found.weights.len()), (0, 0));
    let negative = Regularisation::Uniform(-1.0);
    assert!(select_regularised(&candidates, &y, 0, negative, Stop::Terms, 1).is_err());
}
