use super::*;
use crate::linear::discretisation::{Hold, StateSpace};

/// x' = −x + v₀, signals: v₁ (what drives), x, and v₁ again where a port reads it.
fn lag(holds: &[Hold], delays_s: &[f64]) -> Discrete {
    let system = StateSpace {
        a: &[-1.0],
        b: &[0.0, 1.0],
        c: &[0.0, 1.0],
        d: &[1.0, 0.0, 0.0, 0.0],
        delays_s,
        n_outputs: 2,
    };
    Discrete::with_holds(&system, 0.1, holds).unwrap()
}

fn rows(given: impl Fn(usize) -> f64, n: usize) -> Vec<f64> {
    let mut rows = vec![0.0; 2 * (n + 1)];
    (0..n).for_each(|k| rows[k + 1] = given(k));
    rows
}

fn run(core: &Discrete, element: Element, reads: usize, input: impl Fn(usize) -> f64) -> Vec<f64> {
    let n = 30;
    let mut rows = rows(input, n);
    let mut ports = vec![Port { element, reads: vec![reads], rows: vec![1] }];
    let kept = Kept { signals: &[1], every: 1 };
    simulate(core, &mut ports, &mut rows, n, &[0.0], kept).unwrap()
}

#[test]
fn a_limit_cuts_what_drives_the_lag() {
    let core = lag(&[Hold::First; 2], &[0.0; 2]);
    let limits = Element::Limits { low: -0.5, high: 0.5 };
    let found = run(&core, limits, 0, |_| 2.0);
    for (k, x) in found.iter().enumerate() {
        assert!((x - 0.5 * (1.0 - (-0.1 * k as f64).exp())).abs() < 1e-14);
    }
}

#[test]
fn a_rate_limit_makes_a_ramp_of_a_step() {
    let core = lag(&[Hold::First; 2], &[0.0; 2]);
    let found = run(&core, Element::RateLimit { most: 0.05 }, 0, |k| if k > 0 { 1.0 } else { 0.0 });
    for (k, x) in found.iter().enumerate().take(20) {
        let t = 0.1 * k as f64;
        assert!((x - 0.5 * (t - 1.0 + (-t).exp())).abs() < 1e-13, "{k}");
    }
}

#[test]
fn a_hold_keeps_its_sample() {
    let core = lag(&[Hold::Zero; 2], &[0.0; 2]);
    let found = run(&core, Element::Hold { every: 10 }, 0, |k| (k + 1) as f64);
    let e = (-1.0_f64).exp();
    assert!((found[10] - (1.0 - e)).abs() < 1e-13);
    assert!((found[20] - (found[10] * e + 11.0 * (1.0 - e))).abs() < 1e-12);
}

#[test]
fn feedback_through_a_limit_within_a_step_settles_to_the_implicit_solution() {
    // The port reads the state and drives it at once: x' = −x + clip(x, −9, 9) from x = 1 stands still.
    let core = lag(&[Hold::First; 2], &[0.0; 2]);
    let mut ports = vec![Port {
        element: Element::Limits { low: -9.0, high: 9.0 },
        reads: vec![1],
        rows: vec![1],
    }];
    let mut rows = vec![0.0; 2 * 31];
    let kept = Kept { signals: &[1], every: 1 };
    let found = simulate(&core, &mut ports, &mut rows, 30, &[1.0], kept).unwrap();
    assert!(found.iter().all(|x| (x - 1.0).abs() < 1e-11));
}

#[test]
fn a_recursion_runs_at_its_own_samples() {
    let core = lag(&[Hold::Zero; 2], &[0.0; 2]);
    let sum = Recursion {
        every: 5,
        a: vec![1.0],
        b: vec![1.0],
        c: vec![1.0],
        d: vec![0.0],
        state: vec![0.0],
    };
    let found = run(&core, Element::Recursion(sum), 0, |_| 1.0);
    // The accumulator gives 0, 1, 2, … for half a second each.
    let e = (-0.5_f64).exp();
    assert!(found[..6].iter().all(|x| *x == 0.0));
    assert!((found[10] - (1.0 - e)).abs() < 1e-13);
    assert!((found[15] - (found[10] * e + 2.0 * (1.0 - e))).abs() < 1e-13);
}

#[test]
fn a_delayed_row_begins_at_rest() {
    let core = lag(&[Hold::Zero; 2], &[0.0, 0.25]);
    let found = run(&core, Element::Through, 0, |_| 1.0);
    for (k, x) in found.iter().enumerate() {
        let t = (0.1 * k as f64 - 0.25).max(0.0);
        assert!((x - (1.0 - (-t).exp())).abs() < 1e-13, "{k}");
    }
}

#[test]
fn refuses_what_does_not_fit_and_loops_that_do_not_settle() {
    let core = lag(&[Hold::First; 2], &[0.0; 2]);
    let kept = Kept { signals: &[1], every: 1 };
    let port = |element, reads, row| vec![Port { element, reads: vec![reads], rows: vec![row] }];
    let try_ports = |mut ports: Vec<Port>| {
        let mut rows = vec![1.0; 2 * 31];
        simulate(&core, &mut ports, &mut rows, 30, &[1.0], kept).is_err()
    };
    assert!(try_ports(port(Element::Through, 2, 1)));
    assert!(try_ports(port(Element::Through, 0, 2)));
    assert!(try_ports(port(Element::Hold { every: 0 }, 0, 1)));
    let amplifier =
        Recursion { every: 1, a: vec![], b: vec![], c: vec![], d: vec![1e3], state: vec![] };
    assert!(try_ports(port(Element::Recursion(amplifier), 1, 1)));
    assert!(!try_ports(port(Element::Through, 0, 1)));
    let mut rows = vec![f64::NAN; 2 * 31];
    assert!(simulate(&core, &mut [], &mut rows, 30, &[0.0], kept).is_err());
    assert!(simulate(&core, &mut [], &mut [0.0; 3], 30, &[0.0], kept).is_err());
}
