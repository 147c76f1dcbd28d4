//! The equations of a model made ready for integration in time: M(x, θ) ẋ = f(x, u, θ), y(ẋ, x, u, θ),
//! with formulas of all derivatives that are not always zero. (Python side: models/state_space/model.py)
//!
//! What depends on parameters alone is computed once for a trajectory (`leaves`). The state derivatives
//! must enter linearly: then residuals at ẋ = 0 and M give them exactly.

use crate::error::CoreError;
use crate::state_space::model_tape::ModelTape;
use crate::tape::derivative_tape::Entry;
use crate::tape::expression_tape::Tape;
use crate::tape::operation::Operation;
use crate::tape::tape_program::Program;

/// Programs of one model. Their inputs are ẋ, x, u, then the leaves.
#[derive(Debug, Clone)]
pub struct OdeModel {
    pub(crate) n_states: usize,
    pub(crate) n_inputs: usize,
    pub(crate) n_outputs: usize,
    pub(crate) n_parameters: usize,
    pub(crate) n_leaves: usize,
    /// θ to leaves, then delays.
    pub(crate) leaves: Tape,
    /// Residuals at ẋ = 0, and M.
    pub(crate) rates: Program,
    pub(crate) residuals: Vec<usize>,
    pub(crate) mass: Mass,
    /// Derivatives of the residuals by x, u and leaves, with what gives ẋ; ẋ comes late.
    pub(crate) rate_slopes: Program,
    pub(crate) slope_residuals: Vec<usize>,
    /// Entries of M, where it moves.
    pub(crate) slope_mass: Vec<Entry>,
    pub(crate) rate_entries: Vec<Entry>,
    /// Outputs.
    pub(crate) outputs: Program,
    pub(crate) measured: Vec<usize>,
    /// Derivatives of the outputs by ẋ, x, u and leaves, with the outputs.
    pub(crate) output_slopes: Program,
    pub(crate) output_registers: Vec<usize>,
    pub(crate) output_entries: Vec<Entry>,
    /// Whether an output depends on ẋ.
    pub(crate) outputs_need_rates: bool,
    affine: bool,
}

/// The matrix M of the factors of ẋ.
#[derive(Debug, Clone)]
pub(crate) enum Mass {
    /// ẋ_i stands alone on the left of equation i.
    One,
    /// M depends on parameters alone.
    Fixed(Vec<Entry>),
    /// M depends on states or inputs.
    Moving(Vec<Entry>),
}

impl Mass {
    pub(crate) fn is_one(&self) -> bool {
        matches!(self, Self::One)
    }
}

impl OdeModel {
    /// Take a compiled model apart.
    ///
    /// # Errors
    /// `Expression` where a state derivative does not enter linearly, or a tape would be too long.
    pub fn new(model: &ModelTape) -> Result<Self, CoreError> {
        let (n, m, p) = (model.n_states(), model.n_inputs(), model.n_outputs());
        let n_moving = model.width();
        let (leaves, moving) = split(model.tape(), n_moving, n + p)?;
        let n_leaves = moving.n_inputs - n_moving;
        let (tape, entries) = moving.differentiated()?;
        let pick = |low: usize, high: usize, columns: std::ops::Range<usize>| -> Vec<Entry> {
            let wanted = |e: &&Entry| e.row >= low && e.row < high && columns.contains(&e.column);
            entries.iter().filter(wanted).copied().collect()
        };
        let registers = |entries: &[Entry]| entries.iter().map(|e| e.register).collect::<Vec<_>>();
        let residuals = moving.outputs[..n].to_vec();
        let mass = pick(0, n, 0..n);
        let rates =
            Program::new(&tape, &[residuals.clone(), registers(&mass)].concat(), 0, n_moving);
        let factors = Program::new(&tape, &registers(&mass), 0, n_moving);
        // M depends on ẋ: the equations are not linear in it.
        if (0..n).any(|state| factors.uses(state)) {
            let problem = "a state derivative does not enter its equation linearly".to_string();
            return Err(CoreError::Expression { position: 0, problem });
        }
        let unit = |e: &Entry| {
            e.row == e.column && matches!(tape.operations[e.register], Operation::Constant(1.0))
        };
        let mass = if mass.len() == n && mass.iter().all(unit) {
            Mass::One
        } else if mass.iter().all(|entry| !rates.moves(entry.register)) {
            Mass::Fixed(mass)
        } else {
            Mass::Moving(mass)
        };
        let rate_entries = pick(0, n, n..n_moving + n_leaves);
        let slope_mass = match &mass {
            Mass::Moving(entries) => entries.clone(),
            Mass::One | Mass::Fixed(_) => Vec::new(),
        };
        let wanted = [registers(&rate_entries), residuals.clone(), registers(&slope_mass)].concat();
        let rate_slopes = Program::new(&tape, &wanted, n, n_moving);
        let mut output_entries = pick(n, n + p, 0..n_moving + n_leaves);
        output_entries.iter_mut().for_each(|entry| entry.row -= n);
        let output_registers = moving.outputs[n..].to_vec();
        let outputs = Program::new(&tape, &output_registers, 0, n_moving);
        let both = [registers(&output_entries), output_registers.clone()].concat();
        let output_slopes = Program::new(&tape, &both, 0, n_moving);
        let affine = !matches!(mass, Mass::Moving(_))
            && fixed(&rate_entries, &rate_slopes, n_moving)
            && fixed(&output_entries, &output_slopes, n_moving);
        let all = |registers: &[usize], program: &Program| -> Vec<usize> {
            registers.iter().map(|&register| program.place(register)).collect()
        };
        let mass = match mass {
            Mass::One => Mass::One,
            Mass::Fixed(entries) => Mass::Fixed(placed(&entries, &rates)),
            Mass::Moving(entries) => Mass::Moving(placed(&entries, &rates)),
        };
        Ok(Self {
            n_states: n,
            n_inputs: m,
            n_outputs: p,
            n_parameters: model.n_parameters(),
            n_leaves,
            leaves,
            residuals: all(&residuals, &rates),
            mass,
            slope_residuals: all(&residuals, &rate_slopes),
            slope_mass: placed(&slope_mass, &rate_slopes),
            rate_entries: placed(&rate_entries, &rate_slopes),
            rate_slopes,
            rates,
            outputs_need_rates: (0..n).any(|state| outputs.uses(state)),
            measured: all(&output_registers, &outputs),
            outputs,
            output_registers: all(&output_registers, &output_slopes),
            output_entries: placed(&output_entries, &output_slopes),
            output_slopes,
            affine,
        })
    }

    /// Inputs of the programs that change along a trajectory.
    pub(crate) fn n_moving(&self) -> usize {
        2 * self.n_states + self.n_inputs
    }

    /// Whether states, inputs and their derivatives enter equations and outputs linearly, with factors
    /// that depend on parameters alone.
    pub fn is_affine(&self) -> bool {
        self.affine
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
        self.n_parameters
    }
}

/// Whether derivatives by what moves are the same everywhere; registers are those of the tape.
fn fixed(entries: &[Entry], program: &Program, n_moving: usize) -> bool {
    entries.iter().all(|e| e.column >= n_moving || !program.moves(e.register))
}

/// Entries with places of a program instead of registers of the tape.
fn placed(entries: &[Entry], program: &Program) -> Vec<Entry> {
    entries.iter().map(|e| Entry { register: program.place(e.register), ..*e }).collect()
}

/// Part of the tape that depends on parameters alone (its outputs: leaves, then what stands after the
/// first `height` outputs), and the rest, which takes the leaves as inputs.
pub(crate) fn split(
    tape: &Tape,
    n_moving: usize,
    height: usize,
) -> Result<(Tape, Tape), CoreError> {
    let needed = tape.needed(&tape.outputs[..height]);
    let mut moves = vec![false; tape.operations.len()];
    for (register, operation) in tape.operations.iter().enumerate() {
        moves[register] = match *operation {
            Operation::Input(place) => place < n_moving,
            _ => operation.arguments().any(|a| moves[a]),
        };
    }
    let mut is_leaf = vec![false; tape.operations.len()];
    for register in (0..tape.operations.len()).filter(|&r| needed[r] && moves[r]) {
        // What moves reads it and it does not move: a leaf.
        tape.operations[register]
            .arguments()
            .filter(|&a| !moves[a])
            .for_each(|a| is_leaf[a] = true);
    }
    tape.outputs[..height].iter().filter(|&&r| !moves[r]).for_each(|&r| is_leaf[r] = true);
    let mut places = vec![0; tape.operations.len()];
    let (mut operations, mut leaves) = (Vec::new(), Vec::new());
    for (register, &operation) in tape.operations.iter().enumerate() {
        if !needed[register] || !(moves[register] || is_leaf[register]) {
            continue;
        }
        places[register] = operations.len();
        operations.push(match operation {
            Operation::Constant(value) => Operation::Constant(value),
            _ if is_leaf[register] => {
                leaves.push(register);
                Operation::Input(n_moving + leaves.len() - 1)
            }
            moving => moving.moved(&places),
        });
    }
    let outputs = tape.outputs[..height].iter().map(|&register| places[register]).collect();
    let n_inputs = n_moving + leaves.len();
    leaves.extend(&tape.outputs[height..]);
    let fixed = tape.pruned(&leaves, n_moving)?;
    let tables = tape.tables.clone();
    Ok((fixed, Tape { operations, outputs, n_inputs, tables }))
}
