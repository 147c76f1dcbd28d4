//! Whole models from a stranger: states, equations, outputs, delays, definitions and tables, one a line;
//! compile, linearise, and take first and second derivatives by the parameters.
#![no_main]

use flightid_core::language::lookup_table::{Interpolation, LookupTable, Outside};
use flightid_core::state_space::model_tape::{ModelTape, ModelText};
use libfuzzer_sys::fuzz_target;

const MOST: usize = 6;

/// `t name kind outside | first axis | second axis | values`, kind and outside by their initials.
fn table(line: &str) -> Option<(String, LookupTable)> {
    let (head, numbers) = line.split_once('|')?;
    let words: Vec<&str> = head.split_whitespace().collect();
    let &[name, kind, outside] = words.as_slice() else { return None };
    let kind = match kind {
        "l" => Interpolation::Linear,
        "p" => Interpolation::Pchip,
        _ => Interpolation::Cubic,
    };
    let outside = match outside {
        "h" => Outside::Hold,
        "l" => Outside::Linear,
        _ => Outside::Refuse,
    };
    let mut lists: Vec<Vec<f64>> = numbers
        .split('|')
        .map(|list| list.split_whitespace().filter_map(|word| word.parse().ok()).collect())
        .collect();
    let values = lists.pop()?;
    Some((name.to_string(), LookupTable::new(lists, values, kind, outside).ok()?))
}

fn text(source: &str) -> ModelText {
    let mut text = ModelText { parameters: vec!["a".into(), "b".into()], ..Default::default() };
    for line in source.lines().take(64) {
        let Some((kind, rest)) = line.split_once(' ') else { continue };
        let sides = rest.split_once('=').map(|(l, r)| (l.trim().to_string(), r.to_string()));
        match (kind, sides) {
            ("s", _) if text.states.len() < MOST => text.states.push(rest.trim().to_string()),
            ("i", _) if text.inputs.len() < MOST => {
                text.inputs.push(rest.trim().to_string());
                text.delays.push("a^2*b".to_string());
            }
            ("e", Some(sides)) => text.equations.push(sides),
            ("o", _) if text.outputs.len() < MOST => text.outputs.push(rest.to_string()),
            ("d", Some((name, formula))) => {
                text.definitions.insert(name, formula);
            }
            ("t", _) => text.tables.extend(table(rest)),
            _ => {}
        }
    }
    text.equations.truncate(text.states.len());
    text
}

fuzz_target!(|source: &str| {
    let text = text(source);
    let Ok(tape) = ModelTape::new(&text) else {
        return;
    };
    let (point, values) = (vec![0.3; tape.width()], [0.7, 1.2]);
    if let Ok(found) = tape.linearise(&point, &values) {
        assert!(found.values.iter().chain(&found.slopes).all(|value| value.is_finite()));
    }
    let _ = tape.sensitivities(&point, &values, &[0, 1]);
    if let Ok(found) = tape.curvatures(&point, &values, &[0, 1]) {
        assert!(found.iter().all(|each| each.first <= each.second && each.value.is_finite()));
    }
});
