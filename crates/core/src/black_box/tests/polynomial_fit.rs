use super::*;
use crate::numerics::random::Random;

fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut source = Random::new(seed);
    (0..n).map(|_| source.normal()).collect()
}

fn general() -> (Orders, Vec<f64>) {
    let orders = Orders { a: 1, b: vec![2, 1], c: 2, d: 1, f: vec![1, 2], delays: vec![1, 0] };
    (orders, vec![-0.4, 1.0, 0.5, 0.3, 0.2, -0.1, 0.3, -0.5, -0.9, 0.4])
}

/// The same with one F under both inputs.
fn shared() -> (Orders, Vec<f64>) {
    let (orders, theta) = general();
    (Orders { f: vec![2], ..orders }, [&theta[..7], &[-0.9, 0.4]].concat())
}

fn compare_with_differences(before: &Before, levels: bool, tolerance: f64) {
    for (orders, theta) in [general(), shared()] {
        compare(orders, &theta, before.clone(), levels, tolerance);
    }
}

/// The triangle must be that of finite differences: RᵀR = JᵀJ and Rᵀ(Qᵀr) = Jᵀr.
fn compare(orders: Orders, theta: &[f64], before: Before, levels: bool, tolerance: f64) {
    let mut channels: Vec<Vec<f64>> = (0..6).map(|k| noise(k, 900)).collect();
    channels[0].iter_mut().for_each(|y| *y += 3.0);
    let record = |k: usize| Samples {
        output: &channels[3 * k],
        inputs: vec![&channels[3 * k + 1], &channels[3 * k + 2]],
    };
    let n = theta.len();
    let mut problem =
        PredictionError::new(orders, vec![record(0), record(1)], before, 3, false).unwrap();
    problem.levels = levels;
    let m = problem.n_residuals();
    let mut residuals = vec![0.0; m];
    let mut triangle = vec![0.0; (n + 1) * (n + 1)];
    problem.residuals(theta, &mut residuals).unwrap();
    assert!(problem.triangle(theta, &mut triangle).unwrap());
    let step = 1e-6;
    let mut columns = vec![vec![0.0; m]; n];
    for (k, column) in columns.iter_mut().enumerate() {
        let mut sides = [vec![0.0; m], vec![0.0; m]];
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let mut moved = theta.to_vec();
            moved[k] += sign * step;
            problem.residuals(&moved, side).unwrap();
        }
        for (row, entry) in column.iter_mut().enumerate() {
            *entry = (sides[0][row] - sides[1][row]) / (2.0 * step);
        }
    }
    columns.push(residuals);
    let of_triangle = |k: usize| &triangle[k * (n + 1)..(k + 1) * (n + 1)];
    for i in 0..=n {
        for j in 0..=n {
            // Kaufman's form leaves out a part of JᵀJ that the residual makes, never of Jᵀr.
            if i < n && j < n && tolerance > 1e-4 {
                continue;
            }
            let exact = crate::numerics::householder::dot(&columns[i], &columns[j]);
            let made = crate::numerics::householder::dot(of_triangle(i), of_triangle(j));
            let scale = norm(&columns[i]) * norm(&columns[j]);
            assert!((exact - made).abs() < 1e-6 * scale, "{i} {j}: {exact} {made}");
        }
    }
}

#[test]
fn derivatives_from_rest_are_exact() {
    compare_with_differences(&Before::Rest, false, 1e-6);
}

#[test]
fn the_gradient_is_exact_where_the_past_is_fitted() {
    compare_with_differences(&Before::Unknown, false, 1e-3);
}

#[test]
fn the_gradient_is_exact_where_a_level_is_fitted() {
    compare_with_differences(&Before::Unknown, true, 1e-3);
    compare_with_differences(&Before::Rest, true, 1e-3);
}

#[test]
fn a_level_is_found_beside_the_coefficients_and_costs_nothing_else() {
    let u: Vec<f64> = (0..300).map(|t| f64::from((t * t) % 11) - 5.0).collect();
    let orders = Orders { a: 0, b: vec![1], c: 0, d: 0, f: vec![1], delays: vec![1] };
    for before in [Before::Unknown, Before::Rest] {
        let mut y = vec![0.0; 300];
        for t in 1..300 {
            y[t] = 0.8 * y[t - 1] + 2.0 * u[t - 1];
        }
        y.iter_mut().for_each(|value| *value += 7.0);
        let record = Samples { output: &y, inputs: vec![&u] };
        let mut problem =
            PredictionError::new(orders.clone(), vec![record], before, 0, false).unwrap();
        problem.levels = true;
        let (runs, _) = problem.runs(&[2.0, -0.8]).unwrap();
        assert!((runs[0].level + 7.0).abs() < 1e-9, "{}", runs[0].level);
        assert!(norm(&runs[0].error) < 1e-9);
    }
}

#[test]
fn a_past_that_is_given_enters_the_errors_and_their_derivatives() {
    let (orders, _) = general();
    let (inputs, of_noise) = orders.memory();
    let count = inputs.iter().sum::<usize>() + of_noise;
    let given = Before::Given(vec![noise(20, count), noise(21, count)]);
    compare_with_differences(&given, false, 1e-6);
}

#[test]
fn regression_names_the_first_dependent_column() {
    let (y, u) = (noise(1, 100), noise(2, 100));
    let orders = Orders { a: 1, b: vec![1, 1], c: 0, d: 0, f: vec![0, 0], delays: vec![1, 1] };
    let twins = Samples { output: &y, inputs: vec![&u, &u] };
    let mut problem = PredictionError::new(orders, vec![twins], Before::Rest, 1, false).unwrap();
    let found = regress(&mut problem).unwrap();
    assert_eq!((found.dependent, found.n_rows), (Some(2), 99));
}

#[test]
fn data_that_do_not_fit_are_refused() {
    let (y, short) = (noise(1, 10), noise(2, 9));
    let orders = || Orders { a: 1, b: vec![1], c: 0, d: 0, f: vec![0], delays: vec![1] };
    let make = |output: &[f64], input: &[f64], before| {
        PredictionError::new(
            orders(),
            vec![Samples { output, inputs: vec![input] }],
            before,
            0,
            false,
        )
        .map(|_| ())
    };
    assert!(matches!(make(&y, &short, Before::Rest), Err(CoreError::Shape { .. })));
    let holes = [&y[..9], &[f64::NAN]].concat();
    assert!(matches!(make(&y, &holes, Before::Rest), Err(CoreError::NotFinite { .. })));
    assert!(matches!(make(&y, &y, Before::Given(vec![])), Err(CoreError::Shape { .. })));
    let two = Orders { delays: vec![1, 1], ..orders() };
    assert!(PredictionError::new(two, vec![], Before::Rest, 0, false).is_err());
}
