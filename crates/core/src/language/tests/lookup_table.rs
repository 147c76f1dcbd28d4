use super::*;
use crate::numerics::dual::Dual;
use proptest::prelude::*;

const X: [f64; 5] = [-1.0, 0.0, 0.5, 2.0, 3.0];

fn table(axes: &[&[f64]], values: &[f64], kind: Interpolation, outside: Outside) -> LookupTable {
    let axes = axes.iter().map(|axis| axis.to_vec()).collect();
    LookupTable::new(axes, values.to_vec(), kind, outside).unwrap()
}

fn cubic(x: f64) -> f64 {
    2.0 - x + 0.5 * x * x - 0.25 * x * x * x
}

#[test]
fn a_cubic_is_its_own_spline_with_all_derivatives() {
    let values = X.map(cubic);
    let table = table(&[&X], &values, Interpolation::Cubic, Outside::Refuse);
    type Two = Dual<Dual<f64, 1>, 1>;
    for x in [-0.9, -0.2, 0.3, 1.1, 2.9] {
        let place = Two::variable(Dual::variable(x, 0), 0);
        let found = table.at(place, place);
        assert!((found.value.value - cubic(x)).abs() < 1e-12);
        assert!((found.gradient[0].value - (-1.0 + x - 0.75 * x * x)).abs() < 1e-11);
        assert!((found.gradient[0].gradient[0] - (1.0 - 1.5 * x)).abs() < 1e-10);
    }
}

#[test]
fn two_axes_multiply() {
    let y = [0.0, 1.0, 2.5, 4.0];
    let values: Vec<f64> =
        X.iter().flat_map(|&a| y.iter().map(move |&b| cubic(a) * (1.0 + b * b))).collect();
    let smooth = table(&[&X, &y], &values, Interpolation::Cubic, Outside::Refuse);
    let found = smooth.at(Dual::<f64, 2>::variable(0.7, 0), Dual::variable(3.1, 1));
    let slope = -1.0 + 0.7 - 0.75 * 0.49;
    assert!((found.value - cubic(0.7) * (1.0 + 3.1 * 3.1)).abs() < 1e-11);
    assert!((found.gradient[0] - slope * (1.0 + 3.1 * 3.1)).abs() < 1e-11);
    assert!((found.gradient[1] - cubic(0.7) * 6.2).abs() < 1e-11);
    let plane: Vec<f64> = X.iter().flat_map(|&a| y.iter().map(move |&b| 2.0 * a - b)).collect();
    for kind in [Interpolation::Linear, Interpolation::Pchip, Interpolation::Cubic] {
        let flat = table(&[&X, &y], &plane, kind, Outside::Linear);
        for (a, b) in [(0.2, 0.3), (-4.0, 2.0), (9.0, -3.0), (1.0, 7.0)] {
            assert!((flat.at(a, b) - (2.0 * a - b)).abs() < 1e-12, "{kind:?} {a} {b}");
        }
    }
}

#[test]
fn what_lies_outside_is_held_continued_or_refused() {
    let values = X.map(cubic);
    for kind in [Interpolation::Linear, Interpolation::Pchip, Interpolation::Cubic] {
        let of = |outside| table(&[&X], &values, kind, outside);
        assert_eq!(of(Outside::Hold).at(-7.0, 0.0), values[0]);
        let held = of(Outside::Hold).at(Dual::<f64, 1>::variable(9.0, 0), Dual::constant(0.0));
        assert_eq!((held.value, held.gradient), (values[4], [0.0]));
        assert!(of(Outside::Refuse).at(3.001, 0.0).is_nan());
        assert_eq!(of(Outside::Refuse).at(3.0, 0.0), values[4]);
        let line = of(Outside::Linear);
        let near = line.at(Dual::<f64, 1>::variable(3.0, 0), Dual::constant(0.0));
        assert!((line.at(5.0, 0.0) - (near.value + 2.0 * near.gradient[0])).abs() < 1e-12);
    }
}

#[test]
fn wrong_points_are_refused() {
    let new = |axes: Vec<Vec<f64>>, values: Vec<f64>| {
        LookupTable::new(axes, values, Interpolation::Linear, Outside::Hold)
    };
    assert!(matches!(new(vec![], vec![]), Err(CoreError::Shape { .. })));
    assert!(matches!(new(vec![vec![1.0]], vec![1.0]), Err(CoreError::Shape { .. })));
    assert!(matches!(new(vec![vec![0.0, 0.0]], vec![1.0; 2]), Err(CoreError::Range { .. })));
    assert!(matches!(new(vec![vec![0.0, 1.0]], vec![1.0; 3]), Err(CoreError::Shape { .. })));
    assert!(matches!(
        new(vec![vec![0.0, f64::NAN]], vec![1.0; 2]),
        Err(CoreError::NotFinite { .. })
    ));
    assert!(matches!(
        new(vec![vec![0.0, 1.0]], vec![1.0, f64::NAN]),
        Err(CoreError::NotFinite { .. })
    ));
    let long: Vec<f64> = (0..200).map(f64::from).collect();
    assert!(matches!(
        new(vec![long.clone(), long], vec![0.0; 40_000]),
        Err(CoreError::Shape { .. })
    ));
}

proptest! {
    #[test]
    fn monotone_points_make_a_monotone_curve(rises in prop::collection::vec(0.0_f64..5.0, 5)) {
        let mut values = vec![0.0];
        for rise in &rises[1..] {
            values.push(values[values.len() - 1] + rise);
        }
        let table = table(&[&X], &values, Interpolation::Pchip, Outside::Hold);
        let mut last = f64::NEG_INFINITY;
        for k in 0..=400 {
            let next = table.at(-1.0 + 0.01 * f64::from(k), 0.0);
            prop_assert!(next >= last - 1e-12);
            last = next;
        }
    }
}
