//! Steps of a program that do the work of two operations of a tape. (Python side: none)

use crate::language::syntax::{Binary, Unary};
use crate::tape::expression_tape::Tape;
use crate::tape::operation::Operation;

/// Products that only one sum or difference reads: they are computed with it, and stored nowhere.
/// Product and sum are rounded one by one, as they would be apart.
#[derive(Debug, Clone)]
pub(crate) struct Fusions {
    /// Of each sum or difference, the product that it takes in.
    products: Vec<Option<usize>>,
    is_taken: Vec<bool>,
}

impl Fusions {
    /// Among the `needed` registers, of which `outputs` are read from outside; `together` says whether
    /// two registers are computed at the same moment.
    pub(crate) fn new(
        tape: &Tape,
        needed: &[bool],
        outputs: &[usize],
        together: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let count = tape.operations.len();
        let mut readers = vec![0_usize; count];
        outputs.iter().for_each(|&register| readers[register] += 1);
        for register in (0..count).filter(|&r| needed[r]) {
            tape.operations[register].arguments().for_each(|a| readers[a] += 1);
        }
        let mut fusions = Self { products: vec![None; count], is_taken: vec![false; count] };
        for register in (0..count).filter(|&r| needed[r]) {
            let Operation::Binary(Binary::Add | Binary::Subtract, a, b) = tape.operations[register]
            else {
                continue;
            };
            let is_product = |&place: &usize| {
                matches!(tape.operations[place], Operation::Binary(Binary::Multiply, ..))
                    && readers[place] == 1
                    && together(place, register)
            };
            if let Some(product) = [b, a].into_iter().find(is_product) {
                fusions.products[register] = Some(product);
                fusions.is_taken[product] = true;
            }
        }
        fusions
    }

    /// Whether a register is computed within another one.
    pub(crate) fn takes(&self, register: usize) -> bool {
        self.is_taken[register]
    }

    /// The product that a register takes in.
    pub(crate) fn product(&self, register: usize) -> Option<usize> {
        self.products[register]
    }

    /// Registers that the step of a register reads.
    pub(crate) fn arguments(&self, tape: &Tape, register: usize) -> Vec<usize> {
        let product = self.product(register);
        let own = tape.operations[register].arguments().filter(|&a| Some(a) != product);
        own.chain(product.into_iter().flat_map(|p| tape.operations[p].arguments())).collect()
    }
}

/// The same registers, the cosine of an angle right behind its sine: one step makes both.
pub(crate) fn sines_with_cosines(tape: &Tape, registers: &[usize]) -> Vec<usize> {
    let of = |function: Unary, angle: usize| {
        registers.iter().copied().find(|&register| {
            matches!(tape.operations[register], Operation::Unary(f, a) if f == function && a == angle)
        })
    };
    let mut ordered = Vec::with_capacity(registers.len());
    for &register in registers {
        match tape.operations[register] {
            Operation::Unary(function @ (Unary::Sin | Unary::Cos), angle) => {
                let (sine, cosine) = (of(Unary::Sin, angle), of(Unary::Cos, angle));
                let is_first = match function {
                    Unary::Sin => cosine.is_none_or(|cosine| register < cosine),
                    _ => sine.is_none_or(|sine| register < sine),
                };
                if is_first {
                    ordered.extend(sine.into_iter().chain(cosine));
                }
            }
            _ => ordered.push(register),
        }
    }
    ordered
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use crate::language::expression::Expression;
    use crate::tape::expression_tape::{Registers, Tape};
    use crate::tape::tape_program::{Lanes, Program};

    #[test]
    fn a_program_gives_what_its_tape_gives() {
        let texts = [
            "a*b + c",
            "c - a*b",
            "a*b - c",
            "c + b*c",
            // A product with two readers, one that is an output, and one that only one sum takes.
            "a*c + a*c",
            "a*d",
            "a*d - b*d",
            "b*c*d - a/(b*c*d + 1)",
            "sin(a)*cos(b) - cos(a)*sin(b) + sin(c)",
            "cos(d)^2 + sin(d)*sin(d) - cos(a*b + c)",
        ];
        let expressions: Vec<_> = texts.iter().map(|t| Expression::parse(t).unwrap()).collect();
        let names = ["a", "b", "c", "d"].map(String::from);
        let tape = Tape::compile(&expressions, &names, &BTreeMap::new()).unwrap();
        let at = [0.7, -1.3, 2.2, 0.4];
        let mut wanted = [0.0; 10];
        tape.evaluate(&at, &mut Registers::default(), &mut wanted).unwrap();
        for n_late in [0, 1, 2] {
            for n_moving in n_late..=4 {
                let program = Program::new(&tape, &tape.outputs, n_late, n_moving);
                let mut lanes: Lanes<4> = Vec::new();
                program.prepare(n_moving, &at[n_moving..], &mut lanes);
                (n_late..n_moving).for_each(|k| program.load(k, [at[k]; 4], &mut lanes));
                program.run_early(&mut lanes);
                // What comes late comes twice.
                for late in [[9.0; 2], [at[0], at[1]]] {
                    (0..n_late).for_each(|k| program.load(k, [late[k]; 4], &mut lanes));
                    program.run_late(&mut lanes);
                }
                for (&register, wanted) in tape.outputs.iter().zip(wanted) {
                    let found = lanes[program.place(register)];
                    assert!(found.iter().all(|value| (value - wanted).abs() < 1e-15), "{n_moving}");
                }
            }
        }
    }
}
