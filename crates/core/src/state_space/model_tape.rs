//! A state-space model as text, compiled: residuals left − right of its equations, outputs and
//! delays, linearised at a point with exact derivatives. (Python side: models/state_space/model.py)
//!
//! With z = [ẋ, x, u] the linear model is M ẋ = F x + G u, y = H₁ ẋ + H₀ x + D u, where
//! [M, −F, −G] = ∂r/∂z and [H₁, H₀, D] = ∂y/∂z.

use std::collections::BTreeMap;

use crate::error::CoreError;
use crate::language::expression::Expression;
use crate::language::lookup_table::LookupTable;
use crate::language::syntax::{Binary, Node};
use crate::numerics::dual::{Dual, Scalar};
use crate::tape::expression_tape::{Registers, Tape};

/// Most derivatives of matrix entries by parameters that are kept.
pub const MAXIMUM_SENSITIVITIES: usize = 2_000_000;
const LANES: usize = 4;
type Inner = Dual<f64, LANES>;
type Outer = Dual<Inner, LANES>;

/// A model as text; the derivative of state `x` is the name `x'`.
#[derive(Debug, Clone, Default)]
pub struct ModelText {
    /// Names of the states.
    pub states: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Left and right side of each equation.
    pub equations: Vec<(String, String)>,
    /// Formula of each output.
    pub outputs: Vec<String>,
    /// Formula of the delay of each input, s.
    pub delays: Vec<String>,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// Formulas of tied parameters and of auxiliary quantities.
    pub definitions: BTreeMap<String, String>,
    /// Tables that formulas may call.
    pub tables: BTreeMap<String, LookupTable>,
}

/// A compiled model.
#[derive(Debug, Clone)]
pub struct ModelTape {
    tape: Tape,
    n_states: usize,
    n_inputs: usize,
    n_outputs: usize,
    bilinear: bool,
}

/// A model linearised at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearisation {
    /// Residuals, outputs and delays at the point.
    pub values: Vec<f64>,
    /// ∂(r, y)/∂z, (n_states + n_outputs) × (2 n_states + n_inputs), row-major.
    pub slopes: Vec<f64>,
}

/// Derivative of one entry of `Linearisation::slopes`, or of one delay, by one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensitivity {
    /// Row: equation, then output.
    pub row: usize,
    /// Column in z.
    pub column: usize,
    /// Place in the list of parameters asked for.
    pub parameter: usize,
    /// Derivative.
    pub value: f64,
}

fn difference(left: Expression, right: Expression) -> Expression {
    let shift = left.nodes.len();
    let mut nodes = left.nodes;
    nodes.extend(right.nodes.iter().map(|node| {
        let places: Vec<usize> = node.children().into_iter().map(|place| place + shift).collect();
        node.with_children(&places)
    }));
    nodes.push(Node::Binary(Binary::Subtract, left.root, right.root + shift));
    let root = nodes.len() - 1;
    Expression { nodes, root }
}

impl ModelTape {
    /// Parse and compile.
    ///
    /// # Errors
    /// `Expression`, `UnknownName` or `Circular` for texts, `Shape` where there is not one equation
    /// for each state and one delay for each input.
    pub fn new(text: &ModelText) -> Result<Self, CoreError> {
        let (n, m) = (text.states.len(), text.inputs.len());
        expect("equations", text.equations.len(), n)?;
        expect("delays", text.delays.len(), m)?;
        let callable: Vec<&String> = text.tables.keys().collect();
        let parse = |formula: &str| Expression::parse_with(formula, &callable);
        let mut expressions = Vec::with_capacity(n + text.outputs.len() + m);
        for (left, right) in &text.equations {
            expressions.push(difference(parse(left)?, parse(right)?));
        }
        for formula in text.outputs.iter().chain(&text.delays) {
            expressions.push(parse(formula)?);
        }
        let mut names: Vec<String> = text.states.iter().map(|name| format!("{name}'")).collect();
        names.extend(text.states.iter().chain(&text.inputs).chain(&text.parameters).cloned());
        let definitions = text
            .definitions
            .iter()
            .map(|(name, formula)| Ok((name.clone(), parse(formula)?)))
            .collect::<Result<_, CoreError>>()?;
        let tape = Tape::compile_with(&expressions, &names, &definitions, &text.tables)?;
        let bilinear = tape.is_quadratic();
        Ok(Self { tape, n_states: n, n_inputs: m, n_outputs: text.outputs.len(), bilinear })
    }

    /// Equations, outputs and delays as one tape of ẋ, x, u and the parameters.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.n_states
    }

    /// Number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.tape.n_inputs() - self.width()
    }

    /// Length of z.
    pub fn width(&self) -> usize {
        2 * self.n_states + self.n_inputs
    }

    /// Equations and outputs.
    pub fn height(&self) -> usize {
        self.n_states + self.n_outputs
    }

    /// Whether all second derivatives are constants, as those of linear models are whose entries
    /// are parameters or sums of them.
    pub fn is_bilinear(&self) -> bool {
        self.bilinear
    }

    pub(crate) fn joined(&self, point: &[f64], parameters: &[f64]) -> Result<Vec<f64>, CoreError> {
        expect("entries of the point", point.len(), self.width())?;
        expect("parameter values", parameters.len(), self.n_parameters())?;
        Ok([point, parameters].concat())
    }

    /// Values and ∂(r, y)/∂z at a point z for parameter values.
    ///
    /// # Errors
    /// `Shape` for lengths that do not fit, `NotFinite` where a value or derivative has no meaning.
    pub fn linearise(&self, point: &[f64], parameters: &[f64]) -> Result<Linearisation, CoreError> {
        let inputs = self.joined(point, parameters)?;
        let directions: Vec<usize> = (0..self.width()).collect();
        let mut values = vec![0.0; self.tape.n_outputs()];
        let mut slopes = vec![0.0; values.len() * self.width()];
        let registers = &mut Registers::default();
        self.tape.jacobian(&inputs, &directions, registers, &mut values, &mut slopes)?;
        slopes.truncate(self.height() * self.width());
        Ok(Linearisation { values, slopes })
    }

    /// Zeros in the place of a linearisation that does not exist.
    pub fn no_linearisation(&self) -> Linearisation {
        let values = vec![0.0; self.tape.n_outputs()];
        Linearisation { values, slopes: vec![0.0; self.height() * self.width()] }
    }

    /// Derivatives, by some of the parameters, of every entry of ∂(r, y)/∂z that has one. Second
    /// derivatives of the tape, from dual numbers of dual numbers.
    ///
    /// # Errors
    /// As `linearise`; `Shape` for a parameter that does not exist.
    pub fn sensitivities(
        &self,
        point: &[f64],
        parameters: &[f64],
        free: &[usize],
    ) -> Result<Vec<Sensitivity>, CoreError> {
        let inputs = self.joined(point, parameters)?;
        let width = self.width();
        self.check_free(free)?;
        let mut found = Vec::new();
        let mut registers: Vec<Outer> = Vec::new();
        let mut outputs = vec![Outer::constant(0.0); self.tape.n_outputs()];
        let mut seeded: Vec<Outer> = Vec::with_capacity(inputs.len());
        for (chunk, lanes) in free.chunks(LANES).enumerate() {
            for start in (0..width).step_by(LANES) {
                seeded.clear();
                seeded.extend(inputs.iter().map(|&value| Outer::constant(value)));
                let count = LANES.min(width - start);
                for lane in 0..count {
                    let place = start + lane;
                    seeded[place] = Outer::variable(Inner::constant(inputs[place]), lane);
                }
                for (lane, &parameter) in lanes.iter().enumerate() {
                    let place = width + parameter;
                    seeded[place].value = Inner::variable(inputs[place], lane);
                }
                if found.len() > MAXIMUM_SENSITIVITIES {
                    let (found, needed) = (found.len(), MAXIMUM_SENSITIVITIES);
                    return Err(CoreError::Shape { what: "derivatives of a model", found, needed });
                }
                self.tape.run(&seeded, &mut registers, &mut outputs);
                for (row, output) in outputs.iter().take(self.height()).enumerate() {
                    for (offset, entry) in output.gradient.iter().take(count).enumerate() {
                        for (lane, &value) in entry.gradient.iter().take(lanes.len()).enumerate() {
                            if value != 0.0 {
                                let (column, parameter) = (start + offset, chunk * LANES + lane);
                                found.push(Sensitivity { row, column, parameter, value });
                            }
                        }
                    }
                }
            }
        }
        match found.iter().position(|each| !each.value.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "second derivative", index }),
            None => Ok(found),
        }
    }

    /// Derivatives of the delays by some of the parameters, n_inputs × n_free.
    ///
    /// # Errors
    /// As `sensitivities`.
    pub fn delay_slopes(
        &self,
        point: &[f64],
        parameters: &[f64],
        free: &[usize],
    ) -> Result<Vec<f64>, CoreError> {
        Ok(self.value_slopes(point, parameters, free)?.split_off(self.height() * free.len()))
    }

    /// Derivatives of residuals, outputs and delays by some of the parameters, in the order of
    /// `Linearisation::values`, each with n_free entries.
    ///
    /// # Errors
    /// As `sensitivities`.
    pub fn value_slopes(
        &self,
        point: &[f64],
        parameters: &[f64],
        free: &[usize],
    ) -> Result<Vec<f64>, CoreError> {
        let inputs = self.joined(point, parameters)?;
        self.check_free(free)?;
        let directions: Vec<usize> = free.iter().map(|index| self.width() + index).collect();
        let mut values = vec![0.0; self.tape.n_outputs()];
        let mut slopes = vec![0.0; values.len() * free.len()];
        let registers = &mut Registers::default();
        self.tape.jacobian(&inputs, &directions, registers, &mut values, &mut slopes)?;
        Ok(slopes)
    }

    pub(crate) fn check_free(&self, free: &[usize]) -> Result<(), CoreError> {
        let needed = self.n_parameters();
        match free.iter().find(|&&index| index >= needed) {
            Some(&found) => Err(CoreError::Shape { what: "index of a parameter", found, needed }),
            None => Ok(()),
        }
    }
}

fn expect(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

#[cfg(test)]
#[path = "tests/model_tape.rs"]
pub(crate) mod tests;
