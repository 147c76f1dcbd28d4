use super::*;

#[test]
fn a_minimum_holds_half_a_standard_error_along_every_direction() {
    // J = diag(2, 10): standard errors 1/2 and 1/10 for residuals of variance one.
    let triangle = [2.0, 0.0, 0.0, 10.0];
    let settled = Settled::of(&[1.0, -1.0], &triangle, 1.0, Termination::Cost).unwrap();
    assert!(settled.holds(&[1.24, -1.0]) && !settled.holds(&[1.26, -1.0]));
    assert!(settled.holds(&[1.0, -1.049]) && !settled.holds(&[1.0, -1.051]));
    assert!(!settled.holds(&[f64::NAN, -1.0]));
}

#[test]
fn no_minimum_and_no_distinct_variables_hold_nothing() {
    let sound = [2.0, 0.0, 0.0, 10.0];
    assert!(Settled::of(&[0.0; 2], &sound, 1.0, Termination::Iterations).is_none());
    assert!(Settled::of(&[0.0; 2], &sound, 0.0, Termination::Cost).is_none());
    assert!(Settled::of(&[0.0; 2], &[2.0, 0.0, 3.0, 1e-9], 1.0, Termination::Cost).is_none());
}

#[test]
fn waves_keep_the_order_of_starts_and_know_the_waves_before() {
    let starts: Vec<usize> = (0..20).collect();
    let found = in_waves(&starts, |&start, known: &[(usize, usize)]| (start, known.len()));
    let known: Vec<usize> = found.iter().map(|each| each.1).collect();
    assert_eq!(found.iter().map(|each| each.0).collect::<Vec<_>>(), starts);
    assert_eq!(known[..7], [0, 1, 1, 3, 3, 3, 3]);
    assert_eq!((known[7], known[14], known[15], known[19]), (7, 7, 15, 15));
}
