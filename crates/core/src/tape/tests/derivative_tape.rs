use super::*;
use crate::language::expression::Expression;
use crate::language::lookup_table::{Interpolation, LookupTable, Outside};
use crate::tape::expression_tape::Registers;
use proptest::prelude::*;
use std::collections::BTreeMap;

const NAMES: [&str; 3] = ["a", "b", "c"];

fn tape(texts: &[&str]) -> Tape {
    let called = ["lift", "polar"];
    let parse = |text: &&str| Expression::parse_with(text, &called).unwrap();
    let expressions: Vec<_> = texts.iter().map(parse).collect();
    let names: Vec<_> = NAMES.iter().map(ToString::to_string).collect();
    let (points, more) = (vec![0.0, 0.5, 1.2, 3.0], vec![0.0, 1.0, 3.0]);
    let values: Vec<f64> = (0..12).map(|k| f64::from(k * k % 7)).collect();
    let new = |axes, values, kind| LookupTable::new(axes, values, kind, Outside::Hold).unwrap();
    let lift = new(vec![points.clone()], values[..4].to_vec(), Interpolation::Pchip);
    let polar = new(vec![points, more], values, Interpolation::Cubic);
    let tables = BTreeMap::from([("lift".to_string(), lift), ("polar".to_string(), polar)]);
    Tape::compile_with(&expressions, &names, &BTreeMap::new(), &tables).unwrap()
}

const TEXTS: [&str; 15] = [
    "sin(a)*cos(b) - tan(c)/(1 + a^2)",
    "asin(a/9) + acos(b/9)*atan(c)",
    "sinh(a) + cosh(b)*tanh(a*c)",
    "exp(-a)*log(b + 3) + sqrt(c + 3)",
    "abs(a - b) + sign(c)*a",
    "a^b + (b + c)^2.5 + a^1 + c^0 + b^-2",
    "atan2(a, b)*c",
    "min(a, b)*max(b, c) + min(c, 0.5*a)",
    "-a*-1 + b/3 + 4",
    "2*(a + a)*b - a/a",
    "max(1, a)^2 / (b - 7)",
    "7",
    "where(a < b, a^2*c, b) + where(a >= c, 3, c*b)*clip(a, 0.5, 1.5)",
    "lift(a)*lift(b^2) + deadband(a, 0.3*c)",
    "polar(a, b)*c + polar(1, c) + saturation(b, a)",
];

proptest! {
    #[test]
    fn agree_with_dual_numbers(a in 0.2..2.0f64, b in 0.2..2.0f64, c in 0.2..2.0f64) {
        let plain = tape(&TEXTS);
        let at = [a, b, c];
        let n = TEXTS.len();
        let (mut values, mut jacobian) = (vec![0.0; n], vec![0.0; 3 * n]);
        let registers = &mut Registers::default();
        plain.jacobian(&at, &[0, 1, 2], registers, &mut values, &mut jacobian).unwrap();
        let (longer, entries) = plain.differentiated().unwrap();
        let mut all = Vec::new();
        longer.run(&at, &mut all, &mut vec![0.0; n]);
        for row in 0..n {
            for column in 0..3 {
                let found = entries.iter().find(|e| (e.row, e.column) == (row, column));
                let found = found.map_or(0.0, |entry| all[entry.register]);
                let wanted = jacobian[row * 3 + column];
                let close = (found - wanted).abs() <= 1e-12 * wanted.abs().max(1.0);
                prop_assert!(close, "{} by {}: {found} {wanted}", TEXTS[row], NAMES[column]);
            }
        }
    }
}

#[test]
fn only_what_can_change_has_an_entry() {
    let (_, entries) = tape(&["2*a + sign(b)", "c^0", "a*b"]).differentiated().unwrap();
    let places: Vec<_> = entries.iter().map(|e| (e.row, e.column)).collect();
    assert_eq!(places, [(0, 0), (2, 0), (2, 1)]);
}

#[test]
fn ties_go_to_the_first_as_with_dual_numbers() {
    let (longer, entries) = tape(&["min(a, b)", "max(a, b)"]).differentiated().unwrap();
    let mut all = Vec::new();
    longer.run(&[1.0, 1.0, 0.0], &mut all, &mut [0.0; 2]);
    let slopes: Vec<f64> = entries.iter().map(|e| all[e.register]).collect();
    assert_eq!(slopes, [1.0, 0.0, 1.0, 0.0]);
}

#[test]
fn the_slope_of_a_table_is_not_derived_again() {
    let (once, entries) = tape(&["lift(a)"]).differentiated().unwrap();
    let slope = Tape { outputs: vec![entries[0].register], ..once };
    assert!(matches!(slope.differentiated(), Err(CoreError::Expression { .. })));
}
