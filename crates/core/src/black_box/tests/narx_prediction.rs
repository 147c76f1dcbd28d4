use super::*;
use crate::black_box::radial_basis::Kernel;

const CENTRE: [f64; 2] = [0.2, -0.1];

fn model(pole: f64) -> Narx<'static> {
    Narx {
        lags: vec![Lag { channel: 0, lag: 1 }, Lag { channel: 1, lag: 2 }],
        monomials: vec![
            Monomial { weight: 0.1, factors: vec![] },
            Monomial { weight: pole, factors: vec![(0, 1)] },
            Monomial { weight: 0.05, factors: vec![(0, 1), (1, 2)] },
        ],
        radial: Radial::new(Kernel::Gaussian, 1.5, &CENTRE, 2).unwrap(),
        radial_weights: &[0.3],
        bounds: (-10.0, 10.0),
    }
}

fn by_hand(pole: f64, y: f64, u: f64) -> f64 {
    let squared = (y - CENTRE[0]).powi(2) + (u - CENTRE[1]).powi(2);
    0.1 + pole * y + 0.05 * y * u * u + 0.3 * (-squared / 2.25).exp()
}

fn data(n: usize) -> (Vec<f64>, Vec<f64>) {
    let u: Vec<f64> = (0..n).map(|t| (0.3 * t as f64).sin()).collect();
    (u.iter().map(|value| value * value - 0.4).collect(), u)
}

#[test]
fn one_step_and_free_run_follow_the_recursion() {
    let (y, u) = data(40);
    let one = model(0.5).ahead(&y, &u, 1).unwrap();
    let free = model(0.5).free_run(&y, &u).unwrap();
    assert_eq!((one.start, free.start), (2, 2));
    let mut last = y[1];
    for t in 2..40 {
        assert!((one.output[t] - by_hand(0.5, y[t - 1], u[t - 2])).abs() < 1e-14);
        last = by_hand(0.5, last, u[t - 2]);
        assert!((free.output[t] - last).abs() < 1e-14);
    }
    assert_eq!((one.diverged_at, free.diverged_at), (None, None));
}

#[test]
fn k_steps_are_free_runs_from_k_samples_before() {
    let (y, u) = data(40);
    let three = model(0.5).ahead(&y, &u, 3).unwrap();
    for t in 4..40 {
        let run = (t - 2..=t).fold(y[t - 3], |last, s| by_hand(0.5, last, u[s - 2]));
        assert!((three.output[t] - run).abs() < 1e-14);
    }
    let all = model(0.5).ahead(&y, &u, 40).unwrap();
    assert_eq!(all, model(0.5).free_run(&y, &u).unwrap());
}

#[test]
fn an_unstable_run_is_held_and_flagged_where_it_left() {
    let (y, u) = data(200);
    let free = model(1.4).free_run(&y, &u).unwrap();
    let at = free.diverged_at.unwrap();
    assert!(free.output[2..at].iter().all(|value| value.abs() < 10.0));
    assert_eq!(free.output[at].abs(), 10.0);
    assert!(free.output.iter().all(|value| value.abs() <= 10.0));
}

#[test]
fn overflow_is_held_in_the_middle() {
    let mut wild = model(0.5);
    wild.monomials = vec![
        Monomial { weight: 1.0, factors: vec![(1, 300)] },
        Monomial { weight: -1.0, factors: vec![(1, 302)] },
    ];
    wild.radial_weights = &[0.0];
    let free = wild.free_run(&[1.0; 5], &[1e9; 5]).unwrap();
    assert_eq!(free.output[2..], [0.0; 3]);
    assert_eq!(free.diverged_at, Some(2));
}

#[test]
fn refuses_what_cannot_be_run() {
    let (y, u) = data(10);
    assert!(model(0.5).free_run(&y[..2], &u[..2]).is_err());
    assert!(model(0.5).free_run(&y, &u[..9]).is_err());
    assert!(model(0.5).free_run(&y, &[]).is_err());
    assert!(model(0.5).ahead(&y, &u, 0).is_err());
    let mut bad = y.clone();
    bad[3] = f64::NAN;
    assert!(model(0.5).free_run(&bad, &u).is_err());
    assert!(model(f64::INFINITY).free_run(&y, &u).is_err());
    let mut unordered = model(0.5);
    unordered.bounds = (1.0, -1.0);
    assert!(unordered.free_run(&y, &u).is_err());
    let mut odd = model(0.5);
    odd.monomials[1].factors[0].0 = 7;
    assert!(odd.free_run(&y, &u).is_err());
    odd = model(0.5);
    odd.radial_weights = &[];
    assert!(odd.free_run(&y, &u).is_err());
    odd = model(0.5);
    odd.lags[0].lag = 0;
    assert!(odd.free_run(&y, &u).is_err());
}
