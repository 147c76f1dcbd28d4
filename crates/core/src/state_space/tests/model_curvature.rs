use super::*;
use crate::state_space::model_tape::tests::text;
use proptest::prelude::*;

proptest! {
    #[test]
    fn curvatures_match_differences_of_the_sensitivities(
        point in prop::collection::vec(0.2_f64..1.5, 5),
        values in prop::collection::vec(0.3_f64..2.0, 4),
    ) {
        let mut text = text(
            &[("x'", "v"), ("m*v' + c*x'*v'", "-k*sin(x)/m - twice*v^2 + f*exp(-c*x*k)/m")],
            &["v'*cos(x)/m - k^2*x*f*tau", "sqrt(m*x) + tanh(c*f)"],
        );
        text.delays = vec!["tau^2*k".to_string()];
        let tape = ModelTape::new(&text).unwrap();
        let free = [0, 1, 2, 3];
        let (height, width) = (tape.height(), tape.width());
        let mut exact = vec![0.0; 16 * (height + 1) * width];
        let place = |i: usize, k: usize, row: usize, column: usize| {
            ((i * 4 + k) * (height + 1) + row) * width + column
        };
        for each in tape.curvatures(&point, &values, &free).unwrap() {
            prop_assert!(each.first <= each.second);
            exact[place(each.first, each.second, each.row, each.column)] = each.value;
        }
        for k in 0..4 {
            let at = |change: f64| {
                let mut moved = values.clone();
                moved[k] += change;
                let mut dense = vec![0.0; 4 * (height + 1) * width];
                for s in tape.sensitivities(&point, &moved, &free).unwrap() {
                    dense[(s.parameter * (height + 1) + s.row) * width + s.column] = s.value;
                }
                for (i, slope) in tape.delay_slopes(&point, &moved, &free).unwrap().iter().enumerate() {
                    dense[(i * (height + 1) + height) * width] = *slope;
                }
                dense
            };
            let h = 1e-5;
            let (up, down) = (at(h), at(-h));
            for i in 0..=k {
                for row in 0..=height {
                    for column in 0..width {
                        let index = (i * (height + 1) + row) * width + column;
                        let central = (up[index] - down[index]) / (2.0 * h);
                        let found = exact[place(i, k, row, column)];
                        prop_assert!((found - central).abs() < 1e-6 * (1.0 + central.abs()));
                    }
                }
            }
        }
    }
}

#[test]
fn a_linear_entry_has_none() {
    let tape = ModelTape::new(&text(&[("x'", "v"), ("m*v'", "k*x + f")], &["x"])).unwrap();
    let found = tape.curvatures(&[0.0; 5], &[2.0, 0.3, 5.0, 0.01], &[0, 1, 2]).unwrap();
    assert!(found.is_empty());
    assert!(matches!(
        tape.curvatures(&[0.0; 5], &[2.0, 0.3, 5.0, 0.01], &[9]),
        Err(CoreError::Shape { .. })
    ));
}
