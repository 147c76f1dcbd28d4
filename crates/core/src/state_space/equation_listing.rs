//! A model's equations as a plain list of operations, for whatever writes them in another language.
//! (Python side: export/equation_code.py)

use crate::error::CoreError;
use crate::state_space::model_tape::ModelTape;
use crate::state_space::ode_model::OdeModel;
use crate::tape::operation::Operation;

/// One operation; its arguments are places of earlier lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// `"constant"`, `"input"`, `"select"`, `"table"` or the function in lower case.
    pub kind: String,
    /// Value of a constant.
    pub number: f64,
    /// Lines it reads; for an input its place in ẋ, x, u, θ; for a table its place, then two lines.
    pub arguments: Vec<usize>,
}

/// Residuals left − right, the factors M of ẋ in them, outputs and delays, as places of lines.
#[derive(Debug, Clone)]
pub struct Listing {
    /// Operations in the order of their computation.
    pub lines: Vec<Line>,
    /// Line of each residual.
    pub residuals: Vec<usize>,
    /// Row, column and line of each factor that is not always zero.
    pub mass: Vec<(usize, usize, usize)>,
    /// Line of each output.
    pub outputs: Vec<usize>,
    /// Line of each delay.
    pub delays: Vec<usize>,
}

impl ModelTape {
    /// The model as a list of operations.
    ///
    /// # Errors
    /// `Expression` where a state derivative does not enter linearly, or the list would be too long.
    pub fn listing(&self) -> Result<Listing, CoreError> {
        OdeModel::new(self)?;
        let n = self.n_states();
        let (tape, entries) = self.tape().differentiated()?;
        let mass: Vec<_> = entries.iter().filter(|e| e.row < n && e.column < n).collect();
        let outputs = &self.tape().outputs;
        let wanted: Vec<usize> =
            outputs.iter().copied().chain(mass.iter().map(|entry| entry.register)).collect();
        let needed = tape.needed(&wanted);
        let mut places = vec![0; tape.operations.len()];
        let mut lines = Vec::new();
        for (register, operation) in tape.operations.iter().enumerate().filter(|e| needed[e.0]) {
            places[register] = lines.len();
            lines.push(line(&operation.moved(&places)));
        }
        let at = |registers: &[usize]| registers.iter().map(|&r| places[r]).collect();
        let height = self.height();
        Ok(Listing {
            residuals: at(&outputs[..n]),
            mass: mass.iter().map(|e| (e.row, e.column, places[e.register])).collect(),
            outputs: at(&outputs[n..height]),
            delays: at(&outputs[height..]),
            lines,
        })
    }
}

fn line(operation: &Operation) -> Line {
    let named = |kind: &dyn std::fmt::Debug| format!("{kind:?}").to_lowercase();
    let (kind, number, arguments) = match *operation {
        Operation::Constant(number) => ("constant".into(), number, vec![]),
        Operation::Input(place) => ("input".into(), 0.0, vec![place]),
        Operation::Unary(function, a) => (named(&function), 0.0, vec![a]),
        Operation::Binary(function, a, b) => (named(&function), 0.0, vec![a, b]),
        Operation::Select(test, a, b) => ("select".into(), 0.0, vec![test, a, b]),
        Operation::Table(table, part, a, b) => {
            let kind = format!("table {}", named(&part));
            (kind, 0.0, vec![table, a, b])
        }
    };
    Line { kind, number, arguments }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state_space::model_tape::ModelText;

    #[test]
    fn factors_and_residuals_are_listed_without_what_nobody_needs() {
        let words = |list: &[&str]| list.iter().map(|w| (*w).to_string()).collect::<Vec<_>>();
        let text = ModelText {
            states: words(&["x"]),
            inputs: words(&["u"]),
            equations: vec![("m*x'".into(), "u - k*x".into())],
            outputs: words(&["x"]),
            delays: words(&["0"]),
            parameters: words(&["m", "k"]),
            ..ModelText::default()
        };
        let found = ModelTape::new(&text).unwrap().listing().unwrap();
        assert_eq!(found.mass.len(), 1);
        let (row, column, place) = found.mass[0];
        assert_eq!((row, column), (0, 0));
        assert_eq!(
            found.lines[place],
            Line { kind: "input".into(), number: 0.0, arguments: vec![3] }
        );
        assert_eq!(found.lines[found.residuals[0]].kind, "subtract");
        assert!(found.lines.iter().all(|line| line.kind != "sin"));
    }

    #[test]
    fn a_squared_state_derivative_is_refused() {
        let words = |list: &[&str]| list.iter().map(|w| (*w).to_string()).collect::<Vec<_>>();
        let text = ModelText {
            states: words(&["x"]),
            equations: vec![("x'^2".into(), "x".into())],
            outputs: words(&["x"]),
            ..ModelText::default()
        };
        let found = ModelTape::new(&text).unwrap().listing();
        assert!(matches!(found, Err(CoreError::Expression { .. })));
    }
}
