//! Formulas from a stranger's model file: parse, collect in s, compile, evaluate with derivatives.
#![no_main]

use std::collections::BTreeMap;

use flightid_core::language::expression::Expression;
use flightid_core::language::laplace_polynomial;
use flightid_core::tape::expression_tape::{Registers, Tape};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(expression) = Expression::parse(text) else {
        return;
    };
    let names: Vec<String> = expression.names().into_iter().map(String::from).collect();
    let factors = laplace_polynomial::coefficients(&expression, "s").unwrap_or_default();
    for each in [vec![expression], factors] {
        let Ok(tape) = Tape::compile(&each, &names, &BTreeMap::new()) else {
            continue;
        };
        let (n, m) = (tape.n_outputs(), names.len().min(8));
        let inputs = vec![0.7; names.len()];
        let directions: Vec<usize> = (0..m).collect();
        let (mut values, mut jacobian) = (vec![0.0; n], vec![0.0; n * m]);
        let registers = &mut Registers::default();
        let _ = tape.jacobian(&inputs, &directions, registers, &mut values, &mut jacobian);
    }
});
