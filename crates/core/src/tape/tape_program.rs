//! A tape made ready to run along a trajectory: what never changes there is computed once, dead parts
//! are left out, and B points are evaluated side by side, in few places.

use crate::language::lookup_table::{LookupTable, Part};
use crate::language::syntax::{Binary, Unary};
use crate::numerics::widest::widest;
use crate::tape::expression_tape::Tape;
use crate::tape::fused_steps::{Fusions, sines_with_cosines};
use crate::tape::operation::{Operation, apply_binary, apply_unary};

#[derive(Debug, Clone, Copy)]
enum Step {
    Negate(u32, u32),
    Add(u32, u32, u32),
    Subtract(u32, u32, u32),
    Multiply(u32, u32, u32),
    Divide(u32, u32, u32),
    /// c + a b, c − a b, a b − c.
    AddProduct(u32, u32, u32, u32),
    SubtractProduct(u32, u32, u32, u32),
    FromProduct(u32, u32, u32, u32),
    /// Sine and cosine.
    Turn(u32, u32, u32),
    Integer(u32, u32, i32),
    Unary(Unary, u32, u32),
    Binary(Binary, u32, u32, u32),
    Select(u32, u32, u32, u32),
    Table(u32, u32, Part, [u32; 2]),
}

/// Some registers of a tape in the order of their computation.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    n_places: usize,
    constants: Vec<(usize, f64)>,
    /// Place of each input; none where nothing depends on it.
    inputs: Vec<Option<usize>>,
    /// Computed once in a run.
    fixed: Vec<Step>,
    /// Computed at every point.
    early: Vec<Step>,
    /// What depends on the inputs that come late.
    late: Vec<Step>,
    is_moving: Vec<bool>,
    /// Place of each register of the tape.
    places: Places,
    tables: Vec<LookupTable>,
}

/// Values at all places of a program at B points.
pub(crate) type Lanes<const B: usize> = Vec<[f64; B]>;

/// When a register is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Moment {
    Before,
    Early,
    Late,
}

/// Where the registers of a tape are kept: values that are read once more and then not again make room
/// for others, so that all that is at work stays in the nearest cache.
#[derive(Debug, Clone)]
struct Places {
    of: Vec<usize>,
    count: usize,
}

impl Places {
    /// `kept` are the registers whose values stay; `early` are computed in that order.
    fn new(
        tape: &Tape,
        fusions: &Fusions,
        needed: &[bool],
        kept: &[bool],
        early: &[usize],
    ) -> Self {
        let mut places = Self { of: vec![0; needed.len()], count: 0 };
        for register in (0..needed.len()).filter(|&r| needed[r] && kept[r]) {
            places.of[register] = places.fresh();
        }
        let mut last = vec![0; needed.len()];
        for (time, &register) in early.iter().enumerate() {
            fusions.arguments(tape, register).into_iter().for_each(|a| last[a] = time);
        }
        let mut free = Vec::new();
        for (time, &register) in early.iter().enumerate() {
            let mut read = fusions.arguments(tape, register);
            read.sort_unstable();
            read.dedup();
            // A step reads before it writes, so that its result may take the place of an argument.
            free.extend(
                read.iter().filter(|&&a| !kept[a] && last[a] == time).map(|&a| places.of[a]),
            );
            if !kept[register] {
                places.of[register] = free.pop().unwrap_or_else(|| places.fresh());
            }
        }
        places
    }

    fn fresh(&mut self) -> usize {
        self.count += 1;
        self.count - 1
    }
}

impl Program {
    /// What `outputs` (registers) need. The first `n_moving` inputs change from point to point, and
    /// the first `n_late` of these are known only when the rest has been computed.
    pub(crate) fn new(tape: &Tape, outputs: &[usize], n_late: usize, n_moving: usize) -> Self {
        let needed = tape.needed(outputs);
        let moments = moments(tape, n_late, n_moving);
        let together = |a: usize, b: usize| moments[a] == moments[b];
        let fusions = Fusions::new(tape, &needed, outputs, together);
        let steps = |moment: Moment| -> Vec<usize> {
            let wanted = |&r: &usize| {
                let leaf =
                    matches!(tape.operations[r], Operation::Constant(_) | Operation::Input(_));
                needed[r] && !leaf && moments[r] == moment && !fusions.takes(r)
            };
            let found: Vec<usize> = (0..needed.len()).filter(wanted).collect();
            sines_with_cosines(tape, &found)
        };
        let (fixed, early, late) =
            (steps(Moment::Before), steps(Moment::Early), steps(Moment::Late));
        let mut kept = vec![true; needed.len()];
        early.iter().for_each(|&register| kept[register] = false);
        (0..needed.len()).filter(|&r| fusions.takes(r)).for_each(|r| kept[r] = false);
        outputs.iter().for_each(|&register| kept[register] = true);
        for &register in &late {
            fusions.arguments(tape, register).into_iter().for_each(|a| kept[a] = true);
        }
        let places = Places::new(tape, &fusions, &needed, &kept, &early);
        let made = |registers: &[usize]| steps_of(tape, &fusions, &places.of, registers);
        let mut constants = Vec::new();
        let mut inputs = vec![None; tape.n_inputs];
        for register in (0..needed.len()).filter(|&r| needed[r]) {
            match tape.operations[register] {
                Operation::Constant(value) => constants.push((places.of[register], value)),
                Operation::Input(place) => inputs[place] = Some(places.of[register]),
                _ => {}
            }
        }
        Self {
            n_places: places.count,
            constants,
            inputs,
            fixed: made(&fixed),
            early: made(&early),
            late: made(&late),
            is_moving: moments.iter().map(|&moment| moment > Moment::Before).collect(),
            tables: tape.tables.clone(),
            places,
        }
    }

    /// Where the lanes hold an output register of the tape.
    pub(crate) fn place(&self, register: usize) -> usize {
        self.places.of[register]
    }

    /// Whether a register of the tape changes from point to point.
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
        lanes.resize(self.n_places, [0.0; B]);
        for &(place, value) in &self.constants {
            lanes[place] = [value; B];
        }
        for (place, &value) in self.inputs[n_moving..].iter().zip(fixed) {
            if let Some(place) = place {
                lanes[*place] = [value; B];
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
        if let Some(place) = self.inputs[input] {
            lanes[place] = values;
        }
    }

    /// Whether anything here depends on an input.
    pub(crate) fn uses(&self, input: usize) -> bool {
        self.inputs[input].is_some()
    }

    /// Compute all that moves.
    pub(crate) fn run<const B: usize>(&self, lanes: &mut Lanes<B>) {
        self.run_early(lanes);
        self.run_late(lanes);
    }

    /// Compute what moves without the inputs that come late.
    pub(crate) fn run_early<const B: usize>(&self, lanes: &mut Lanes<B>) {
        run(&self.early, &self.tables, lanes);
    }

    /// Compute what depends on the inputs that come late; again, where they change.
    pub(crate) fn run_late<const B: usize>(&self, lanes: &mut Lanes<B>) {
        run(&self.late, &self.tables, lanes);
    }
}

fn moments(tape: &Tape, n_late: usize, n_moving: usize) -> Vec<Moment> {
    let mut moments = vec![Moment::Before; tape.operations.len()];
    for (register, operation) in tape.operations.iter().enumerate() {
        moments[register] = match *operation {
            Operation::Input(place) if place < n_late => Moment::Late,
            Operation::Input(place) if place < n_moving => Moment::Early,
            _ => operation.arguments().map(|a| moments[a]).max().unwrap_or(Moment::Before),
        };
    }
    moments
}

/// Steps that compute registers in this order.
fn steps_of(tape: &Tape, fusions: &Fusions, places: &[usize], registers: &[usize]) -> Vec<Step> {
    let mut steps = Vec::with_capacity(registers.len());
    for &register in registers {
        let Some(made) = step(tape, fusions, places, register) else { continue };
        // A cosine follows the sine of its angle.
        match (steps.last_mut(), made) {
            (Some(last), Step::Unary(Unary::Cos, cosine, angle)) => match *last {
                Step::Unary(Unary::Sin, sine, of) if of == angle && sine != angle => {
                    *last = Step::Turn(sine, cosine, angle);
                }
                _ => steps.push(made),
            },
            _ => steps.push(made),
        }
    }
    steps
}

fn step(tape: &Tape, fusions: &Fusions, places: &[usize], register: usize) -> Option<Step> {
    // A tape holds at most MAXIMUM_OPERATIONS registers, so their numbers fit.
    let short = |register: usize| places[register] as u32;
    let to = short(register);
    if let Some(product) = fusions.product(register) {
        let (Operation::Binary(kind, left, right), Operation::Binary(_, a, b)) =
            (tape.operations[register], tape.operations[product])
        else {
            return None;
        };
        let (a, b) = (short(a), short(b));
        return Some(match kind {
            Binary::Add if right == product => Step::AddProduct(to, a, b, short(left)),
            Binary::Add => Step::AddProduct(to, a, b, short(right)),
            _ if right == product => Step::SubtractProduct(to, a, b, short(left)),
            _ => Step::FromProduct(to, a, b, short(right)),
        });
    }
    Some(match tape.operations[register] {
        Operation::Constant(_) | Operation::Input(_) => return None,
        Operation::Unary(Unary::Negate, a) => Step::Negate(to, short(a)),
        Operation::Unary(function, a) => Step::Unary(function, to, short(a)),
        Operation::Binary(Binary::Add, a, b) => Step::Add(to, short(a), short(b)),
        Operation::Binary(Binary::Subtract, a, b) => Step::Subtract(to, short(a), short(b)),
        Operation::Binary(Binary::Multiply, a, b) => Step::Multiply(to, short(a), short(b)),
        Operation::Binary(Binary::Divide, a, b) => Step::Divide(to, short(a), short(b)),
        Operation::Binary(Binary::Power, a, b) => match tape.operations[b].whole_exponent() {
            Some(2) => Step::Multiply(to, short(a), short(a)),
            Some(power) => Step::Integer(to, short(a), power),
            None => Step::Binary(Binary::Power, to, short(a), short(b)),
        },
        Operation::Binary(function, a, b) => Step::Binary(function, to, short(a), short(b)),
        Operation::Select(test, a, b) => Step::Select(to, short(test), short(a), short(b)),
        Operation::Table(table, part, a, b) => {
            Step::Table(to, table as u32, part, [short(a), short(b)])
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

#[inline(always)]
fn triple<const B: usize>(
    lanes: &mut [[f64; B]],
    to: u32,
    (a, b, c): (u32, u32, u32),
    function: impl Fn(f64, f64, f64) -> f64,
) {
    let (a, b, c) = (&lanes[a as usize], &lanes[b as usize], &lanes[c as usize]);
    let result = std::array::from_fn(|lane| function(a[lane], b[lane], c[lane]));
    lanes[to as usize] = result;
}

#[inline(always)]
fn turn<const B: usize>(lanes: &mut [[f64; B]], sine: u32, cosine: u32, angle: u32) {
    let both: [(f64, f64); B] = lanes[angle as usize].map(f64::sin_cos);
    lanes[sine as usize] = both.map(|both| both.0);
    lanes[cosine as usize] = both.map(|both| both.1);
}

fn run<const B: usize>(steps: &[Step], tables: &[LookupTable], lanes: &mut [[f64; B]]) {
    if B == 1 {
        return execute(steps, tables, lanes);
    }
    widest(
        #[inline(always)]
        || execute(steps, tables, lanes),
    );
}

#[inline(always)]
fn execute<const B: usize>(steps: &[Step], tables: &[LookupTable], lanes: &mut [[f64; B]]) {
    for step in steps {
        match *step {
            Step::Negate(to, a) => each(lanes, to, a, |x| -x),
            Step::Add(to, a, b) => pair(lanes, to, (a, b), |x, y| x + y),
            Step::Subtract(to, a, b) => pair(lanes, to, (a, b), |x, y| x - y),
            Step::Multiply(to, a, b) => pair(lanes, to, (a, b), |x, y| x * y),
            Step::Divide(to, a, b) => pair(lanes, to, (a, b), |x, y| x / y),
            Step::AddProduct(to, a, b, c) => triple(lanes, to, (a, b, c), |x, y, z| z + x * y),
            Step::SubtractProduct(to, a, b, c) => triple(lanes, to, (a, b, c), |x, y, z| z - x * y),
            Step::FromProduct(to, a, b, c) => triple(lanes, to, (a, b, c), |x, y, z| x * y - z),
            Step::Turn(sine, cosine, angle) => turn(lanes, sine, cosine, angle),
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
