//! Exact derivatives of Runge–Kutta trajectories by parameters, initial state and input shifts.
//!
//! The same four stages are differentiated: K_s = −M⁻¹ (∂r/∂x S_s + ∂r/∂u U_s + ∂r/∂ℓ L), with U the
//! derivatives of the delayed inputs and L those of the leaves. ∂r/∂x and its kin come from formulas of
//! the few derivatives that are not always zero, for many samples side by side; what remains in
//! sequence is a sparse product for each stage.

use crate::error::CoreError;
use crate::numerics::widest::widest;
use crate::state_space::ode_model::{Mass, OdeModel};
use crate::tape::expression_tape::Registers;
use crate::tape::tape_program::Lanes;
use crate::trajectories::runge_kutta::{STAGES, expect, inverse};
use crate::trajectories::sensitivity_columns::ColumnSteps;
use crate::trajectories::sensitivity_flow::{Flow, Folded, Instant};
use crate::trajectories::sensitivity_pattern::{
    BLOCK, Directions, GROUP, Pattern, Seeds, VECTOR, VECTORS,
};
use crate::trajectories::step_map::StepMap;
use crate::trajectories::trajectory::Trajectory;

/// Buffers, kept from run to run.
#[derive(Debug, Clone, Default)]
pub struct TrajectorySensitivity {
    registers: Registers,
    leaf_values: Vec<f64>,
    leaf_slopes: Vec<f64>,
    flow: Flow,
    output_pattern: Pattern,
    slopes: Lanes<BLOCK>,
    outputs: Lanes<BLOCK>,
    /// Of each stage of the part at work of a block, then of the samples themselves.
    stages: Vec<Folded>,
    /// M⁻¹ of the stage at work, where it moves.
    masses: Vec<[f64; BLOCK]>,
    output_stage: Vec<[f64; BLOCK]>,
    scratch: Vec<f64>,
    inverse: Vec<f64>,
    map: StepMap,
    columns: ColumnSteps,
    rows: Vec<f64>,
}

impl TrajectorySensitivity {
    /// Differentiate the run that `states` holds. `seeds` (n_states × columns, row-major) are the
    /// derivatives of the state at its beginning. Rows of `stride` numbers, the output and its
    /// derivatives in the order of `directions`, go to `sink` block by block: first sample of the
    /// block, then its rows by sample, then output; none where `stride` is zero.
    ///
    /// # Errors
    /// `Shape` for what does not fit; `Diverged`, `NotFinite` or `Singular` where a derivative has no
    /// meaning.
    #[allow(clippy::too_many_arguments)]
    pub fn run(
        &mut self,
        trajectory: &Trajectory<'_>,
        parameters: &[f64],
        directions: &Directions<'_>,
        seeds: &[f64],
        stride: usize,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let (ode, setting) = (trajectory.ode, trajectory.setting);
        let n_columns = directions.count();
        expect("seeds of the derivatives", seeds.len(), ode.n_states * n_columns)?;
        self.prepare(trajectory, parameters, directions, seeds)?;
        let height = ode.n_outputs * stride;
        let mut start = trajectory.range.start;
        while start < trajectory.range.end {
            let stop = (start + BLOCK).min(trajectory.range.end);
            self.evaluate(trajectory, start, stop)?;
            let mut rows = std::mem::take(&mut self.rows);
            rows.clear();
            rows.resize((stop - start) * height, 0.0);
            widest(
                #[inline(always)]
                || {
                    for sample in start..stop {
                        let lane = sample - start;
                        if stride > 0 {
                            let rows = &mut rows[lane * height..][..height];
                            self.measure(trajectory, sample, lane, stride, rows);
                        }
                        // No step follows the record's last sample; one follows the last of a
                        // segment, up to its end.
                        if sample + 1 < setting.n_samples {
                            for part in 0..setting.substeps {
                                self.columns.advance(&self.flow, &self.map, (part, lane));
                            }
                        }
                    }
                },
            );
            self.columns.settle();
            if stride > 0 {
                sink(start, &mut rows);
            }
            self.rows = rows;
            start = stop;
        }
        if self.columns.is_finite() {
            Ok(())
        } else {
            Err(CoreError::Diverged { sample: trajectory.range.end })
        }
    }

    /// Derivative of the state after the last step of the run by a column.
    pub fn end(&self, ode: &OdeModel, state: usize, column: usize) -> f64 {
        self.columns.at(ode.n_states, state, self.flow.places[column])
    }

    fn prepare(
        &mut self,
        trajectory: &Trajectory<'_>,
        parameters: &[f64],
        directions: &Directions<'_>,
        seeds: &[f64],
    ) -> Result<(), CoreError> {
        let (ode, setting) = (trajectory.ode, trajectory.setting);
        let (n, n_moving) = (ode.n_states, ode.n_moving());
        let count = directions.parameters.len();
        let n_values = ode.leaves.n_outputs();
        self.leaf_values.resize(n_values, 0.0);
        self.leaf_slopes.clear();
        self.leaf_slopes.resize(n_values * count, 0.0);
        let (values, slopes) = (&mut self.leaf_values, &mut self.leaf_slopes);
        ode.leaves.jacobian(
            parameters,
            directions.parameters,
            &mut self.registers,
            values,
            slopes,
        )?;
        let found = Seeds { ode, directions, leaf_slopes: &self.leaf_slopes };
        let rates = found.pattern(&ode.rate_entries);
        self.flow = Flow::new(trajectory, &rates, seeds, directions.count());
        self.map = StepMap::new(&self.flow, setting.substeps);
        self.columns.begin(&self.flow, seeds);
        self.output_pattern = found.pattern(&ode.output_entries);
        ode.rate_slopes.prepare(n_moving, &setting.leaves, &mut self.slopes);
        ode.output_slopes.prepare(n_moving, &setting.leaves, &mut self.outputs);
        // One more at the sample, for outputs that need ẋ.
        self.stages.resize(STAGES.len() + 1, Folded::default());
        self.inverse.resize(n * n, 0.0);
        Ok(())
    }

    /// All derivatives of the equations for the samples `start..stop`.
    fn evaluate(
        &mut self,
        trajectory: &Trajectory<'_>,
        start: usize,
        stop: usize,
    ) -> Result<(), CoreError> {
        let &Trajectory { ode, setting, shift, .. } = trajectory;
        let n = ode.n_states;
        let mut state = vec![[0.0; BLOCK]; n];
        let mut slope = vec![[0.0; BLOCK]; n];
        let mut driven = vec![[0.0; BLOCK]; ode.n_inputs];
        // Lanes beyond the last sample repeat it; nothing is taken from them.
        let sample = |lane: usize| (start + lane).min(stop - 1);
        // The states along the run are known, so all samples of a block are evaluated side by side;
        // only S must pass from one to the next.
        for part in 0..setting.substeps {
            for (stage, (place, share)) in STAGES.into_iter().enumerate() {
                for lane in 0..BLOCK {
                    let step = sample(lane) * setting.substeps + part;
                    let from = trajectory.state(step);
                    for i in 0..n {
                        let k = if stage == 0 { 0.0 } else { slope[i][lane] };
                        state[i][lane] = from[i] + share * setting.step_s * k;
                    }
                    for (input, lanes) in driven.iter_mut().enumerate() {
                        lanes[lane] = setting.held[input].steps[step].at(place).0 + shift[input];
                    }
                }
                let instant = Instant::Stage(part, stage);
                self.stage(trajectory, (start, stop), instant, (&state, &driven), &mut slope)?;
            }
            let (map, stages) = (&mut self.map, &self.stages[..STAGES.len()]);
            widest(
                #[inline(always)]
                || map.join(part, stages, setting.step_s),
            );
        }
        for lane in 0..BLOCK {
            let from = trajectory.state(sample(lane) * setting.substeps);
            (0..n).for_each(|i| state[i][lane] = from[i]);
            for (input, lanes) in driven.iter_mut().enumerate() {
                lanes[lane] = setting.held[input].samples[sample(lane)].0 + shift[input];
            }
        }
        let program = &ode.output_slopes;
        if ode.outputs_need_rates {
            let instant = Instant::Sample;
            self.stage(trajectory, (start, stop), instant, (&state, &driven), &mut slope)?;
            slope.iter().enumerate().for_each(|(i, v)| program.load(i, *v, &mut self.outputs));
        }
        state.iter().enumerate().for_each(|(i, v)| program.load(n + i, *v, &mut self.outputs));
        driven.iter().enumerate().for_each(|(i, v)| program.load(2 * n + i, *v, &mut self.outputs));
        program.run(&mut self.outputs);
        self.output_stage.clear();
        let registers = ode.output_entries.iter().map(|e| self.outputs[e.register]);
        self.output_stage.extend(registers);
        Ok(())
    }

    /// Derivatives of the residuals at one stage of a block; `slope` becomes ẋ there.
    fn stage(
        &mut self,
        trajectory: &Trajectory<'_>,
        samples: (usize, usize),
        instant: Instant,
        (state, driven): (&[[f64; BLOCK]], &[[f64; BLOCK]]),
        slope: &mut [[f64; BLOCK]],
    ) -> Result<(), CoreError> {
        let ode = trajectory.ode;
        let n = ode.n_states;
        let program = &ode.rate_slopes;
        state.iter().enumerate().for_each(|(i, v)| program.load(n + i, *v, &mut self.slopes));
        driven.iter().enumerate().for_each(|(i, v)| program.load(2 * n + i, *v, &mut self.slopes));
        program.run_early(&mut self.slopes);
        // Residuals at ẋ = 0, then all that depends on the ẋ that they give.
        (0..n).for_each(|i| program.load(i, [0.0; BLOCK], &mut self.slopes));
        program.run_late(&mut self.slopes);
        match &ode.mass {
            Mass::One => {
                for (rate, &register) in slope.iter_mut().zip(&ode.slope_residuals) {
                    *rate = self.slopes[register].map(|r| -r);
                }
            }
            Mass::Fixed(_) => {
                slope.fill([0.0; BLOCK]);
                for &(row, column, weight) in &trajectory.setting.weights {
                    let residual = &self.slopes[ode.slope_residuals[column]];
                    slope[row].iter_mut().zip(residual).for_each(|(k, r)| *k -= weight * r);
                }
            }
            Mass::Moving(_) => self.solve_mass(trajectory, slope)?,
        }
        if !ode.mass.is_one() {
            slope.iter().enumerate().for_each(|(i, v)| program.load(i, *v, &mut self.slopes));
            program.run_late(&mut self.slopes);
        }
        let into = &mut self.stages[match instant {
            Instant::Stage(_, stage) => stage,
            Instant::Sample => STAGES.len(),
        }];
        let known = (&ode.rate_entries[..], &self.slopes);
        self.flow.fold(trajectory, samples, instant, known, &self.masses, into);
        Ok(())
    }

    /// M⁻¹ of every lane, where it moves, and ẋ.
    fn solve_mass(
        &mut self,
        trajectory: &Trajectory<'_>,
        slope: &mut [[f64; BLOCK]],
    ) -> Result<(), CoreError> {
        let ode = trajectory.ode;
        let n = ode.n_states;
        let store = &mut self.masses;
        store.clear();
        store.resize(n * n, [0.0; BLOCK]);
        for lane in 0..BLOCK {
            let value = |register: usize| self.slopes[register][lane];
            inverse(&ode.slope_mass, n, value, &mut self.scratch, &mut self.inverse)?;
            for i in 0..n {
                let mut sum = 0.0;
                for j in 0..n {
                    let weight = self.inverse[i * n + j];
                    store[i * n + j][lane] = weight;
                    sum -= weight * self.slopes[ode.slope_residuals[j]][lane];
                }
                slope[i][lane] = sum;
            }
        }
        Ok(())
    }

    /// Rows of one sample.
    #[inline(always)]
    fn measure(
        &mut self,
        trajectory: &Trajectory<'_>,
        sample: usize,
        lane: usize,
        stride: usize,
        rows: &mut [f64],
    ) {
        let (ode, flow, pattern) = (trajectory.ode, &self.flow, &self.output_pattern);
        let (n, places) = (ode.n_states, &flow.places);
        for (row, &register) in rows.chunks_exact_mut(stride).zip(&ode.output_registers) {
            row[0] = self.outputs[register][lane];
        }
        if ode.outputs_need_rates {
            // ẋ at the sample itself: S as it stands, between no stages.
            let known = &self.stages[STAGES.len()];
            self.columns.measured(flow, known, lane);
        }
        let columns = &self.columns;
        for group in 0..places.len().div_ceil(GROUP) {
            let (mut states, mut rates) = (&pattern.by_state[..], &pattern.by_rate[..]);
            let order = &flow.order[group * GROUP..];
            for (row, values) in rows.chunks_exact_mut(stride).enumerate() {
                let (mut sum, mut width) = ([[0.0; VECTOR]; VECTORS], 0);
                for (links, is_rate) in [(&mut states, false), (&mut rates, true)] {
                    while let Some((link, rest)) = links.split_first() {
                        if link.row != row {
                            break;
                        }
                        *links = rest;
                        let factor = self.output_stage[link.entry][lane];
                        let reached = flow.widths[group * n + link.from];
                        let from = match is_rate {
                            false => columns.reached(n, link.from, group),
                            true => columns.rate(n, link.from, group),
                        };
                        for (sum, from) in sum.iter_mut().zip(&from.0).take(reached) {
                            (0..VECTOR).for_each(|place| sum[place] += factor * from[place]);
                        }
                        width = width.max(reached);
                    }
                }
                let sums = sum[..width].as_flattened();
                order.iter().zip(sums).for_each(|(&column, sum)| values[1 + column] = *sum);
            }
        }
        for force in &pattern.forces {
            let rate = |input: usize| trajectory.setting.held[input].samples[sample].1;
            let factor = self.output_stage[force.entry][lane] * force.factor;
            rows[force.row * stride + 1 + force.column] += factor * force.delayed.map_or(1.0, rate);
        }
    }
}
