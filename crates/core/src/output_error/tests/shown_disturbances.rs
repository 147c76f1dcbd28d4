use super::*;

/// Two lags of 1 and 3 rad/s, both pushed by one disturbance and felt at once by the second output.
const A: [f64; 4] = [-1.0, 0.0, 0.0, -3.0];
const B: [f64; 4] = [1.0, 0.0, 1.0, 1.0];
const C: [f64; 4] = [1.0, 0.0, 0.0, 1.0];
const D: [f64; 4] = [0.0, 0.0, 0.5, 0.0];
const STEP_S: f64 = 0.1;
const FILTERS: [f64; 4] = [1.0, -0.5, 1.0, 0.25];
const TURNED: [f64; 4] = [1.0, 0.2, 0.0, 2.0];

fn system() -> StateSpace<'static> {
    StateSpace { a: &A, b: &B, c: &C, d: &D, delays_s: &[0.0; 2], n_outputs: 2 }
}

/// w of one disturbance at one frequency, as the file's head writes it.
fn by_hand(omega: f64, power: [f64; 2], way: usize) -> [Complex64; 2] {
    let s = Complex64::new(0.0, omega);
    let z = Complex64::cis(-omega * STEP_S);
    let moved = |k: usize| {
        let lag = if k == 0 { s + 1.0 } else { s + 3.0 };
        (B[2 * k + way] / lag + D[2 * k + way]) * (FILTERS[2 * k] + FILTERS[2 * k + 1] * z)
    };
    std::array::from_fn(|o| {
        (TURNED[2 * o] * moved(0) + TURNED[2 * o + 1] * moved(1)) / power[o].sqrt()
    })
}

#[test]
fn scores_and_sizes_are_what_the_formula_says() {
    let n_omega = 19;
    let omega: Vec<f64> = (1..=n_omega).map(|k| 0.7 * k as f64).collect();
    let told: Vec<_> = (0..2 * n_omega)
        .map(|k| Complex64::new((1.3 * k as f64).sin(), (0.7 * k as f64).cos()))
        .collect();
    let power: Vec<f64> = (0..2 * n_omega).map(|k| 1.0 + 0.1 * k as f64).collect();
    let residuals = Residuals {
        omega: &omega,
        told: &told,
        power: &power,
        filters: &FILTERS,
        turned: &TURNED,
        step_s: STEP_S,
    };
    let memories = [0.0, 0.4];
    let found = residuals.scores(&system(), 2, &memories).unwrap();
    let sizes = residuals.sizes(&system(), &memories).unwrap();
    for (place, memory_s) in memories.iter().enumerate() {
        for way in 0..2 {
            let (mut score, mut variance) = (0.0, 0.0);
            for (k, w) in omega.iter().enumerate() {
                let slow = 1.0 / Complex64::new(1.0, w * memory_s).norm();
                let weights = by_hand(*w, [power[k], power[n_omega + k]], way).map(|v| v * slow);
                let (a, b) = (weights[0].conj() * told[k], weights[1].conj() * told[n_omega + k]);
                score += 2.0 * (a * b.conj()).re;
                variance += 2.0 * weights[0].norm_sqr() * weights[1].norm_sqr();
                if way == place {
                    for (output, each) in weights.iter().enumerate() {
                        let size = sizes[(way * 2 + output) * n_omega + k];
                        assert!((size - each.norm_sqr()).abs() < 1e-13);
                    }
                }
            }
            assert!((found.score[place * 2 + way] - score).abs() < 1e-12);
            assert!((found.variance[place * 2 + way] - variance).abs() < 1e-12);
        }
    }
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let (omega, power) = ([1.0], [1.0; 2]);
    let residuals = Residuals {
        omega: &omega,
        told: &[Complex64::default(); 3],
        power: &power,
        filters: &FILTERS,
        turned: &TURNED,
        step_s: STEP_S,
    };
    assert!(matches!(residuals.scores(&system(), 2, &[0.0]), Err(CoreError::Shape { .. })));
}

/// With two outputs of size one w w* − diag has the eigenvalues ±1 at each of n frequencies:
/// K(s) = −n ln(1 − s²), whose saddlepoint is known. Far out one frequency has Laplace's tail
/// exp(−x)/2, of which the saddlepoint gives e/√(2π) times as much, as of any exponential.
#[test]
fn the_tail_of_differences_of_exponentials_is_their_saddlepoint() {
    for (n, score) in [(1, 4.0), (1, 16.0), (9, 5.0), (50, 40.0)] {
        let (count, x) = (n as f64, score / n as f64);
        let s = ((1.0 + x * x).sqrt() - 1.0) / x;
        let left = 1.0 - s * s;
        let bend = count * 2.0 * (1.0 + s * s) / (left * left);
        let known = f64::exp(-count * left.ln() - s * score)
            / (s * (2.0 * std::f64::consts::PI * bend).sqrt());
        let found = chance(score, &vec![1.0; 2 * n], 2);
        assert!((found / known - 1.0).abs() < 1e-8, "{n}, {score}: {found:e} for {known:e}");
    }
    let ratio = chance(400.0, &[1.0, 1.0], 2) / (0.5 * f64::exp(-400.0));
    let known = std::f64::consts::E / (2.0 * std::f64::consts::PI).sqrt();
    assert!((ratio / known - 1.0).abs() < 0.01, "{ratio} for {known}");
    assert_eq!(chance(-1.0, &[1.0, 1.0], 2), 1.0);
    assert_eq!(chance(f64::NAN, &[1.0, 1.0], 2), 1.0);
    assert_eq!(chance(1.0, &[0.0, 0.0], 2), 1.0);
}

#[test]
fn the_narrowest_frequency_ends_the_exponents() {
    // Of two equal sizes a the moments end at s = 1/a; more frequencies do not change the first's.
    let sizes = [0.5, 2.0, 0.1, 0.5, 2.0, 0.1];
    assert!((largest(&sizes, 2) - 0.5).abs() < 1e-6);
    // Of sizes a, b they end where s² a b = 1.
    assert!((largest(&[4.0, 1.0], 2) - 0.5).abs() < 1e-6);
}
