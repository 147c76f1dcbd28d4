//! A rational response with transients is found again, and columns that are alike are told.

use super::*;

const LENGTHS: [usize; 2] = [90, 131];

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    }
}

fn bins(order: usize) -> (RationalBins, Vec<Complex64>) {
    let n: usize = LENGTHS.iter().sum();
    let mut draw = noise(3);
    let inputs: Vec<Complex64> = (0..2 * n).map(|_| Complex64::new(draw(), draw())).collect();
    let turns: Vec<Complex64> = LENGTHS
        .iter()
        .flat_map(|&length| (1..=length).map(move |k| -3.0 * k as f64 / length as f64))
        .map(|angle| Complex64::from_polar(1.0, angle))
        .collect();
    let made = RationalBins::new(inputs, turns.clone(), LENGTHS.to_vec(), order, order + 3);
    (made.expect("lengths fit"), turns)
}

#[test]
fn finds_what_made_the_bins() {
    let (bins, turns) = bins(2);
    let n = turns.len();
    // Two numerators, the denominator 1 − .5 z + .2 z², transients of five terms.
    let mut truth = vec![1.0, -0.4, 0.3, 0.2, 0.7, -0.1, -0.5, 0.2];
    let mut draw = noise(5);
    truth.extend((0..10).map(|_| draw()));
    let above = bins.numerator(&truth).expect("coefficients fit");
    let output: Vec<Complex64> =
        above.iter().zip(&turns).map(|(y, z)| y / (1.0 - 0.5 * z + 0.2 * z * z)).collect();
    let power: Vec<f64> = (0..n).map(|_| 1.0 + draw()).collect();
    let pulled: Vec<Complex64> = output.iter().zip(&power).map(|(y, w)| y * w).collect();
    let found = bins.solve(&output, &power, &pulled).expect("lengths fit").expect("sound");
    for (one, other) in found.iter().zip(&truth) {
        assert!((one - other).abs() < 1e-12, "{found:?} {truth:?}");
    }
}

#[test]
fn leaves_columns_that_are_alike() {
    let (bins, turns) = bins(2);
    // An output of the first input alone: the denominator's columns are sums of numerators'.
    let n = turns.len();
    let output = bins.inputs[..n].to_vec();
    let found = bins.solve(&output, &vec![1.0; n], &output).expect("lengths fit");
    assert!(found.is_none());
}

#[test]
fn lengths_must_fit() {
    let (bins, turns) = bins(2);
    let short = vec![Complex64::default(); 3];
    assert!(bins.solve(&short, &[1.0; 3], &short).is_err());
    assert!(bins.numerator(&[1.0]).is_err());
    assert!(RationalBins::new(turns.clone(), turns, vec![usize::MAX, 2], 2, 4).is_err());
}
