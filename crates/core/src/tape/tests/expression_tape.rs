use super::*;
use proptest::prelude::*;

fn tape(texts: &[&str], names: &[&str]) -> Tape {
    let expressions: Vec<_> = texts.iter().map(|t| Expression::parse(t).unwrap()).collect();
    let names: Vec<_> = names.iter().map(ToString::to_string).collect();
    Tape::compile(&expressions, &names, &BTreeMap::new()).unwrap()
}

fn value(text: &str) -> f64 {
    let mut out = [0.0];
    tape(&[text], &["a"]).evaluate(&[3.0], &mut Registers::default(), &mut out).unwrap();
    out[0]
}

#[test]
fn precedence_is_the_textbooks() {
    assert_eq!(value("-a^2"), -9.0);
    assert_eq!(value("2^-1"), 0.5);
    assert_eq!(value("2^3^2"), 512.0);
    assert_eq!(value("a - 1 - 1"), 1.0);
    assert_eq!(value("12/a/2"), 2.0);
    assert_eq!(value("2*a**2 + 1e-1"), 18.1);
    assert_eq!(value("max(a, 4) + min(a, 4) + atan2(0, a)"), 7.0);
    assert_eq!(value("sin(pi/2)"), 1.0);
}

#[test]
fn derivatives_match_complex_differences() {
    let texts = [
        "sin(a)*exp(b*a)/(1 + c^2) - atan2(a, b)",
        "a^b + sqrt(c)*tanh(a - c) + log(a*c) + cosh(b) + tan(a)",
        "asin(a/9) + acos(b/9) + atan(c) + sinh(a) + abs(b - c) + a^3",
    ];
    let tape = tape(&texts, &["a", "b", "c", "d", "e"]);
    let at = [1.3, 0.7, 2.1, 1.0, 1.0];
    let (mut values, mut jacobian) = ([0.0; 3], [0.0; 15]);
    let mut registers = Registers::default();
    tape.jacobian(&at, &[0, 1, 2, 3, 4], &mut registers, &mut values, &mut jacobian).unwrap();
    for column in 0..5 {
        let h = 1e-6;
        let (mut above, mut below) = (at, at);
        above[column] += h;
        below[column] -= h;
        let (mut up, mut down) = ([0.0; 3], [0.0; 3]);
        tape.evaluate(&above, &mut registers, &mut up).unwrap();
        tape.evaluate(&below, &mut registers, &mut down).unwrap();
        for row in 0..3 {
            let central = (up[row] - down[row]) / (2.0 * h);
            assert!((jacobian[row * 5 + column] - central).abs() < 1e-8, "{row} {column}");
        }
    }
}

#[test]
fn definitions_are_followed_and_circles_found() {
    let define = |pairs: &[(&str, &str)]| -> BTreeMap<String, Expression> {
        pairs.iter().map(|(n, t)| (n.to_string(), Expression::parse(t).unwrap())).collect()
    };
    let names = vec!["a".to_string()];
    let wanted = [Expression::parse("x*2").unwrap()];
    let tape = Tape::compile(&wanted, &names, &define(&[("x", "y+1"), ("y", "-2*a")])).unwrap();
    let (mut values, mut jacobian) = ([0.0], [0.0]);
    tape.jacobian(&[3.0], &[0], &mut Registers::default(), &mut values, &mut jacobian).unwrap();
    assert_eq!((values[0], jacobian[0]), (-10.0, -4.0));
    let circle = Tape::compile(&wanted, &names, &define(&[("x", "y"), ("y", "x")]));
    assert_eq!(circle.unwrap_err(), CoreError::Circular { names: "x → y → x".into() });
    let unknown = Tape::compile(&wanted, &names, &BTreeMap::new());
    assert_eq!(unknown.unwrap_err(), CoreError::UnknownName { name: "x".into() });
}

#[test]
fn values_without_meaning_are_errors() {
    let tape = tape(&["log(a)"], &["a"]);
    let result = tape.evaluate(&[-1.0], &mut Registers::default(), &mut [0.0]);
    assert!(matches!(result, Err(CoreError::NotFinite { .. })));
}

proptest! {
    #[test]
    fn whatever_parses_compiles_and_runs(text in "[-+*/^()0-9ab ]{0,60}", a in -9.0..9.0f64) {
        if let Ok(expression) = Expression::parse(&text) {
            let names = vec!["a".to_string(), "b".to_string()];
            if let Ok(tape) = Tape::compile(&[expression], &names, &BTreeMap::new()) {
                let mut registers = Registers::default();
                let _ = tape.jacobian(&[a, 2.0], &[0, 1], &mut registers, &mut [0.0], &mut [0.0; 2]);
            }
        }
    }
}

#[test]
fn choices_take_the_value_and_the_derivative_of_their_branch() {
    assert_eq!(value("where(a > 2, 10, log(-1))"), 10.0);
    assert_eq!(value("if(a <= 3, 1, 0) + where(a < 3, 10, 20) + (a >= 3)"), 22.0);
    assert_eq!(value("clip(a, 0, 2) + saturation(-a, 1) + deadband(a, 0.5)"), 3.5);
    assert_eq!(value("deadband(-a, 0.5) + deadband(0.2*a, 1)"), -2.5);
    assert_eq!(value("where(and(a > 1, not(a > 2)), 1, 2) + where(or(a > 9, a > 2), 10, 0)"), 12.0);
    let tape = tape(&["where(a < b, a^2, b)", "clip(a*b, -1, 1)", "deadband(a, b)"], &["a", "b"]);
    let (mut values, mut jacobian) = ([0.0; 3], [0.0; 6]);
    let registers = &mut Registers::default();
    tape.jacobian(&[2.0, 3.0], &[0, 1], registers, &mut values, &mut jacobian).unwrap();
    assert_eq!(jacobian, [4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    tape.jacobian(&[4.0, 0.2], &[0, 1], registers, &mut values, &mut jacobian).unwrap();
    assert_eq!(values, [0.2, 0.8, 3.8]);
    assert_eq!(jacobian, [0.0, 1.0, 0.2, 4.0, 1.0, -1.0]);
}

#[test]
fn tables_are_called_by_name() {
    use crate::language::lookup_table::{Interpolation, Outside};
    let line = LookupTable::new(
        vec![vec![0.0, 1.0, 3.0]],
        vec![1.0, 2.0, 8.0],
        Interpolation::Linear,
        Outside::Refuse,
    )
    .unwrap();
    let tables = BTreeMap::from([("lift".to_string(), line)]);
    let names = ["a".to_string()];
    let compile = |text: &str| {
        let parsed = Expression::parse_with(text, &["lift"])?;
        Tape::compile_with(&[parsed], &names, &BTreeMap::new(), &tables)
    };
    let tape = compile("2*lift(a^2)").unwrap();
    let (mut values, mut jacobian) = ([0.0], [0.0]);
    let registers = &mut Registers::default();
    tape.jacobian(&[1.5], &[0], registers, &mut values, &mut jacobian).unwrap();
    assert_eq!((values, jacobian), ([11.5], [18.0]));
    let refused = tape.evaluate(&[2.0], registers, &mut values);
    assert!(matches!(refused, Err(CoreError::NotFinite { .. })));
    assert!(matches!(compile("lift(a, a)"), Err(CoreError::Shape { .. })));
    assert!(matches!(compile("lift(a, a, a)"), Err(CoreError::Expression { .. })));
    assert!(matches!(compile("drag(a)"), Err(CoreError::Expression { .. })));
    let unknown = Expression::parse_with("drag(a)", &["drag"]).unwrap();
    let compiled = Tape::compile_with(&[unknown], &names, &BTreeMap::new(), &tables);
    assert!(matches!(compiled, Err(CoreError::UnknownName { .. })));
}

#[test]
fn quadratic_is_what_has_constant_second_derivatives() {
    let names = ["a", "b", "c"];
    for text in ["a*b - 2*(b + c)/3", "-(a + b)*(a - c)", "7", "a^2*0 + b"] {
        assert_eq!(tape(&[text], &names).is_quadratic(), !text.contains('^'), "{text}");
    }
    for text in ["a*b*c", "a/b", "sin(a)", "b + a*(b*c - 1)", "max(a, b)"] {
        assert!(!tape(&["a", text], &names).is_quadratic(), "{text}");
    }
}
