use super::*;
use proptest::prelude::*;

fn problem(text: &str) -> (usize, String) {
    match Expression::parse(text) {
        Err(CoreError::Expression { position, problem }) => (position, problem),
        other => panic!("{text:?} gave {other:?}"),
    }
}

#[test]
fn faults_name_their_place() {
    assert_eq!(problem("a + "), (4, "found the end, needed a number, a name or '('".into()));
    assert_eq!(problem("2*foo(x)").0, 2);
    assert!(problem("sin(x, y)").1.contains("does not take 2"));
    assert!(problem("1.2.3").1.contains("not a finite number"));
    assert!(problem("1e999").1.contains("not a finite number"));
    assert!(problem("(a").1.contains("needed ')'"));
    assert!(problem("a b").1.contains("needed an operator"));
    assert!(problem("__import__('os')").1.contains("needed"));
    assert!(problem("ü").1.contains("needed a number"));
}

#[test]
fn hostile_sizes_are_refused() {
    assert!(problem(&"(".repeat(5_000)).1.contains("deeper"));
    assert!(problem(&"-".repeat(5_000)).1.contains("deeper"));
    assert!(problem(&("2^".repeat(4_000) + "2")).1.contains("deeper"));
    assert!(problem(&("a+".repeat(4_000) + "a")).1.contains("more than"));
    assert!(problem(&"a".repeat(20_000)).1.contains("longer"));
}

proptest! {
    #[test]
    fn any_text_parses_or_fails_in_order(text in "\\PC{0,200}") {
        if let Ok(expression) = Expression::parse(&text) {
            prop_assert!(expression.root < expression.nodes.len());
        }
    }

    #[test]
    fn any_formula_text_parses_or_fails_in_order(text in "[-+*/^(),.0-9a-z' ]{0,120}") {
        let _ = Expression::parse(&text);
    }
}
