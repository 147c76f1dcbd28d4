//! Outputs alone are those of the whole simulation, of few states and of many.

use super::*;
use crate::linear::discretisation::{Hold, StateSpace, discretise};
use crate::linear::linear_simulation::Discrete;

const INPUTS: usize = 2;

fn wave(k: usize) -> f64 {
    (0.37 * k as f64).sin()
}

#[test]
fn outputs_are_those_of_the_whole_simulation() {
    let n_samples = 301;
    let inputs: Vec<f64> = (0..INPUTS * n_samples).map(wave).collect();
    for n in [0, 1, 5, 13, 32, 37] {
        let a: Vec<f64> = (0..n * n)
            .map(|k| if k % (n + 1) == 0 { -0.5 } else { 0.1 * wave(k) / n as f64 })
            .collect();
        let b: Vec<f64> = (0..n * INPUTS).map(|k| wave(k + 1)).collect();
        let c: Vec<f64> = (0..3 * n).map(|k| wave(k + 2)).collect();
        let d: Vec<f64> = (0..3 * INPUTS).map(|k| wave(k + 3)).collect();
        let initial: Vec<f64> = (0..n).map(|k| wave(k + 5)).collect();
        let system =
            StateSpace { a: &a, b: &b, c: &c, d: &d, delays_s: &[0.13, 0.0], n_outputs: 3 };
        for hold in [Hold::First, Hold::Zero] {
            let whole = Discrete::new(&system, 0.05, hold).unwrap();
            let (_, known) = whole.run(&inputs, n_samples, &initial).unwrap();
            let sampled = discretise(&system, &[], 0.05, hold).unwrap().0;
            for every in [1, 4] {
                let found =
                    outputs(&sampled, (&c, 3), &inputs, n_samples, &initial, every).unwrap();
                let count = n_samples.div_ceil(every);
                assert_eq!(found.len(), 3 * count);
                for (at, value) in found.iter().enumerate() {
                    let other = known[at / count * n_samples + at % count * every];
                    assert!((value - other).abs() < 1e-12, "{n} states, every {every}: {at}");
                }
            }
        }
    }
}

#[test]
fn a_run_that_grows_without_bounds_is_refused() {
    let system =
        StateSpace { a: &[300.0], b: &[1.0], c: &[1.0], d: &[0.0], delays_s: &[0.0], n_outputs: 1 };
    let sampled = discretise(&system, &[], 1.0, Hold::Zero).unwrap().0;
    let found = outputs(&sampled, (&[1.0], 1), &[1.0; 9], 9, &[1.0], 1);
    assert!(matches!(found, Err(CoreError::NotFinite { .. })));
    assert!(outputs(&sampled, (&[1.0], 1), &[1.0; 2], 9, &[1.0], 1).is_err());
    assert!(outputs(&sampled, (&[1.0], 1), &[1.0; 9], 9, &[1.0], 0).is_err());
}
