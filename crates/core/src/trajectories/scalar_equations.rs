//! A model's equations and their derivatives by state and inputs on any scalar: on dual numbers these
//! derivatives have derivatives of their own. (Python side: none)
//!
//! M(x, θ) ẋ = f(x, u, θ) gives ẋ = −M⁻¹ r at ẋ = 0, and ∂ẋ/∂z = −M⁻¹ ∂r/∂z at that ẋ.

use crate::error::CoreError;
use crate::numerics::dual::Scalar;
use crate::state_space::model_tape::ModelTape;
use crate::state_space::ode_model::split;
use crate::tape::derivative_tape::Entry;
use crate::tape::expression_tape::Tape;
use crate::tape::operation::Operation;

/// Tapes of one model. Their inputs are ẋ, x, u, then what depends on parameters alone.
#[derive(Debug, Clone)]
pub(crate) struct EquationTapes {
    pub(crate) n_states: usize,
    pub(crate) n_inputs: usize,
    pub(crate) n_outputs: usize,
    pub(crate) n_parameters: usize,
    /// θ to leaves, then delays.
    leaves: Tape,
    n_leaves: usize,
    /// Residuals, then the entries of M; none of these where M is one.
    equations: Tape,
    mass: Option<Vec<Entry>>,
    /// Residuals, then their derivatives by x and u.
    rates: Tape,
    rate_entries: Vec<Entry>,
    /// Outputs, then their derivatives by ẋ, x and u.
    outputs: Tape,
    output_entries: Vec<Entry>,
    outputs_need_rates: bool,
}

impl EquationTapes {
    /// Take a compiled model apart.
    ///
    /// # Errors
    /// `Expression` where a tape would be too long.
    pub(crate) fn new(model: &ModelTape) -> Result<Self, CoreError> {
        let (n, m, p) = (model.n_states(), model.n_inputs(), model.n_outputs());
        let n_moving = model.width();
        let (leaves, moving) = split(model.tape(), n_moving, n + p)?;
        let n_leaves = moving.n_inputs - n_moving;
        let (tape, entries) = moving.differentiated()?;
        let pick = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| -> Vec<Entry> {
            let wanted = |e: &&Entry| rows.contains(&e.row) && columns.contains(&e.column);
            entries.iter().filter(wanted).copied().collect()
        };
        let with = |values: &[usize], entries: &[Entry]| {
            let registers: Vec<usize> =
                values.iter().copied().chain(entries.iter().map(|e| e.register)).collect();
            tape.pruned(&registers, 0)
        };
        let (residuals, seen) = moving.outputs.split_at(n);
        let factors = pick(0..n, 0..n);
        let unit = |e: &Entry| {
            e.row == e.column && matches!(tape.operations[e.register], Operation::Constant(1.0))
        };
        let is_one = factors.len() == n && factors.iter().all(unit);
        let mass = (!is_one).then_some(factors);
        let rate_entries = pick(0..n, n..n_moving);
        let output_entries = pick(n..n + p, 0..n_moving);
        let outputs = with(seen, &output_entries)?;
        let rated = |o: &Operation| matches!(o, Operation::Input(place) if *place < n);
        Ok(Self {
            n_states: n,
            n_inputs: m,
            n_outputs: p,
            n_parameters: model.n_parameters(),
            outputs_need_rates: outputs.operations.iter().any(rated),
            leaves,
            n_leaves,
            equations: with(residuals, mass.as_deref().unwrap_or_default())?,
            mass,
            rates: with(residuals, &rate_entries)?,
            rate_entries,
            outputs,
            output_entries,
        })
    }
}

/// A factor of a sparse matrix.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Factor<S> {
    pub(crate) row: usize,
    pub(crate) column: usize,
    pub(crate) value: S,
}

/// The tapes with values of their parameters, and buffers.
#[derive(Debug, Clone)]
pub(crate) struct ScalarEquations<'a, S> {
    pub(crate) tapes: &'a EquationTapes,
    /// By input.
    pub(crate) delays: Vec<S>,
    arguments: Vec<S>,
    registers: Vec<S>,
    found: Vec<S>,
    inverse: Vec<S>,
    scratch: Vec<S>,
    /// ẋ of the last call.
    pub(crate) rate: Vec<S>,
    /// Its derivatives by x (columns 0 … n), then by u.
    pub(crate) slopes: Vec<Factor<S>>,
}

impl<'a, S: Scalar> ScalarEquations<'a, S> {
    /// At values of the parameters.
    pub(crate) fn new(tapes: &'a EquationTapes, parameters: &[S]) -> Self {
        let zero = S::constant(0.0);
        let mut values = vec![zero; tapes.leaves.n_outputs()];
        let mut registers = Vec::new();
        tapes.leaves.run(parameters, &mut registers, &mut values);
        let mut arguments = vec![zero; 2 * tapes.n_states + tapes.n_inputs];
        let delays = values.split_off(tapes.n_leaves);
        arguments.extend(values);
        Self {
            tapes,
            delays,
            arguments,
            registers,
            found: Vec::new(),
            inverse: Vec::new(),
            scratch: Vec::new(),
            rate: vec![zero; tapes.n_states],
            slopes: Vec::new(),
        }
    }

    fn run(&mut self, tape: &Tape) {
        self.found.resize(tape.n_outputs(), S::constant(0.0));
        tape.run(&self.arguments, &mut self.registers, &mut self.found);
    }

    fn load(&mut self, state: &[S], inputs: &[S]) {
        let n = self.tapes.n_states;
        self.arguments[n..2 * n].copy_from_slice(state);
        self.arguments[2 * n..2 * n + inputs.len()].copy_from_slice(inputs);
    }

    /// Find ẋ.
    ///
    /// # Errors
    /// `Singular` where M has no inverse.
    pub(crate) fn evaluate(&mut self, state: &[S], inputs: &[S]) -> Result<(), CoreError> {
        let (tapes, n) = (self.tapes, self.tapes.n_states);
        self.load(state, inputs);
        self.arguments[..n].fill(S::constant(0.0));
        self.run(&tapes.equations);
        let Some(entries) = &tapes.mass else {
            (0..n).for_each(|i| self.rate[i] = -self.found[i]);
            return Ok(());
        };
        self.invert(entries)?;
        (0..n).for_each(|i| self.rate[i] = -dot(&self.inverse[i * n..][..n], &self.found[..n]));
        Ok(())
    }

    /// Find ẋ and its derivatives.
    ///
    /// # Errors
    /// As `evaluate`.
    pub(crate) fn differentiate(&mut self, state: &[S], inputs: &[S]) -> Result<(), CoreError> {
        let (tapes, n) = (self.tapes, self.tapes.n_states);
        if tapes.mass.is_some() {
            self.evaluate(state, inputs)?;
            self.arguments[..n].copy_from_slice(&self.rate);
        } else {
            self.load(state, inputs);
            self.arguments[..n].fill(S::constant(0.0));
        }
        self.run(&tapes.rates);
        self.slopes.clear();
        let factors = tapes.rate_entries.iter().zip(&self.found[n..]);
        let factors = factors.map(|(e, &value)| (e.row, e.column - n, value));
        if tapes.mass.is_none() {
            self.slopes.extend(factors.map(|(row, column, value)| Factor {
                row,
                column,
                value: -value,
            }));
            (0..n).for_each(|i| self.rate[i] = -self.found[i]);
            return Ok(());
        }
        let width = n + tapes.n_inputs;
        let mut dense = vec![S::constant(0.0); n * width];
        for (row, column, value) in factors {
            for i in 0..n {
                let place = i * width + column;
                dense[place] = dense[place] - self.inverse[i * n + row] * value;
            }
        }
        let factor = |(place, value)| Factor { row: place / width, column: place % width, value };
        self.slopes.extend(dense.into_iter().enumerate().map(factor));
        Ok(())
    }

    /// Outputs, and their derivatives by x (columns 0 … n) and u, sparse.
    ///
    /// # Errors
    /// As `evaluate`.
    pub(crate) fn measure(
        &mut self,
        state: &[S],
        inputs: &[S],
        seen: &mut Vec<Factor<S>>,
    ) -> Result<&[S], CoreError> {
        let (tapes, n, p) = (self.tapes, self.tapes.n_states, self.tapes.n_outputs);
        if tapes.outputs_need_rates {
            self.differentiate(state, inputs)?;
        }
        self.load(state, inputs);
        self.arguments[..n].copy_from_slice(&self.rate);
        self.run(&tapes.outputs);
        seen.clear();
        for (entry, &value) in tapes.output_entries.iter().zip(&self.found[p..]) {
            let row = entry.row - n;
            if entry.column >= n {
                seen.push(Factor { row, column: entry.column - n, value });
                continue;
            }
            for by in self.slopes.iter().filter(|by| by.row == entry.column) {
                seen.push(Factor { row, column: by.column, value: value * by.value });
            }
        }
        Ok(&self.found[..p])
    }

    /// M⁻¹ by elimination with row pivots.
    fn invert(&mut self, entries: &[Entry]) -> Result<(), CoreError> {
        let n = self.tapes.n_states;
        let (zero, one) = (S::constant(0.0), S::constant(1.0));
        let (a, b) = (&mut self.scratch, &mut self.inverse);
        a.clear();
        a.resize(n * n, zero);
        b.clear();
        b.resize(n * n, zero);
        (0..n).for_each(|i| b[i * n + i] = one);
        for (entry, &value) in entries.iter().zip(&self.found[n..]) {
            a[entry.row * n + entry.column] = value;
        }
        for k in 0..n {
            let size = |row: &usize| a[row * n + k].real().abs();
            let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(k);
            let largest = size(&pivot);
            // Not "at most zero": NaN is not above either.
            if !(largest > 0.0 && largest.is_finite()) {
                let what = "the matrix of the factors of the state derivatives";
                return Err(CoreError::Singular { what });
            }
            for j in 0..n {
                a.swap(k * n + j, pivot * n + j);
                b.swap(k * n + j, pivot * n + j);
            }
            let inverse = one / a[k * n + k];
            for j in 0..n {
                a[k * n + j] = a[k * n + j] * inverse;
                b[k * n + j] = b[k * n + j] * inverse;
            }
            for i in (0..n).filter(|&i| i != k) {
                let factor = a[i * n + k];
                for j in 0..n {
                    a[i * n + j] = a[i * n + j] - factor * a[k * n + j];
                    b[i * n + j] = b[i * n + j] - factor * b[k * n + j];
                }
            }
        }
        Ok(())
    }
}

pub(crate) fn dot<S: Scalar>(a: &[S], b: &[S]) -> S {
    a.iter().zip(b).fold(S::constant(0.0), |sum, (&x, &y)| sum + x * y)
}
