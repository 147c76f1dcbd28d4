//! Frequency responses of a state-space model with exact derivatives of log H, for the fit.
//! (Python side: models/state_space/model.py)
//!
//! H(jω) = {[H₀ + jω H₁] [jωM − F]⁻¹ G + D} e^{−jωτ}. With X = [jωM − F]⁻¹ G and the adjoint
//! Λ = [jωM − F]⁻ᵀ [H₀ + jω H₁]ᵀ the derivative of each pair is a sum over those few entries of the
//! matrices that depend on a parameter: one factorisation for each frequency serves all pairs.
//! Pivots and fill of the sparse matrix are planned once; eight frequencies are worked on at a time.

use num_complex::Complex64;

use crate::error::CoreError;
use crate::frequency_domain::response_model::ResponseModel;
use crate::numerics::complex_lanes::{LANES, Lanes};
use crate::numerics::complex_lu::ComplexLu;
use crate::numerics::sparse_lu::{Block, Factors, Plan};
use crate::numerics::widest::widest;
use crate::state_space::model_tape::{Linearisation, ModelTape, Sensitivity};

/// A state-space model seen by a fit: some parameters vary, the others stay.
#[derive(Debug, Clone)]
pub struct FreeStateSpace<'a> {
    tape: &'a ModelTape,
    /// Output and input of each response.
    pairs: &'a [(usize, usize)],
    point: &'a [f64],
    values: Vec<f64>,
    free: Vec<usize>,
    /// Inputs and outputs that a pair has.
    inputs: Vec<usize>,
    outputs: Vec<usize>,
    /// Frequencies to be solved in advance, ascending.
    omega: Vec<f64>,
    linear: Linearisation,
    sensitivities: Vec<Sensitivity>,
    delay_slopes: Vec<f64>,
    plan: Option<Plan>,
    blocks: Vec<Block>,
    /// Free parameters for which `states` hold, and whether the adjoints hold too.
    solved_at: Option<Vec<f64>>,
    has_adjoints: bool,
    /// X and Λ at the frequencies of each block: block, input or output, state.
    states: Vec<Lanes>,
    adjoints: Vec<Lanes>,
    right: Vec<Lanes>,
    solution: Vec<Lanes>,
}

/// Places of the distinct values of one part of the pairs.
fn used(values: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut found: Vec<usize> = values.collect();
    found.sort_unstable();
    found.dedup();
    found
}

impl<'a> FreeStateSpace<'a> {
    /// Take the values of all parameters, the indices of those that vary, and the frequencies at
    /// which responses will be asked for (others are solved when asked).
    ///
    /// # Errors
    /// `Shape` for what does not fit.
    pub fn new(
        tape: &'a ModelTape,
        pairs: &'a [(usize, usize)],
        point: &'a [f64],
        values: &[f64],
        free: &[usize],
        omega: impl IntoIterator<Item = f64>,
    ) -> Result<Self, CoreError> {
        for &(output, input) in pairs {
            let bounds = [(output, tape.n_outputs()), (input, tape.n_inputs())];
            if let Some(&(found, needed)) = bounds.iter().find(|(index, count)| index >= count) {
                return Err(CoreError::Shape { what: "channel of a response", found, needed });
            }
        }
        if let Some(&found) = free.iter().find(|&&index| index >= tape.n_parameters()) {
            let needed = tape.n_parameters();
            return Err(CoreError::Shape { what: "index of a free parameter", found, needed });
        }
        let mut omega: Vec<f64> = omega.into_iter().collect();
        omega.sort_by(f64::total_cmp);
        omega.dedup();
        let linear = match tape.linearise(point, values) {
            // Other starts of a search may have one; `prepare` judges each.
            Err(CoreError::NotFinite { .. }) => tape.no_linearisation(),
            found => found?,
        };
        Ok(Self {
            tape,
            pairs,
            point,
            values: values.to_vec(),
            free: free.to_vec(),
            inputs: used(pairs.iter().map(|pair| pair.1)),
            outputs: used(pairs.iter().map(|pair| pair.0)),
            omega,
            linear,
            sensitivities: Vec::new(),
            delay_slopes: Vec::new(),
            plan: None,
            blocks: Vec::new(),
            solved_at: None,
            has_adjoints: false,
            states: Vec::new(),
            adjoints: Vec::new(),
            right: vec![Lanes::ZERO; tape.n_states()],
            solution: vec![Lanes::ZERO; tape.n_states()],
        })
    }

    /// Entries of ∂(r, y)/∂z, of derivative and of state.
    fn entry(&self, row: usize, state: usize) -> (f64, f64) {
        let start = row * self.tape.width() + state;
        (self.linear.slopes[start], self.linear.slopes[start + self.tape.n_states()])
    }

    /// Both together at one frequency: jω ∂/∂ẋ + ∂/∂x.
    fn dynamic(&self, row: usize, state: usize, omega: f64) -> Complex64 {
        let (rate, value) = self.entry(row, state);
        Complex64::new(value, omega * rate)
    }

    /// The rows hold left − right: ∂r/∂u is −G.
    fn forcing(&self, state: usize, input: usize) -> f64 {
        -self.linear.slopes[state * self.tape.width() + 2 * self.tape.n_states() + input]
    }

    /// Frequencies of a block; the last is repeated where there are no more.
    fn frequencies(&self, block: usize) -> [f64; LANES] {
        let last = self.omega.len() - 1;
        std::array::from_fn(|lane| self.omega[(block * LANES + lane).min(last)])
    }

    /// A plan that holds every entry of jωM − F that is not zero now.
    fn update_plan(&mut self) {
        let n = self.tape.n_states();
        let is_used = |row: usize, column: usize| self.entry(row, column) != (0.0, 0.0);
        // Entries stay once seen, so that a parameter through zero plans nothing anew.
        let mut known = vec![false; n * n];
        if let Some(plan) = &self.plan {
            plan.entries().iter().for_each(|&(row, column)| known[row * n + column] = true);
            if (0..n * n).all(|k| known[k] || !is_used(k / n, k % n)) {
                return;
            }
        }
        let entries: Vec<(usize, usize)> = (0..n * n)
            .filter(|&k| known[k] || is_used(k / n, k % n))
            .map(|k| (k / n, k % n))
            .collect();
        // One frequency stands for all; `Plan::factor` judges its pivots at each.
        let middle = self.omega[self.omega.len() / 2];
        let typical: Vec<Complex64> =
            entries.iter().map(|&(row, column)| self.dynamic(row, column, middle)).collect();
        self.plan = Plan::new(n, &entries, &typical);
    }

    fn factor(&self, block: usize, reused: Option<Block>) -> Result<Block, CoreError> {
        let omega = self.frequencies(block);
        if let Some(plan) = &self.plan {
            let mut factors = match reused {
                Some(Block::Planned(factors)) => factors,
                _ => Factors::default(),
            };
            let entry = |row: usize, column: usize| {
                let (rate, value) = self.entry(row, column);
                Lanes::along(value, rate, &omega)
            };
            if plan.factor(entry, &mut factors) {
                return Ok(Block::Planned(factors));
            }
        }
        omega.iter().map(|&each| self.pivoted(each)).collect::<Result<_, _>>().map(Block::Pivoted)
    }

    fn pivoted(&self, omega: f64) -> Result<ComplexLu, CoreError> {
        let n = self.tape.n_states();
        ComplexLu::new((0..n * n).map(|k| self.dynamic(k / n, k % n, omega)).collect(), n)
    }

    /// Solve for the right side in `right`, transposed or not, into `solution`.
    fn back_solve(&mut self, block: usize, transposed: bool) {
        let (right, solution) = (&mut self.right, &mut self.solution);
        self.blocks[block].solve(self.plan.as_ref(), right, solution, transposed);
    }

    fn solve_states(&mut self) -> Result<(), CoreError> {
        let (n, m) = (self.tape.n_states(), self.inputs.len());
        self.has_adjoints = false;
        if self.omega.is_empty() {
            return Ok(());
        }
        self.update_plan();
        let mut old = std::mem::take(&mut self.blocks).into_iter();
        for block in 0..self.omega.len().div_ceil(LANES) {
            let made = self.factor(block, old.next())?;
            self.blocks.push(made);
        }
        self.states.resize(self.blocks.len() * m * n, Lanes::ZERO);
        for block in 0..self.blocks.len() {
            for column in 0..m {
                for state in 0..n {
                    self.right[state] = Lanes::real(self.forcing(state, self.inputs[column]));
                }
                self.back_solve(block, false);
                let start = (block * m + column) * n;
                self.states[start..start + n].copy_from_slice(&self.solution);
            }
        }
        Ok(())
    }

    fn solve_adjoints(&mut self) {
        let (n, p) = (self.tape.n_states(), self.outputs.len());
        self.adjoints.resize(self.blocks.len() * p * n, Lanes::ZERO);
        for block in 0..self.blocks.len() {
            let omega = self.frequencies(block);
            for row in 0..p {
                for state in 0..n {
                    let (rate, value) = self.entry(n + self.outputs[row], state);
                    self.right[state] = Lanes::along(value, rate, &omega);
                }
                self.back_solve(block, true);
                let start = (block * p + row) * n;
                self.adjoints[start..start + n].copy_from_slice(&self.solution);
            }
        }
        self.has_adjoints = true;
    }

    /// Place of an input or output among those that pairs have.
    fn place(list: &[usize], wanted: usize) -> usize {
        list.partition_point(|&each| each < wanted)
    }

    /// Responses at up to eight frequencies that were solved in advance, and derivatives of log H.
    #[inline(always)]
    fn eight(
        &self,
        pair: (usize, usize),
        places: &[usize],
        gradient: Option<&mut [Lanes]>,
    ) -> Lanes {
        let (output, input) = pair;
        let (n, width) = (self.tape.n_states(), self.tape.width());
        let row = n + output;
        let at = |lane: usize| places[lane.min(places.len() - 1)];
        let omega: [f64; LANES] = std::array::from_fn(|lane| self.omega[at(lane)]);
        let is_block =
            places[0].is_multiple_of(LANES) && (0..places.len()).all(|k| at(k) == places[0] + k);
        let gather = |from: &[Lanes], count: usize, which: usize| -> Vec<Lanes> {
            let start = |place: usize| (place / LANES * count + which) * n;
            let mut found = from[start(places[0])..][..n].to_vec();
            // What fills a block beyond its last frequency is nobody's.
            for lane in (0..LANES).filter(|_| !is_block) {
                let (place, held) = (at(lane), &from[start(at(lane))..][..n]);
                for (to, v) in found.iter_mut().zip(held) {
                    to.set(lane, v.get(place % LANES));
                }
            }
            found
        };
        let states = gather(&self.states, self.inputs.len(), Self::place(&self.inputs, input));
        let mut value = Lanes::real(self.linear.slopes[row * width + 2 * n + input]);
        for (state, solved) in states.iter().enumerate() {
            let (rate, plain) = self.entry(row, state);
            if (rate, plain) != (0.0, 0.0) {
                value.add_product(&Lanes::along(plain, rate, &omega), solved);
            }
        }
        if let Some(gradient) = gradient {
            let mut adjoints =
                gather(&self.adjoints, self.outputs.len(), Self::place(&self.outputs, output));
            // ∂ log H = ∂H / H: dividing Λ here divides every entry's share.
            let inverse = value.inverse();
            adjoints.iter_mut().for_each(|each| *each = each.times(&inverse));
            self.add_entries(pair, &omega, &states, &adjoints, &inverse, gradient);
        }
        let late = self.linear.values[self.tape.height() + input];
        if late == 0.0 {
            return value;
        }
        let mut turn = Lanes::ZERO;
        (0..LANES).for_each(|lane| turn.set(lane, Complex64::cis(-omega[lane] * late)));
        value.times(&turn)
    }

    /// Derivatives of log H: one term for each entry of the matrices that depends on a parameter.
    #[inline(always)]
    fn add_entries(
        &self,
        (output, input): (usize, usize),
        omega: &[f64; LANES],
        states: &[Lanes],
        adjoints: &[Lanes],
        inverse: &Lanes,
        gradient: &mut [Lanes],
    ) {
        let n = states.len();
        let rates: Vec<Lanes> =
            states.iter().map(|each| each.times(&Lanes::along(0.0, 1.0, omega))).collect();
        gradient.fill(Lanes::ZERO);
        for each in &self.sensitivities {
            let (outer, sign) = if each.row < n {
                (&adjoints[each.row], -each.value)
            } else if each.row == n + output {
                (inverse, each.value)
            } else {
                continue;
            };
            let slope = &mut gradient[each.parameter];
            match each.column {
                column if column < n => slope.add_scaled(sign, &outer.times(&rates[column])),
                column if column < 2 * n => {
                    slope.add_scaled(sign, &outer.times(&states[column - n]));
                }
                column if column == 2 * n + input => slope.add_scaled(sign, outer),
                _ => {}
            }
        }
        let n_free = self.free.len();
        // log H holds −jωτ as a summand.
        for (slope, late) in gradient.iter_mut().zip(&self.delay_slopes[input * n_free..]) {
            (0..LANES).for_each(|lane| slope.im[lane] -= omega[lane] * late);
        }
    }
}

impl ResponseModel for FreeStateSpace<'_> {
    fn n_responses(&self) -> usize {
        self.pairs.len()
    }

    fn n_free(&self) -> usize {
        self.free.len()
    }

    fn prepare(&mut self, free: &[f64], with_gradient: bool) -> Result<(), CoreError> {
        if self.solved_at.as_deref() != Some(free) {
            self.solved_at = None;
            for (&place, &value) in self.free.iter().zip(free) {
                self.values[place] = value;
            }
            self.linear = self.tape.linearise(self.point, &self.values)?;
            self.solve_states()?;
            self.solved_at = Some(free.to_vec());
        }
        if with_gradient && !self.has_adjoints {
            let (point, values) = (self.point, &self.values);
            // Constant where the model is bilinear: found once for the whole search.
            if self.sensitivities.is_empty() || !self.tape.is_bilinear() {
                self.sensitivities = self.tape.sensitivities(point, values, &self.free)?;
            }
            self.delay_slopes = self.tape.delay_slopes(point, values, &self.free)?;
            self.solve_adjoints();
        }
        Ok(())
    }

    fn responses(
        &self,
        response: usize,
        omega: &[f64],
        values: &mut [Complex64],
        mut gradients: Option<&mut [Complex64]>,
    ) {
        let n_free = self.free.len();
        let mut slopes = vec![Lanes::ZERO; n_free];
        for (chunk, frequencies) in omega.chunks(LANES).enumerate() {
            let find = |each: &f64| self.omega.binary_search_by(|known| known.total_cmp(each));
            let places: Result<Vec<usize>, usize> = frequencies.iter().map(find).collect();
            let Ok(places) = places else {
                values.fill(Complex64::new(f64::NAN, f64::NAN));
                return;
            };
            let wanted = gradients.is_some().then_some(slopes.as_mut_slice());
            let found = widest(
                #[inline(always)]
                || self.eight(self.pairs[response], &places, wanted),
            );
            for lane in 0..places.len() {
                let place = chunk * LANES + lane;
                values[place] = found.get(lane);
                if let Some(gradients) = gradients.as_deref_mut() {
                    let row = &mut gradients[place * n_free..(place + 1) * n_free];
                    row.iter_mut().zip(&slopes).for_each(|(to, slope)| *to = slope.get(lane));
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "tests/state_space_response.rs"]
mod tests;
