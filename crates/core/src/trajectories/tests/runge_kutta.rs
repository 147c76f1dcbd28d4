use super::*;
use crate::state_space::model_tape::ModelTape;
use crate::state_space::model_tape::ModelText;
use crate::state_space::model_tape::tests::text;
use crate::trajectories::sensitivity::TrajectorySensitivity;
use crate::trajectories::sensitivity_pattern::Directions;
use crate::trajectories::trajectory::Trajectory;

const VALUES: [f64; 4] = [2.0, 0.3, 5.0, 0.013];

pub(crate) fn ode(equations: &[(&str, &str)], outputs: &[&str]) -> OdeModel {
    let mut text = text(equations, outputs);
    text.delays = vec!["tau".to_string()];
    OdeModel::new(&ModelTape::new(&text).unwrap()).unwrap()
}

fn wave(n: usize, dt: f64) -> Vec<f64> {
    (0..n).map(|k| (3.0 * k as f64 * dt).sin() + 0.3 * (11.0 * k as f64 * dt).cos()).collect()
}

fn course(inputs: &[f64], sample_s: f64, substeps: usize) -> Course<'_> {
    Course { inputs, n_samples: inputs.len(), sample_s, hold: Hold::First, substeps }
}

fn outputs(
    ode: &OdeModel,
    values: &[f64],
    course: &Course<'_>,
    initial: &[f64],
    shift: f64,
) -> Vec<f64> {
    let mut setting = Setting::default();
    setting.prepare(ode, values, course).unwrap();
    let mut outputs = vec![0.0; ode.n_outputs * course.n_samples];
    let range = 0..course.n_samples;
    setting.run(ode, range, initial, &[shift], &mut Vec::new(), Some(&mut outputs)).unwrap();
    outputs
}

const PENDULUM: [(&str, &str); 2] =
    [("x'", "v"), ("(m + x^2)*v' + c*x'", "-k*sin(x) - c*v*abs(v) + f*cos(x)")];

#[test]
fn error_falls_with_the_fourth_power_of_the_step() {
    let ode = ode(&PENDULUM, &["x", "v"]);
    let inputs = vec![0.0; 51];
    let run =
        |substeps| outputs(&ode, &VALUES, &course(&inputs, 0.1, substeps), &[1.2, 0.7], 0.2)[50];
    let best = run(64);
    let (coarse, fine) = ((run(1) - best).abs(), (run(2) - best).abs());
    let order = (coarse / fine).log2();
    assert!((3.7..4.5).contains(&order), "{order}");
}

#[test]
fn a_linear_model_follows_its_exact_solution() {
    let ode = ode(&[("x'", "v"), ("m*v'", "-k*x - c*v")], &["x", "v'"]);
    let inputs = vec![0.0; 201];
    let found = outputs(&ode, &VALUES, &course(&inputs, 0.01, 4), &[1.0, 0.0], 0.0);
    let (decay, square) = (0.3 / 4.0, 5.0 / 2.0);
    let omega = f64::sqrt(square - decay * decay);
    for k in [0, 77, 200] {
        let t = 0.01 * k as f64;
        let (s, c, e) = ((omega * t).sin(), (omega * t).cos(), (-decay * t).exp());
        let x = e * (c + decay / omega * s);
        let v = -e * square / omega * s;
        assert!((found[k] - x).abs() < 1e-10, "{k}");
        assert!((found[201 + k] - (-square * x - 2.0 * decay * v)).abs() < 1e-9, "{k}");
    }
}

fn derivatives(
    ode: &OdeModel,
    course: &Course<'_>,
    initial: &[f64],
    range: Range<usize>,
) -> (Vec<f64>, Vec<f64>) {
    let (mut setting, mut states) = (Setting::default(), Vec::new());
    setting.prepare(ode, &VALUES, course).unwrap();
    let mut values = vec![0.0; ode.n_outputs * course.n_samples];
    setting.run(ode, range.clone(), initial, &[0.1], &mut states, Some(&mut values)).unwrap();
    let directions = Directions { parameters: &[3, 0, 1, 2], n_initial: 2, shift: &[0] };
    let mut seeds = vec![0.0; 14];
    (seeds[4], seeds[7 + 5]) = (1.0, 1.0);
    let trajectory = Trajectory { ode, setting: &setting, range, states: &states, shift: &[0.1] };
    let mut rows = Vec::new();
    let mut sink = |_: usize, block: &mut [f64]| rows.extend_from_slice(block);
    TrajectorySensitivity::default()
        .run(&trajectory, &VALUES, &directions, &seeds, 8, &mut sink)
        .unwrap();
    (values, rows)
}

#[test]
fn derivatives_match_differences() {
    let models: [&[(&str, &str)]; 4] = [
        &PENDULUM,
        // No state moves itself but by way of the other, from the second stage on.
        &[("x'", "v"), ("v'", "-k*sin(x)/m + c*f")],
        &[("x'", "v - 0.1*x^3"), ("v'", "-k*sin(x)/m - c*v + f*x + f")],
        &[("m*x' + v'", "v + f"), ("v' - c*x'", "-k*x + min(v, 0.4)*f")],
    ];
    for (equations, formulas) in
        models.iter().zip([["x", "v' + f"], ["x", "v'"], ["x*v", "c*f"], ["x'", "v"]])
    {
        let ode = ode(equations, &formulas);
        let inputs = wave(41, 0.05);
        let initial = [0.4, -0.2];
        for substeps in [1, 3] {
            let course = course(&inputs, 0.05, substeps);
            let (plain, rows) = derivatives(&ode, &course, &initial, 0..41);
            let at = |column: usize, h: f64| {
                let (mut values, mut x0, mut shift) = (VALUES, initial, 0.1);
                match column {
                    0 => values[3] += h,
                    1..4 => values[column - 1] += h,
                    4 | 5 => x0[column - 4] += h,
                    _ => shift += h,
                }
                outputs(&ode, &values, &course, &x0, shift)
            };
            for column in 0..7 {
                let h = 1e-6;
                let (up, down) = (at(column, h), at(column, -h));
                for (sample, row) in (0..41).flat_map(|k| [(k, 0), (k, 1)]) {
                    let place = row * 41 + sample;
                    let wanted = (up[place] - down[place]) / (2.0 * h);
                    let found = &rows[(sample * 2 + row) * 8..][..8];
                    assert_eq!(found[0], plain[place]);
                    let error = (found[1 + column] - wanted).abs();
                    assert!(
                        error < 2e-8 * wanted.abs().max(1.0),
                        "{column} {sample} {row}: {error}"
                    );
                }
            }
        }
    }
}

#[test]
fn what_has_died_away_is_left_out() {
    // Each step leaves 3/8 of what the start did: 1e-340 at the end, where 5e-324 would stay for ever.
    let ode = ode(&[("x'", "-20*x + k*f"), ("v'", "x - v")], &["x", "v"]);
    let inputs = wave(800, 0.05);
    let (_, rows) = derivatives(&ode, &course(&inputs, 0.05, 1), &[0.4, -0.2], 0..800);
    assert!(rows.iter().all(|value| !value.is_subnormal()));
    let by_start: Vec<f64> = rows.chunks_exact(16).map(|row| row[1 + 4]).collect();
    for (k, value) in by_start.iter().enumerate() {
        let wanted = 0.375_f64.powi(k as i32);
        // What is below 1e-154 goes with the next block of samples.
        assert!(if wanted > 1e-154 {
            (value / wanted - 1.0).abs() < 1e-12
        } else {
            k < 384 || *value == 0.0
        });
    }
}

#[test]
fn many_columns_side_by_side_are_each_of_them_alone() {
    let n = 37;
    let states: Vec<String> = (0..n).map(|k| format!("x{k}")).collect();
    let equation = |k: usize| match k {
        0 => ("m*x0'".to_string(), "f - c*x0 + 0.1*x3".to_string()),
        7 => ("x7' + 0.2*x8'".to_string(), "-k*x7^3".to_string()),
        _ => (format!("x{k}'"), format!("x{} - sin(x{k})", k - 1)),
    };
    let model = ModelText {
        equations: (0..n).map(equation).collect(),
        outputs: ["x36 + x5", "x3'", "x20*x7 + tau*f"].map(String::from).to_vec(),
        delays: vec!["tau".to_string()],
        states,
        ..text(&[], &[])
    };
    let ode = OdeModel::new(&ModelTape::new(&model).unwrap()).unwrap();
    let inputs = wave(41, 0.05);
    let initial: Vec<f64> = (0..n).map(|k| 0.3 * (k as f64).sin()).collect();
    let (mut setting, mut states) = (Setting::default(), Vec::new());
    setting.prepare(&ode, &VALUES, &course(&inputs, 0.05, 2)).unwrap();
    setting.run(&ode, 0..41, &initial, &[0.1], &mut states, None).unwrap();
    let trajectory =
        Trajectory { ode: &ode, setting: &setting, range: 0..41, states: &states, shift: &[0.1] };
    // Columns: parameters, states, the shift.
    let run = |parameters: &[usize], own: &[usize], shift: &[usize]| {
        let directions = Directions { parameters, n_initial: own.len(), shift };
        let count = directions.count();
        let mut seeds = vec![0.0; n * count];
        own.iter().enumerate().for_each(|(k, &i)| seeds[i * count + parameters.len() + k] = 1.0);
        let mut rows = Vec::new();
        let mut sink = |_: usize, block: &mut [f64]| rows.extend_from_slice(block);
        let mut sensitivity = TrajectorySensitivity::default();
        sensitivity.run(&trajectory, &VALUES, &directions, &seeds, count + 1, &mut sink).unwrap();
        (rows, sensitivity.end(&ode, 8, 0))
    };
    let every: Vec<usize> = (0..n).collect();
    let (together, _) = run(&[3, 0, 1, 2], &every, &[0]);
    for column in 0..n + 5 {
        let (alone, end) = match column {
            0..4 => run(&[[3, 0, 1, 2][column]], &[], &[]),
            _ if column < n + 4 => run(&[], &[column - 4], &[]),
            _ => run(&[], &[], &[0]),
        };
        for (row, alone) in together.chunks_exact(n + 6).zip(alone.chunks_exact(2)) {
            assert_eq!(row[0], alone[0]);
            assert_eq!(row[1 + column], alone[1], "{column}");
        }
        assert!(end.is_finite());
    }
}

#[test]
fn part_of_a_record_is_what_the_whole_run_does_there() {
    let ode = ode(&PENDULUM, &["x", "v"]);
    let inputs = wave(41, 0.05);
    let course = course(&inputs, 0.05, 2);
    let mut setting = Setting::default();
    setting.prepare(&ode, &VALUES, &course).unwrap();
    let (mut states, mut whole) = (Vec::new(), vec![0.0; 82]);
    setting.run(&ode, 0..41, &[0.4, -0.2], &[0.1], &mut states, Some(&mut whole)).unwrap();
    let middle = states[17 * 2 * 2..][..2].to_vec();
    let mut part = vec![0.0; 82];
    setting.run(&ode, 17..30, &middle, &[0.1], &mut states, Some(&mut part)).unwrap();
    assert_eq!(part[17..30], whole[17..30]);
    assert_eq!(states.len(), 2 * (13 * 2 + 1));
}

#[test]
fn what_cannot_run_is_refused() {
    let inputs = wave(400, 0.1);
    let mut setting = Setting::default();
    let explosive = ode(&[("x'", "x^2 + f^2"), ("v'", "k*v")], &["x"]);
    setting.prepare(&explosive, &VALUES, &course(&inputs, 0.1, 1)).unwrap();
    let mut y = vec![0.0; 400];
    let found = setting.run(&explosive, 0..400, &[1.0, 0.0], &[0.0], &mut Vec::new(), Some(&mut y));
    assert!(matches!(found, Err(CoreError::Diverged { .. })), "{found:?}");
    let root = ode(&[("x'", "-1"), ("v'", "sqrt(x)")], &["x"]);
    setting.prepare(&root, &VALUES, &course(&inputs, 0.1, 1)).unwrap();
    let found = setting.run(&root, 0..400, &[1.0, 0.0], &[0.0], &mut Vec::new(), Some(&mut y));
    assert!(matches!(found, Err(CoreError::Diverged { .. })), "{found:?}");
    let singular = ode(&[("x' + v'", "f"), ("2*x' + 2*v'", "k*x")], &["x"]);
    let found = setting.prepare(&singular, &VALUES, &course(&inputs, 0.1, 1));
    assert!(matches!(found, Err(CoreError::Singular { .. })));
    let crossing = ode(&[("x'", "-1"), ("x*v'", "f")], &["x"]);
    setting.prepare(&crossing, &VALUES, &course(&inputs, 0.1, 1)).unwrap();
    let found = setting.run(&crossing, 0..400, &[0.0, 0.0], &[0.0], &mut Vec::new(), Some(&mut y));
    assert!(matches!(found, Err(CoreError::Singular { .. })), "{found:?}");
    let squared = ModelText { ..text(&[("x'", "v"), ("v'*abs(v')", "f")], &["x"]) };
    let found = OdeModel::new(&ModelTape::new(&squared).unwrap());
    assert!(matches!(found, Err(CoreError::Expression { .. })));
    for bad in [course(&inputs, 0.0, 1), course(&inputs, 0.1, 0)] {
        assert!(matches!(setting.prepare(&root, &VALUES, &bad), Err(CoreError::Range { .. })));
    }
    let broken = [f64::NAN];
    let found = setting.prepare(&root, &VALUES, &course(&broken, 0.1, 1));
    assert!(matches!(found, Err(CoreError::NotFinite { .. })));
}
