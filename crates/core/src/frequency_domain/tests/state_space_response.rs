use super::*;
use crate::state_space::model_tape::tests::text;

const VALUES: [f64; 4] = [2.0, 0.3, 5.0, 0.01];
const PAIRS: [(usize, usize); 2] = [(0, 0), (1, 0)];

fn example() -> ModelTape {
    let equations = [("x'", "v"), ("m*v' + c*x'", "-k*x - twice*v + f/m")];
    ModelTape::new(&text(&equations, &["v' - k*x", "x + c*f"])).unwrap()
}

#[test]
fn value_is_the_formula() {
    let tape = example();
    let mut model =
        FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &VALUES, &[], [7.0, 3.0]).unwrap();
    model.prepare(&[], false).unwrap();
    for omega in [7.0, 3.0] {
        let s = Complex64::new(0.0, omega);
        let x = 0.5 / (2.0 * s * s + (0.3 + 1.2) * s + 5.0);
        let late = Complex64::cis(-0.02 * omega);
        let expected = [(s * s - 5.0) * x * late, (x + 0.3) * late];
        for (place, wanted) in expected.into_iter().enumerate() {
            assert!((model.response(place, omega, None) - wanted).norm() < 1e-14);
        }
    }
}

#[test]
fn gradient_of_log_matches_differences() {
    let tape = example();
    let free = [3, 0, 1, 2];
    let make =
        || FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &VALUES, &free, [7.0, 2.0]).unwrap();
    let start = free.map(|place| VALUES[place]);
    let mut model = make();
    model.prepare(&start, true).unwrap();
    for (response, omega) in [(0, 7.0), (1, 7.0), (1, 2.0)] {
        let mut gradient = [Complex64::default(); 4];
        model.response(response, omega, Some(&mut gradient));
        for k in 0..4 {
            let h = 1e-6 * start[k];
            let at = |change: f64| {
                let (mut model, mut values) = (make(), start);
                values[k] += change;
                model.prepare(&values, false).unwrap();
                model.response(response, omega, None).ln()
            };
            let central = (at(h) - at(-h)) / (2.0 * h);
            let error = (gradient[k] - central).norm();
            assert!(error < 1e-8 * central.norm().max(1.0), "{response} {k}: {error}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let tape = example();
    let point = [0.0; 5];
    let outside = [(2, 0)];
    let no_output = FreeStateSpace::new(&tape, &outside, &point, &VALUES, &[], []);
    assert!(matches!(no_output, Err(CoreError::Shape { .. })));
    let no_parameter = FreeStateSpace::new(&tape, &PAIRS, &point, &VALUES, &[4], []);
    assert!(matches!(no_parameter, Err(CoreError::Shape { .. })));
}

#[test]
fn a_pole_on_the_axis_is_an_error() {
    let tape = example();
    // No damping: the pole lies at sqrt(k/m).
    let values = [2.0, 0.0, 8.0, 0.0];
    let mut model = FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &values, &[], [2.0]).unwrap();
    assert!(matches!(model.prepare(&[], false), Err(CoreError::Singular { .. })));
}
