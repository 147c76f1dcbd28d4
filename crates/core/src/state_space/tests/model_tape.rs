use super::*;
use proptest::prelude::*;

pub(crate) fn text(equations: &[(&str, &str)], outputs: &[&str]) -> ModelText {
    let own = |names: &[&str]| names.iter().map(|name| (*name).to_string()).collect::<Vec<_>>();
    ModelText {
        states: own(&["x", "v"]),
        inputs: own(&["f"]),
        equations: equations.iter().map(|(l, r)| ((*l).to_string(), (*r).to_string())).collect(),
        outputs: own(outputs),
        delays: own(&["2*tau"]),
        parameters: own(&["m", "c", "k", "tau"]),
        definitions: BTreeMap::from([("twice".to_string(), "2*c*m".to_string())]),
        tables: BTreeMap::new(),
    }
}

const VALUES: [f64; 4] = [2.0, 0.3, 5.0, 0.01];

#[test]
fn matrices_are_the_coefficients() {
    let text =
        text(&[("x'", "v"), ("m*v' + c*x'", "-k*x - twice*v + f/m")], &["v' - k*x", "x + 3*f"]);
    let tape = ModelTape::new(&text).unwrap();
    let found = tape.linearise(&[0.0; 5], &VALUES).unwrap();
    // Columns x', v', x, v, f; rows are left − right, then the outputs.
    let expected = [
        [1.0, 0.0, 0.0, -1.0, 0.0],
        [0.3, 2.0, 5.0, 1.2, -0.5],
        [0.0, 1.0, -5.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 3.0],
    ];
    assert_eq!(found.slopes, expected.concat());
    assert_eq!(found.values[4], 0.02);
    let slopes = tape.sensitivities(&[0.0; 5], &VALUES, &[1, 0]).unwrap();
    let entry = |row, column, parameter| {
        slopes
            .iter()
            .find(|s| (s.row, s.column, s.parameter) == (row, column, parameter))
            .map(|s| s.value)
    };
    assert_eq!(entry(1, 0, 0), Some(1.0)); // ∂M/∂c
    assert_eq!(entry(1, 3, 0), Some(4.0)); // −∂F/∂c = 2m, through the tie
    assert_eq!(entry(1, 3, 1), Some(0.6)); // −∂F/∂m = 2c
    assert_eq!(entry(1, 4, 1), Some(0.25)); // −∂G/∂m = 1/m²
    assert_eq!(slopes.len(), 5);
    assert_eq!(tape.delay_slopes(&[0.0; 5], &VALUES, &[3, 0]).unwrap(), [2.0, 0.0]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let good = text(&[("x'", "v"), ("m*v'", "f")], &["x"]);
    let tape = ModelTape::new(&good).unwrap();
    assert!(matches!(tape.linearise(&[0.0; 4], &VALUES), Err(CoreError::Shape { .. })));
    assert!(matches!(tape.linearise(&[0.0; 5], &[1.0]), Err(CoreError::Shape { .. })));
    assert!(matches!(tape.sensitivities(&[0.0; 5], &VALUES, &[4]), Err(CoreError::Shape { .. })));
    let short = text(&[("x'", "v")], &["x"]);
    assert!(matches!(ModelTape::new(&short), Err(CoreError::Shape { .. })));
    let unknown = text(&[("x'", "w"), ("v'", "f")], &["x"]);
    assert!(matches!(ModelTape::new(&unknown), Err(CoreError::UnknownName { .. })));
}

proptest! {
    #[test]
    fn sensitivities_match_differences_of_the_slopes(
        point in prop::collection::vec(0.2_f64..1.5, 5),
        values in prop::collection::vec(0.3_f64..2.0, 4),
    ) {
        let text = text(
            &[("x'", "v"), ("m*v' + c*x'*v'", "-k*sin(x) - twice*v^2 + f*exp(-c*x)/m")],
            &["v'*cos(x)/m - k*x*f", "sqrt(m*x) + tanh(c*f)"],
        );
        let tape = ModelTape::new(&text).unwrap();
        let free = [0, 1, 2, 3];
        let mut dense = vec![0.0; 4 * 20];
        for s in tape.sensitivities(&point, &values, &free).unwrap() {
            dense[s.parameter * 20 + s.row * 5 + s.column] = s.value;
        }
        for k in 0..4 {
            let at = |change: f64| {
                let mut moved = values.clone();
                moved[k] += change;
                tape.linearise(&point, &moved).unwrap().slopes
            };
            let h = 1e-5;
            for (i, (up, down)) in at(h).iter().zip(at(-h)).enumerate() {
                let central = (up - down) / (2.0 * h);
                prop_assert!((dense[k * 20 + i] - central).abs() < 1e-7 * (1.0 + central.abs()));
            }
        }
    }

    #[test]
    fn any_text_compiles_or_is_refused(left in "[-+*/^()'0-9xvfm ]{0,40}", right in "\\PC{0,40}") {
        let text = text(&[("x'", "v"), (left.as_str(), right.as_str())], &["x"]);
        if let Ok(tape) = ModelTape::new(&text) {
            let _ = tape.linearise(&[0.0; 5], &VALUES);
        }
    }
}
