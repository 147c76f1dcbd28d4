//! A tape made ready to run along a trajectory: what never changes there is computed once, dead parts
//! are left out, and B points are evaluated side by side.

use crate::language::lookup_table::{LookupTable, Part};
use crate::language::syntax::{Binary, Unary};
use crate::tape::expression_tape::Tape;
use crate::tape::operation::{Operation, apply_binary, apply_unary};

#[derive(Debug, Clone, Copy)]
enum Step {
    Negate(u32, u32),
    Add(u32, u32, u32),
    Subtract(u32, u32, u32),
    Multiply(u32, u32, u32),
    Divide(u32, u32, u32),
    Integer(u32, u32, i32),
    Unary(Unary, u32, u32),
    Binary(Binary, u32, u32, u32),
    Select(u32, u32, u32, u32),
    Table(u32, u32, Part, [u32; 2]),
}

/// Some registers of a tape in the order of their computation.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    n_registers: usize,
    constants: Vec<(usize, f64)>,
    /// Register of each input; none where nothing depends on it.
    inputs: Vec<Option<usize>>,
    /// Computed once in a run.
    fixed: Vec<Step>,
    /// Computed at every point.
    moving: Vec<Step>,
    is_moving: Vec<bool>,
    tables: Vec<LookupTable>,
}

/// Values of all registers at B points.
pub(crate) type Lanes<const B: usize> = Vec<[f64; B]>;

impl Program {
    /// What `outputs` (registers) need; the first `n_moving` inputs change from point to point.
    pub(crate) fn new(tape: &Tape, outputs: &[usize], n_moving: usize) -> Self {
        let needed = tape.needed(outputs);
        let mut program = Self {
            n_registers: tape.operations.len(),
            constants: Vec::new(),
            inputs: vec![None; tape.n_inputs],
            fixed: Vec::new(),
            moving: Vec::new(),
            is_moving: vec![false; tape.operations.len()],
            tables: tape.tables.clone(),
        };
        for (register, &operation) in tape.operations.iter().enumerate() {
            if !needed[register] {
                continue;
            }
            let moves = operation.arguments().any(|a| program.is_moving[a]);
            match operation {
                Operation::Constant(value) => program.constants.push((register, value)),
                Operation::Input(place) => {
                    program.inputs[place] = Some(register);
                    program.is_moving[register] = place < n_moving;
                    continue;
                }
                _ => {
                    let step = step(tape, register, operation);
                    let list = if moves { &mut program.moving } else { &mut program.fixed };
                    list.extend(step);
                }
            }
            program.is_moving[register] = moves;
        }
        program
    }

    /// Whether a register changes from point to point.
    pub(crate) fn moves(&self, register: usize) -> bool {
        self.is_moving[register]
    }

    /// Set constants and fixed inputs (those after the moving ones), and what follows from them.
    pub(crate) fn prepare<const B: usize>(
        &self,
        n_moving: usize,
        fixed: &[f64],
        lanes: &mut Lanes<B>,
    ) {
        lanes.clear();
        lanes.resize(self.n_registers, [0.0; B]);
        for &(register, value) in &self.constants {
            lanes[register] = [value; B];
        }
        for (place, &value) in self.inputs[n_moving..].iter().zip(fixed) {
            if let Some(register) = place {
                lanes[*register] = [value; B];
            }
        }
        run(&self.fixed, &self.tables, lanes);
    }

    /// Give an input its values at the B points.
    pub(crate) fn load<const B: usize>(
        &self,
        input: usize,
        values: [f64; B],
        lanes: &mut Lanes<B>,
    ) {
        if let Some(register) = self.inputs[input] {
            lanes[register] = values;
        }
    }

    /// Whether anything here depends on an input.
    pub(crate) fn uses(&self, input: usize) -> bool {
        self.inputs[input].is_some()
    }

    /// Compute all that moves.
    pub(crate) fn run<const B: usize>(&self, lanes: &mut Lanes<B>) {
        run(&self.moving, &self.tables, lanes);
    }
}

fn step(tape: &Tape, register: usize, operation: Operation) -> Option<Step> {
    // A tape holds at most MAXIMUM_OPERATIONS registers, so their numbers fit.
    let (to, short) = (register as u32, |place: usize| place as u32);
    Some(match operation {
        Operation::Constant(_) | Operation::Input(_) => return None,
        Operation::Unary(Unary::Negate, a) => Step::Negate(to, short(a)),
        Operation::Unary(function, a) => Step::Unary(function, to, short(a)),
        Operation::Binary(Binary::Add, a, b) => Step::Add(to, short(a), short(b)),
        Operation::Binary(Binary::Subtract, a, b) => Step::Subtract(to, short(a), short(b)),
        Operation::Binary(Binary::Multiply, a, b) => Step::Multiply(to, short(a), short(b)),
        Operation::Binary(Binary::Divide, a, b) => Step::Divide(to, short(a), short(b)),
        Operation::Binary(Binary::Power, a, b) => match tape.operations[b] {
            Operation::Constant(2.0) => Step::Multiply(to, short(a), short(a)),
            Operation::Constant(power) if power.fract() == 0.0 && power.abs() <= 64.0 => {
                Step::Integer(to, short(a), power as i32)
            }
            _ => Step::Binary(Binary::Power, to, short(a), short(b)),
        },
        Operation::Binary(function, a, b) => Step::Binary(function, to, short(a), short(b)),
        Operation::Select(test, a, b) => Step::Select(to, short(test), short(a), short(b)),
        Operation::Table(table, part, a, b) => {
            Step::Table(to, short(table), part, [short(a), short(b)])
        }
    })
}

#[inline(always)]
fn each<const B: usize>(lanes: &mut [[f64; B]], to: u32, a: u32, function: impl Fn(f64) -> f64) {
    let a = &lanes[a as usize];
    let result = std::array::from_fn(|lane| function(a[lane]));
    lanes[to as usize] = result;
}

#[inline(always)]
fn pair<const B: usize>(
    lanes: &mut [[f64; B]],
    to: u32,
    (a, b): (u32, u32),
    function: impl Fn(f64, f64) -> f64,
) {
    let (a, b) = (&lanes[a as usize], &lanes[b as usize]);
    let result = std::array::from_fn(|lane| function(a[lane], b[lane]));
    lanes[to as usize] = result;
}

fn run<const B: usize>(steps: &[Step], tables: &[LookupTable], lanes: &mut [[f64; B]]) {
    for step in steps {
        match *step {
            Step::Negate(to, a) => each(lanes, to, a, |x| -x),
            Step::Add(to, a, b) => pair(lanes, to, (a, b), |x, y| x + y),
            Step::Subtract(to, a, b) => pair(lanes, to, (a, b), |x, y| x - y),
            Step::Multiply(to, a, b) => pair(lanes, to, (a, b), |x, y| x * y),
            Step::Divide(to, a, b) => pair(lanes, to, (a, b), |x, y| x / y),
            Step::Integer(to, a, power) => each(lanes, to, a, |x| x.powi(power)),
            Step::Unary(function, to, a) => each(lanes, to, a, |x| apply_unary(function, x)),
            Step::Binary(function, to, a, b) => {
                pair(lanes, to, (a, b), |x, y| apply_binary(function, x, y));
            }
            Step::Select(to, test, a, b) => {
                let (test, a, b) = (lanes[test as usize], lanes[a as usize], lanes[b as usize]);
                lanes[to as usize] =
                    std::array::from_fn(|lane| if test[lane] == 0.0 { b[lane] } else { a[lane] });
            }
            Step::Table(to, table, part, [a, b]) => {
                let table = &tables[table as usize];
                pair(lanes, to, (a, b), |x, y| table.part(part, x, y));
            }
        }
    }
}
