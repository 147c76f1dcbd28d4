use super::*;
use crate::expression::Expression;
use crate::tape::Registers;
use proptest::prelude::*;
use std::collections::BTreeMap;

const NAMES: [&str; 3] = ["a", "b", "c"];

fn tape(texts: &[&str]) -> Tape {
    let expressions: Vec<_> = texts.iter().map(|t| Expression::parse(t).unwrap()).collect();
    let names: Vec<_> = NAMES.iter().map(ToString::to_string).collect();
    Tape::compile(&expressions, &names, &BTreeMap::new()).unwrap()
}

const TEXTS: [&str; 12] = [
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
