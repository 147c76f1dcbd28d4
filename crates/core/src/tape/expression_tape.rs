//! Expressions flattened to a tape: one pass over an array of operations gives the values, on plain
//! numbers or on dual numbers. Common parts are computed once and constants are folded.

use std::collections::{BTreeMap, HashMap};

use crate::error::CoreError;
use crate::language::expression::Expression;
use crate::language::lookup_table::LookupTable;
use crate::language::syntax::{Binary, Unary};
use crate::numerics::dual::{Dual, Scalar};
use crate::tape::assembly::{Assembler, Builder};
use crate::tape::operation::{Operation, apply_binary, apply_unary};

const LANES: usize = 4;

/// Several expressions of the same inputs, ready to be evaluated many times.
#[derive(Debug, Clone)]
pub struct Tape {
    pub(crate) operations: Vec<Operation>,
    pub(crate) outputs: Vec<usize>,
    pub(crate) n_inputs: usize,
    pub(crate) tables: Vec<LookupTable>,
}

/// Registers that are reused from call to call.
#[derive(Debug, Clone, Default)]
pub struct Registers {
    plain: Vec<f64>,
    dual: Vec<Dual<f64, LANES>>,
    inputs: Vec<Dual<f64, LANES>>,
}

impl Tape {
    /// Flatten expressions; each name is an input, or stands for a definition.
    ///
    /// # Errors
    /// `UnknownName` and `Circular` for names and definitions; `Expression` where the tape would be
    /// too long.
    pub fn compile(
        expressions: &[Expression],
        inputs: &[String],
        definitions: &BTreeMap<String, Expression>,
    ) -> Result<Self, CoreError> {
        Self::compile_with(expressions, inputs, definitions, &BTreeMap::new())
    }

    /// As `compile`, with tables that the expressions may call.
    ///
    /// # Errors
    /// As `compile`; also `Shape` for a table called with another number of arguments than its axes.
    pub fn compile_with(
        expressions: &[Expression],
        inputs: &[String],
        definitions: &BTreeMap<String, Expression>,
        tables: &BTreeMap<String, LookupTable>,
    ) -> Result<Self, CoreError> {
        let places = inputs.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
        let mut builder = Builder {
            places,
            definitions,
            done: HashMap::new(),
            open: Vec::new(),
            assembler: Assembler::default(),
            tables,
        };
        let outputs =
            expressions.iter().map(|each| builder.expression(each)).collect::<Result<_, _>>()?;
        let operations = builder.assembler.operations;
        let tables = tables.values().cloned().collect();
        Ok(Self { operations, outputs, n_inputs: inputs.len(), tables })
    }

    /// Number of expressions.
    pub fn n_outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Whether every expression is a polynomial of degree two at most in all inputs together, so
    /// that its second derivatives are constants.
    pub fn is_quadratic(&self) -> bool {
        let mut degrees: Vec<usize> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let degree = match *operation {
                Operation::Constant(_) => 0,
                Operation::Input(_) => 1,
                Operation::Unary(Unary::Negate, a) => degrees[a],
                Operation::Binary(Binary::Add | Binary::Subtract, a, b) => {
                    degrees[a].max(degrees[b])
                }
                Operation::Binary(Binary::Multiply, a, b) => degrees[a] + degrees[b],
                Operation::Binary(Binary::Divide, a, b) if degrees[b] == 0 => degrees[a],
                _ => usize::MAX / 4,
            };
            degrees.push(degree.min(usize::MAX / 4));
        }
        self.outputs.iter().all(|&place| degrees[place] <= 2)
    }

    /// Evaluate on any scalar; `registers` is scratch.
    pub fn run<T: Scalar>(&self, inputs: &[T], registers: &mut Vec<T>, outputs: &mut [T]) {
        registers.clear();
        for operation in &self.operations {
            let value = match *operation {
                Operation::Constant(number) => T::constant(number),
                Operation::Input(place) => inputs[place],
                Operation::Unary(function, a) => apply_unary(function, registers[a]),
                Operation::Binary(function, a, b) => {
                    let power = (function == Binary::Power)
                        .then(|| self.operations[b].whole_exponent())
                        .flatten();
                    match power {
                        Some(power) => registers[a].whole_power(power),
                        None => apply_binary(function, registers[a], registers[b]),
                    }
                }
                Operation::Select(test, a, b) => {
                    registers[if registers[test].real() == 0.0 { b } else { a }]
                }
                Operation::Table(table, part, a, b) => {
                    self.tables[table].part(part, registers[a], registers[b])
                }
            };
            registers.push(value);
        }
        for (output, &place) in outputs.iter_mut().zip(&self.outputs) {
            *output = registers[place];
        }
    }

    /// Values of the expressions.
    ///
    /// # Errors
    /// `Shape` for a wrong number of inputs or outputs, `NotFinite` where a value has no meaning.
    pub fn evaluate(
        &self,
        inputs: &[f64],
        registers: &mut Registers,
        values: &mut [f64],
    ) -> Result<(), CoreError> {
        self.check(inputs, values.len())?;
        self.run(inputs, &mut registers.plain, values);
        finite("the value of an expression", values)
    }

    /// Values, and the exact Jacobian (n_outputs × n_directions, row-major) with respect to the
    /// inputs named by index in `directions`.
    ///
    /// # Errors
    /// As `evaluate`; also `NotFinite` where a derivative has no meaning.
    pub fn jacobian(
        &self,
        inputs: &[f64],
        directions: &[usize],
        registers: &mut Registers,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), CoreError> {
        self.check(inputs, values.len())?;
        let n = directions.len();
        let needed = self.n_outputs() * n;
        if jacobian.len() != needed {
            return Err(CoreError::Shape { what: "Jacobian", found: jacobian.len(), needed });
        }
        if n == 0 {
            return self.evaluate(inputs, registers, values);
        }
        let mut outputs = vec![Dual::<f64, LANES>::constant(0.0); self.n_outputs()];
        for start in (0..n).step_by(LANES) {
            let lanes = &directions[start..n.min(start + LANES)];
            registers.inputs.clear();
            registers.inputs.extend(inputs.iter().map(|&value| Dual::constant(value)));
            for (lane, &direction) in lanes.iter().enumerate() {
                registers.inputs[direction] = Dual::variable(inputs[direction], lane);
            }
            self.run(&registers.inputs, &mut registers.dual, &mut outputs);
            for (row, output) in outputs.iter().enumerate() {
                values[row] = output.value;
                let place = row * n + start;
                jacobian[place..place + lanes.len()]
                    .copy_from_slice(&output.gradient[..lanes.len()]);
            }
        }
        finite("the value of an expression", values)?;
        finite("the derivative of an expression", jacobian)
    }

    fn check(&self, inputs: &[f64], n_values: usize) -> Result<(), CoreError> {
        if inputs.len() != self.n_inputs {
            let (found, needed) = (inputs.len(), self.n_inputs);
            return Err(CoreError::Shape { what: "inputs of the expressions", found, needed });
        }
        if n_values != self.n_outputs() {
            let needed = self.n_outputs();
            return Err(CoreError::Shape {
                what: "values of the expressions",
                found: n_values,
                needed,
            });
        }
        finite("the inputs of the expressions", inputs)
    }
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), CoreError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
#[path = "tests/expression_tape.rs"]
mod tests;
