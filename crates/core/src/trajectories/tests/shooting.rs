use super::*;
use crate::linear::discretisation::Hold;
use crate::trajectories::runge_kutta::tests::ode;

const VALUES: [f64; 4] = [2.0, 0.3, 5.0, 0.013];
const N: usize = 121;
/// An inverted pendulum: modes near ±√(k/m).
const INVERTED: [(&str, &str); 2] = [("x'", "v"), ("m*v'", "k*sin(x) - c*v + f")];

/// A small motion about the unstable rest, held there by feedback: input, states.
fn held() -> (Vec<f64>, Vec<[f64; 2]>) {
    let (mut inputs, mut states) = (Vec::new(), Vec::new());
    let (mut x, h) = ([0.2, -0.1], 0.05);
    for k in 0..N {
        let u = -12.0 * x[0] - 6.0 * x[1] + (2.0 * k as f64 * h).sin();
        inputs.push(u);
        states.push(x);
        for _ in 0..50 {
            let rate = (5.0 * f64::sin(x[0]) - 0.3 * x[1] + u) / 2.0;
            x = [x[0] + h / 50.0 * x[1], x[1] + h / 50.0 * rate];
        }
    }
    (inputs, states)
}

fn plan(states: &[[f64; 2]]) -> Plan {
    let cuts: Vec<usize> = (1..8).map(|k| 15 * k).collect();
    let root = f64::sqrt(2.5);
    let mut guesses = states[0].to_vec();
    cuts.iter().for_each(|&cut| guesses.extend(states[cut]));
    guesses.extend(states[N - 1]);
    Plan { cuts, ends: vec![root, -1.0, root, 1.0], n_growing: 1, guesses }
}

fn course(inputs: &[f64]) -> Course<'_> {
    Course { inputs, n_samples: N, sample_s: 0.05, hold: Hold::First, substeps: 2 }
}

fn rows(
    plan: &Plan,
    inputs: &[f64],
    values: &[f64; 4],
    initial: &[f64],
    shift: f64,
    slopes: bool,
) -> (Vec<f64>, Flight) {
    let ode = ode(&INVERTED, &["x", "v' + f"]);
    let (free, initials): (&[usize], &[usize]) =
        if slopes { (&[2, 0, 1, 3], &[0, 1]) } else { (&[], &[]) };
    let free_shift: &[usize] = if slopes { &[0] } else { &[] };
    let wish = Wish {
        parameters: values,
        initial,
        shift: &[shift],
        free,
        free_initial: initials,
        free_shift,
    };
    let (mut found, mut flight) = (Vec::new(), Flight::default());
    let mut sink = |first: usize, rows: &mut [f64]| {
        assert_eq!(first * 16, found.len());
        found.extend_from_slice(rows);
    };
    flight.run(&ode, &course(inputs), plan, &wish, 8, &mut sink).unwrap();
    (found, flight)
}

#[test]
fn segments_make_one_continuous_trajectory() {
    let (inputs, states) = held();
    let plan = plan(&states);
    plan.check(2, N).unwrap();
    let ends = [plan.ends[0] * 0.2 + 0.1, plan.ends[2] * states[N - 1][0] + states[N - 1][1]];
    let (found, flight) = rows(&plan, &inputs, &VALUES, &ends, 0.0, false);
    for (sample, state) in states.iter().enumerate() {
        // The feedback held its input between samples; the model draws straight lines.
        assert!((found[sample * 16] - state[0]).abs() < 0.05, "{sample}");
    }
    let ode = ode(&INVERTED, &["x", "v' + f"]);
    let first = flight.nodes[..2].to_vec();
    let wish = Wish {
        parameters: &VALUES,
        initial: &first,
        shift: &[0.0],
        free: &[],
        free_initial: &[],
        free_shift: &[],
    };
    let mut single = Vec::new();
    let mut sink = |_: usize, rows: &mut [f64]| single.extend_from_slice(rows);
    let (mut alone, course) = (Flight::default(), course(&inputs));
    alone.run(&ode, &course, &Plan::default(), &wish, 8, &mut sink).unwrap();
    for sample in 0..N {
        // A single run agrees until rounding has grown by exp(1.5 t).
        let growth = (1.6 * 0.05 * sample as f64).exp();
        assert!((single[sample * 16] - found[sample * 16]).abs() < 1e-11 * growth, "{sample}");
    }
}

#[test]
fn derivatives_match_differences() {
    let (inputs, states) = held();
    let plan = plan(&states);
    let ends = [plan.ends[0] * 0.2 + 0.1, plan.ends[2] * states[N - 1][0] + states[N - 1][1]];
    let (exact, flight) = rows(&plan, &inputs, &VALUES, &ends, 0.1, true);
    let ode = ode(&INVERTED, &["x", "v' + f"]);
    let starts = flight.start(&ode).1.to_vec();
    for column in 0..7 {
        let at = |h: f64| {
            let (mut values, mut ends, mut shift) = (VALUES, ends, 0.1);
            match column {
                0..4 => values[[2, 0, 1, 3][column]] += h,
                4 | 5 => ends[column - 4] += h,
                _ => shift += h,
            }
            let (rows, flight) = rows(&plan, &inputs, &values, &ends, shift, false);
            (rows, flight.start(&ode).0.to_vec())
        };
        let h = 1e-6;
        let (up, down) = (at(h), at(-h));
        for place in 0..2 * N {
            let wanted = (up.0[place * 8] - down.0[place * 8]) / (2.0 * h);
            let error = (exact[place * 8 + 1 + column] - wanted).abs();
            assert!(error < 3e-8 * wanted.abs().max(1.0), "{column} {place}: {error}");
        }
        for state in 0..2 {
            let wanted = (up.1[state] - down.1[state]) / (2.0 * h);
            assert!((starts[state * 7 + column] - wanted).abs() < 1e-7);
        }
    }
}

/// Weighed, differentiated there, weighed again and moved: the same bits as flights of their own.
#[test]
fn a_run_that_is_at_hand_is_the_run() {
    let (inputs, states) = held();
    let ode = ode(&INVERTED, &["x", "v' + f"]);
    let (course, single) = (course(&inputs), Plan::default());
    let run = |flight: &mut Flight, values: &[f64], start: &[f64], slopes: bool| {
        let (free, initials): (&[usize], &[usize]) =
            if slopes { (&[0, 1], &[1]) } else { (&[], &[]) };
        let wish = Wish {
            parameters: values,
            initial: start,
            shift: &[0.1],
            free,
            free_initial: initials,
            free_shift: &[],
        };
        let mut found = Vec::new();
        let mut sink = |_: usize, rows: &mut [f64]| found.extend_from_slice(rows);
        flight.run(&ode, &course, &single, &wish, 4, &mut sink).map(|()| found)
    };
    let mut kept = Flight::default();
    let (start, mut other) = (states[0].to_vec(), VALUES);
    other[1] *= 1.01;
    let moved = [start[0] + 0.01, start[1]];
    for (values, start, slopes) in [
        (VALUES, &start[..], false),
        (VALUES, &start, true),
        (VALUES, &start, false),
        (other, &start, true),
        (other, &start, false),
        (other, &start, false),
        (other, &moved, true),
    ] {
        let fresh = run(&mut Flight::default(), &values, start, slopes).unwrap();
        assert_eq!(run(&mut kept, &values, start, slopes).unwrap(), fresh);
    }
    // What failed is not at hand.
    assert!(run(&mut kept, &VALUES, &[f64::NAN, 0.0], false).is_err());
    assert!(run(&mut kept, &VALUES, &[f64::NAN, 0.0], true).is_err());
    let fresh = run(&mut Flight::default(), &other, &moved, true).unwrap();
    assert_eq!(run(&mut kept, &other, &moved, true).unwrap(), fresh);
}

#[test]
fn plans_that_do_not_fit_are_refused() {
    let (_, states) = held();
    let good = plan(&states);
    for bad in [
        Plan { ends: vec![1.0], ..good.clone() },
        Plan { guesses: vec![0.0], ..good.clone() },
        Plan { n_growing: 3, ..good.clone() },
        Plan { cuts: vec![15, 15, 30, 45, 60, 75, 90], ..good },
    ] {
        assert!(matches!(bad.check(2, N), Err(CoreError::Shape { .. })));
    }
}
