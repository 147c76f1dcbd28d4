//! Derivatives of a tape as another tape, with the pattern of those that are not always zero.
//!
//! Where a model is evaluated many times, formulas of its few nonzero derivatives cost less than dual
//! numbers that carry all of them. Rules and conventions (kinks, ties) are those of `dual.rs`.

use crate::error::CoreError;
use crate::language::lookup_table::Part;
use crate::language::syntax::{Binary, Unary};
use crate::tape::assembly::Assembler;
use crate::tape::expression_tape::Tape;
use crate::tape::operation::Operation;

/// One derivative of one output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Place of the output.
    pub row: usize,
    /// Place of the input.
    pub column: usize,
    /// Register that holds it.
    pub register: usize,
}

/// Derivatives of one register by input, ascending; an input left out has none.
type Gradient = Vec<(usize, usize)>;

impl Tape {
    /// Registers that the outputs need.
    pub(crate) fn needed(&self, outputs: &[usize]) -> Vec<bool> {
        let mut needed = vec![false; self.operations.len()];
        outputs.iter().for_each(|&register| needed[register] = true);
        for (register, operation) in self.operations.iter().enumerate().rev() {
            if needed[register] {
                operation.arguments().for_each(|a| needed[a] = true);
            }
        }
        needed
    }

    /// The operations that some registers need, none of which depends on the first `skipped` inputs;
    /// the inputs are those after them and the registers are the outputs.
    ///
    /// # Errors
    /// `Shape` where one of the skipped inputs is needed.
    pub(crate) fn pruned(&self, outputs: &[usize], skipped: usize) -> Result<Tape, CoreError> {
        let needed = self.needed(outputs);
        let mut places = vec![0; self.operations.len()];
        let mut operations = Vec::new();
        for (register, &operation) in self.operations.iter().enumerate().filter(|e| needed[e.0]) {
            places[register] = operations.len();
            operations.push(match operation {
                Operation::Input(place) if place < skipped => {
                    let what = "input that a formula of parameters needs";
                    return Err(CoreError::Shape { what, found: place, needed: skipped });
                }
                Operation::Input(place) => Operation::Input(place - skipped),
                other => other.moved(&places),
            });
        }
        let outputs = outputs.iter().map(|&register| places[register]).collect();
        let tables = self.tables.clone();
        Ok(Tape { operations, outputs, n_inputs: self.n_inputs - skipped, tables })
    }

    /// This tape with formulas of the derivatives of its outputs by all inputs appended, and their
    /// places by row, then column.
    ///
    /// # Errors
    /// `Expression` where the tape would be too long.
    pub(crate) fn differentiated(&self) -> Result<(Tape, Vec<Entry>), CoreError> {
        // Going on after the tape itself, formulas share what its values have computed already.
        let mut assembler = Assembler::resume(self.operations.clone());
        let needed = self.needed(&self.outputs);
        let mut gradients: Vec<Gradient> = vec![Vec::new(); self.operations.len()];
        for (register, &operation) in self.operations.iter().enumerate() {
            if !needed[register] {
                continue;
            }
            gradients[register] = match operation {
                Operation::Constant(_) => Vec::new(),
                Operation::Input(place) => vec![(place, assembler.constant(1.0)?)],
                Operation::Unary(function, a) => {
                    if gradients[a].is_empty() {
                        continue;
                    }
                    match unary_slope(&mut assembler, function, a, register)? {
                        Some(slope) => scaled(&mut assembler, &gradients[a], slope)?,
                        None => Vec::new(),
                    }
                }
                Operation::Binary(function, a, b) => {
                    let varies = (!gradients[a].is_empty(), !gradients[b].is_empty());
                    let slopes = binary_slopes(&mut assembler, function, (a, b), register, varies)?;
                    let left = match slopes.0 {
                        Some(slope) => scaled(&mut assembler, &gradients[a], slope)?,
                        None => Vec::new(),
                    };
                    let right = match slopes.1 {
                        Some(slope) => scaled(&mut assembler, &gradients[b], slope)?,
                        None => Vec::new(),
                    };
                    merged(&mut assembler, left, right)?
                }
                Operation::Select(test, a, b) => {
                    chosen(&mut assembler, test, &gradients[a], &gradients[b])?
                }
                Operation::Table(_, Part::First | Part::Second, ..) => {
                    let problem =
                        "the slope of a table has no formula of its derivative".to_string();
                    return Err(CoreError::Expression { position: 0, problem });
                }
                Operation::Table(table, Part::Value, a, b) => {
                    let slope = assembler.table(table, Part::First, a, b)?;
                    let left = scaled(&mut assembler, &gradients[a], slope)?;
                    if self.tables[table].n_axes() == 1 || gradients[b].is_empty() {
                        left
                    } else {
                        let slope = assembler.table(table, Part::Second, a, b)?;
                        let right = scaled(&mut assembler, &gradients[b], slope)?;
                        merged(&mut assembler, left, right)?
                    }
                }
            };
        }
        let mut entries = Vec::new();
        for (row, &output) in self.outputs.iter().enumerate() {
            for &(column, register) in &gradients[output] {
                entries.push(Entry { row, column, register });
            }
        }
        let operations = assembler.operations;
        let tape = Tape {
            operations,
            outputs: self.outputs.clone(),
            n_inputs: self.n_inputs,
            tables: self.tables.clone(),
        };
        Ok((tape, entries))
    }
}

fn scaled(
    assembler: &mut Assembler,
    gradient: &Gradient,
    slope: usize,
) -> Result<Gradient, CoreError> {
    let mut found = Vec::with_capacity(gradient.len());
    for &(input, register) in gradient {
        found.push((input, product(assembler, register, slope)?));
    }
    Ok(found)
}

/// Of each derivative, that of the branch taken.
fn chosen(
    assembler: &mut Assembler,
    test: usize,
    left: &Gradient,
    right: &Gradient,
) -> Result<Gradient, CoreError> {
    // The test has none: at its switch the value may jump, and no formula sees that.
    let zero = assembler.constant(0.0)?;
    let mut inputs: Vec<usize> = left.iter().chain(right).map(|entry| entry.0).collect();
    inputs.sort_unstable();
    inputs.dedup();
    let of = |gradient: &Gradient, input: usize| {
        gradient.iter().find(|entry| entry.0 == input).map_or(zero, |entry| entry.1)
    };
    let mut found = Vec::with_capacity(inputs.len());
    for input in inputs {
        found.push((input, assembler.select(test, of(left, input), of(right, input))?));
    }
    Ok(found)
}

fn merged(
    assembler: &mut Assembler,
    left: Gradient,
    right: Gradient,
) -> Result<Gradient, CoreError> {
    let mut found = left;
    for (input, register) in right {
        match found.binary_search_by_key(&input, |entry| entry.0) {
            Ok(place) => {
                found[place].1 = assembler.binary(Binary::Add, found[place].1, register)?;
            }
            Err(place) => found.insert(place, (input, register)),
        }
    }
    Ok(found)
}

/// a·b without multiplications by one and minus one.
fn product(assembler: &mut Assembler, a: usize, b: usize) -> Result<usize, CoreError> {
    match (assembler.value(a), assembler.value(b)) {
        (Some(1.0), _) => Ok(b),
        (_, Some(1.0)) => Ok(a),
        (Some(-1.0), None) => assembler.unary(Unary::Negate, b),
        (None, Some(-1.0)) => assembler.unary(Unary::Negate, a),
        _ => assembler.binary(Binary::Multiply, a, b),
    }
}

/// Derivative of a function of register `a`, whose value is in `result`; none where it is zero.
fn unary_slope(
    to: &mut Assembler,
    function: Unary,
    a: usize,
    result: usize,
) -> Result<Option<usize>, CoreError> {
    let one = to.constant(1.0)?;
    let square = |to: &mut Assembler, x: usize| to.binary(Binary::Multiply, x, x);
    Ok(Some(match function {
        Unary::Negate => to.constant(-1.0)?,
        Unary::Sin => to.unary(Unary::Cos, a)?,
        Unary::Cos => {
            let sine = to.unary(Unary::Sin, a)?;
            to.unary(Unary::Negate, sine)?
        }
        Unary::Tan => {
            let squared = square(to, result)?;
            to.binary(Binary::Add, one, squared)?
        }
        Unary::Asin | Unary::Acos => {
            let squared = square(to, a)?;
            let rest = to.binary(Binary::Subtract, one, squared)?;
            let root = to.unary(Unary::Sqrt, rest)?;
            let sign = to.constant(if function == Unary::Asin { 1.0 } else { -1.0 })?;
            to.binary(Binary::Divide, sign, root)?
        }
        Unary::Atan => {
            let squared = square(to, a)?;
            let sum = to.binary(Binary::Add, one, squared)?;
            to.binary(Binary::Divide, one, sum)?
        }
        Unary::Sinh => to.unary(Unary::Cosh, a)?,
        Unary::Cosh => to.unary(Unary::Sinh, a)?,
        Unary::Tanh => {
            let squared = square(to, result)?;
            to.binary(Binary::Subtract, one, squared)?
        }
        Unary::Exp => result,
        Unary::Log => to.binary(Binary::Divide, one, a)?,
        Unary::Sqrt => {
            let half = to.constant(0.5)?;
            to.binary(Binary::Divide, half, result)?
        }
        Unary::Abs => to.unary(Unary::Sign, a)?,
        Unary::Sign => return Ok(None),
    }))
}

type Slopes = (Option<usize>, Option<usize>);

/// Derivatives by both arguments; none where an argument does not vary.
fn binary_slopes(
    to: &mut Assembler,
    function: Binary,
    (a, b): (usize, usize),
    result: usize,
    varies: (bool, bool),
) -> Result<Slopes, CoreError> {
    let one = to.constant(1.0)?;
    let minus = to.constant(-1.0)?;
    let mut slopes = (None, None);
    match function {
        Binary::Add => slopes = (Some(one), Some(one)),
        Binary::Subtract => slopes = (Some(one), Some(minus)),
        Binary::Multiply => slopes = (Some(b), Some(a)),
        Binary::Divide => {
            if varies.0 {
                slopes.0 = Some(to.binary(Binary::Divide, one, b)?);
            }
            if varies.1 {
                let ratio = to.binary(Binary::Divide, result, b)?;
                slopes.1 = Some(to.unary(Unary::Negate, ratio)?);
            }
        }
        Binary::Power => slopes = power_slopes(to, (a, b), result, varies)?,
        Binary::Atan2 => {
            let squares = (to.binary(Binary::Multiply, a, a)?, to.binary(Binary::Multiply, b, b)?);
            let sum = to.binary(Binary::Add, squares.1, squares.0)?;
            let ratio = to.binary(Binary::Divide, a, sum)?;
            slopes.0 = Some(to.binary(Binary::Divide, b, sum)?);
            slopes.1 = Some(to.unary(Unary::Negate, ratio)?);
        }
        Binary::Minimum | Binary::Maximum => {
            // The second argument counts where it is strictly beyond the first.
            let zero = to.constant(0.0)?;
            let (high, low) = if function == Binary::Minimum { (a, b) } else { (b, a) };
            let gap = to.binary(Binary::Subtract, high, low)?;
            let sign = to.unary(Unary::Sign, gap)?;
            let second = to.binary(Binary::Maximum, sign, zero)?;
            slopes = (Some(to.binary(Binary::Subtract, one, second)?), Some(second));
        }
        Binary::Less | Binary::LessEqual => {}
    }
    Ok((slopes.0.filter(|_| varies.0), slopes.1.filter(|_| varies.1)))
}

fn power_slopes(
    to: &mut Assembler,
    (base, exponent): (usize, usize),
    result: usize,
    varies: (bool, bool),
) -> Result<Slopes, CoreError> {
    let mut slopes = (None, None);
    if varies.0 {
        slopes.0 = match to.value(exponent) {
            Some(0.0) => None,
            Some(number) => {
                let less = to.constant(number - 1.0)?;
                // No call of a power for the most common exponents.
                let reduced = match number {
                    1.0 => to.constant(1.0)?,
                    2.0 => base,
                    _ => to.binary(Binary::Power, base, less)?,
                };
                Some(product(to, exponent, reduced)?)
            }
            None => {
                let one = to.constant(1.0)?;
                let less = to.binary(Binary::Subtract, exponent, one)?;
                let reduced = to.binary(Binary::Power, base, less)?;
                Some(to.binary(Binary::Multiply, exponent, reduced)?)
            }
        };
    }
    if varies.1 {
        let logarithm = to.unary(Unary::Log, base)?;
        slopes.1 = Some(to.binary(Binary::Multiply, result, logarithm)?);
    }
    Ok(slopes)
}

#[cfg(test)]
#[path = "tests/derivative_tape.rs"]
mod tests;
