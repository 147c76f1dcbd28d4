//! Trajectories of one record: a single run from its initial state, or multiple shooting.
//!
//! Where a mode grows, one run over a long record is useless: rounding in its first sample grows with
//! it. The record is then cut into segments short against that growth, each runs from its own node, and
//! the nodes are what makes the segments one continuous trajectory, solved for by Newton steps. What is
//! free is not the initial state but as many numbers of the same trajectory: F x at the beginning and,
//! for the growing modes, B x at the end. Outputs and their derivatives are exact for that trajectory.
//!
//! Reference: Bock (1983), "Recent advances in parameter identification techniques for O.D.E.";
//! Ascher, Mattheij & Russell, *Numerical Solution of Boundary Value Problems*, chapter 4; Jategaonkar,
//! *Flight Vehicle System Identification*, 2nd ed., chapter 9.

use std::ops::Range;

use crate::error::CoreError;
use crate::state_space::ode_model::OdeModel;
use crate::trajectories::boundary_system::BoundarySystem;
use crate::trajectories::runge_kutta::{Course, LARGEST_STATE, Setting, expect};
use crate::trajectories::sensitivity::TrajectorySensitivity;
use crate::trajectories::sensitivity_pattern::Directions;
use crate::trajectories::trajectory::Trajectory;

/// Most Newton steps for the nodes.
const MAXIMUM_STEPS: usize = 30;
/// Relative size of the step after which the nodes count as found: the next one would be its square.
const SMALL_STEP: f64 = 1e-8;

/// How the trajectory of a record is set.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    /// Samples where a segment begins, after the first; empty for a single run.
    pub cuts: Vec<usize>,
    /// F (n_states − n_growing rows), then B (n_growing rows), n_states columns, row-major.
    pub ends: Vec<f64>,
    /// Rows of B.
    pub n_growing: usize,
    /// Where the search for the nodes begins: states at the beginning, at each cut, at the end.
    pub guesses: Vec<f64>,
}

/// Buffers of one record.
#[derive(Debug, Clone, Default)]
pub struct Flight {
    /// Parameters on this record.
    pub setting: Setting,
    sensitivity: TrajectorySensitivity,
    states: Vec<f64>,
    nodes: Vec<f64>,
    /// Derivatives of the nodes by all columns, (nodes × n_states) × columns.
    node_slopes: Vec<f64>,
    /// Where each segment ends.
    ends: Vec<f64>,
    transitions: Vec<f64>,
    /// Derivatives of each segment's end by parameters and shifts.
    forced: Vec<f64>,
    sides: Vec<f64>,
    outputs: Vec<f64>,
    rows: Vec<f64>,
    /// Parameters, initial state and shift of the whole run whose states are at hand.
    ran: Option<Vec<f64>>,
    /// Whether its outputs are, too.
    has_outputs: bool,
}

/// One run that is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Wish<'a> {
    /// Parameter values.
    pub parameters: &'a [f64],
    /// Initial state, or F x at the beginning with B x at the end.
    pub initial: &'a [f64],
    /// Added to the inputs.
    pub shift: &'a [f64],
    /// Parameters by which derivatives are wanted.
    pub free: &'a [usize],
    /// Entries of `initial` by which they are wanted.
    pub free_initial: &'a [usize],
    /// Inputs by whose shift they are wanted.
    pub free_shift: &'a [usize],
}

impl Wish<'_> {
    /// All numbers that set a run whole.
    fn whole(&self) -> Vec<f64> {
        [self.parameters, self.initial, self.shift].concat()
    }

    fn count(&self) -> usize {
        self.free.len() + self.free_initial.len() + self.free_shift.len()
    }
}

impl Plan {
    fn is_single(&self) -> bool {
        self.cuts.is_empty() && self.n_growing == 0
    }

    fn segments(&self, n_samples: usize) -> Vec<Range<usize>> {
        let starts = std::iter::once(0).chain(self.cuts.iter().copied());
        let ends = self.cuts.iter().copied().chain(std::iter::once(n_samples));
        starts.zip(ends).map(|(start, end)| start..end).collect()
    }

    /// # Errors
    /// `Shape` where the parts of the plan do not fit a model and a record.
    pub fn check(&self, n: usize, n_samples: usize) -> Result<(), CoreError> {
        if self.is_single() {
            return Ok(());
        }
        expect("conditions at the ends", self.ends.len(), n * n)?;
        expect("guesses of the nodes", self.guesses.len(), n * (self.cuts.len() + 2))?;
        let ascending = self.segments(n_samples).iter().all(|segment| segment.start < segment.end);
        if !ascending || self.n_growing > n {
            let (found, needed) = (self.cuts.len(), n_samples);
            return Err(CoreError::Shape { what: "segments of a record", found, needed });
        }
        Ok(())
    }
}

impl Flight {
    /// Run, without integrating a second time what was run last, and hand rows of `stride` numbers (output, then its derivatives) to `sink` as in
    /// `TrajectorySensitivity`.
    ///
    /// # Errors
    /// `Diverged`, `Singular`, `NotFinite` where the trajectory or a derivative has no value.
    pub fn run(
        &mut self,
        ode: &OdeModel,
        course: &Course<'_>,
        plan: &Plan,
        wish: &Wish<'_>,
        stride: usize,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let asked = plan.is_single().then(|| wish.whole());
        // A search weighs a point, then differentiates there; no number compares equal to itself but
        // is not one.
        if asked.is_none() || self.ran != asked {
            self.ran = None;
            self.setting.prepare(ode, wish.parameters, course)?;
        }
        if plan.is_single() {
            self.nodes.clear();
            self.nodes.extend_from_slice(wish.initial);
            self.node_slopes.clear();
            self.node_slopes.resize(ode.n_states * wish.count(), 0.0);
            for (column, &state) in wish.free_initial.iter().enumerate() {
                self.node_slopes[state * wish.count() + wish.free.len() + column] = 1.0;
            }
        } else {
            self.find_nodes(ode, plan, wish)?;
        }
        for (place, segment) in plan.segments(course.n_samples).into_iter().enumerate() {
            let node = &self.nodes[place * ode.n_states..(place + 1) * ode.n_states];
            let plain = wish.count() == 0;
            if self.ran.is_none() || (plain && !self.has_outputs) {
                self.ran = None;
                self.outputs.resize(ode.n_outputs * course.n_samples, 0.0);
                let (states, outputs) = (&mut self.states, plain.then_some(&mut self.outputs));
                let outputs = outputs.map(Vec::as_mut_slice);
                self.setting.run(ode, segment.clone(), node, wish.shift, states, outputs)?;
                (self.ran, self.has_outputs) = (asked.clone(), plain);
            }
            if plain {
                self.plain(ode, segment, stride, sink);
            } else {
                self.differentiated(ode, segment, place, wish, stride, sink)?;
            }
        }
        Ok(())
    }

    /// State at the first sample and its derivatives (n_states × columns), of the last run.
    pub fn start(&self, ode: &OdeModel) -> (&[f64], &[f64]) {
        let n = ode.n_states;
        let width = self.node_slopes.len() * n / self.nodes.len().max(1);
        (&self.nodes[..n], &self.node_slopes[..width])
    }

    fn plain(
        &mut self,
        ode: &OdeModel,
        segment: Range<usize>,
        stride: usize,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) {
        let (p, n_samples) = (ode.n_outputs, self.setting.n_samples);
        self.rows.clear();
        self.rows.resize(segment.len() * p * stride, 0.0);
        for (rows, sample) in self.rows.chunks_exact_mut(p * stride).zip(segment.clone()) {
            for (output, row) in rows.chunks_exact_mut(stride).enumerate() {
                row[0] = self.outputs[output * n_samples + sample];
            }
        }
        sink(segment.start, &mut self.rows);
    }

    fn differentiated(
        &mut self,
        ode: &OdeModel,
        segment: Range<usize>,
        place: usize,
        wish: &Wish<'_>,
        stride: usize,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let width = ode.n_states * wish.count();
        let seeds = &self.node_slopes[place * width..(place + 1) * width];
        let (setting, states, shift) = (&self.setting, &self.states[..], wish.shift);
        let trajectory = Trajectory { ode, setting, range: segment, states, shift };
        let directions = Directions {
            parameters: wish.free,
            n_initial: wish.free_initial.len(),
            shift: wish.free_shift,
        };
        self.sensitivity.run(&trajectory, wish.parameters, &directions, seeds, stride, sink)
    }

    /// Newton steps from the plan's guesses until the segments meet, then the derivatives of the nodes.
    fn find_nodes(
        &mut self,
        ode: &OdeModel,
        plan: &Plan,
        wish: &Wish<'_>,
    ) -> Result<(), CoreError> {
        let n = ode.n_states;
        expect("numbers at the ends of a record", wish.initial.len(), n)?;
        self.nodes.clear();
        self.nodes.extend_from_slice(&plan.guesses);
        let n_nodes = plan.cuts.len() + 2;
        for _ in 0..MAXIMUM_STEPS {
            self.shoot(ode, plan, wish, false)?;
            let mut sides = std::mem::take(&mut self.sides);
            self.gaps(ode, plan, wish.initial, &mut sides);
            let solved = self.system(ode, plan).solve(&mut sides, 1);
            let (mut step, mut size) = (0.0_f64, 0.0_f64);
            for (node, change) in self.nodes.iter_mut().zip(&sides) {
                *node += change;
                step = step.max(change.abs());
                size = size.max(node.abs());
            }
            // The buffer goes back before an error leaves.
            self.sides = sides;
            solved?;
            if step.is_nan() || size > LARGEST_STATE {
                break;
            }
            if step <= SMALL_STEP * size.max(f64::MIN_POSITIVE) {
                return match wish.count() {
                    0 => Ok(()),
                    _ => self.slopes_of_nodes(ode, plan, wish, n_nodes),
                };
            }
        }
        Err(CoreError::Diverged { sample: plan.cuts.first().copied().unwrap_or_default() })
    }

    /// Run every segment from its node: what they end at (`ends`), with transition matrices, and with
    /// the derivatives by parameters and shifts if asked.
    fn shoot(
        &mut self,
        ode: &OdeModel,
        plan: &Plan,
        wish: &Wish<'_>,
        forced: bool,
    ) -> Result<(), CoreError> {
        let n = ode.n_states;
        let (parameters, shifts) = match forced {
            true => (wish.free, wish.free_shift),
            false => (&[][..], &[][..]),
        };
        let directions = Directions { parameters, n_initial: n, shift: shifts };
        let (count, width) = (directions.count(), parameters.len() + shifts.len());
        let mut seeds = vec![0.0; n * count];
        (0..n).for_each(|i| seeds[i * count + parameters.len() + i] = 1.0);
        self.ends.clear();
        self.transitions.clear();
        self.forced.clear();
        for (place, segment) in plan.segments(self.setting.n_samples).into_iter().enumerate() {
            let node = &self.nodes[place * n..(place + 1) * n];
            let states = &mut self.states;
            self.setting.run(ode, segment.clone(), node, wish.shift, states, None)?;
            self.ends.extend_from_slice(&self.states[self.states.len() - n..]);
            let (setting, states, shift) = (&self.setting, &self.states[..], wish.shift);
            let trajectory = Trajectory { ode, setting, range: segment, states, shift };
            let none = &mut |_: usize, _: &mut [f64]| {};
            self.sensitivity.run(&trajectory, wish.parameters, &directions, &seeds, 0, none)?;
            for state in 0..n {
                for column in 0..count {
                    let slope = self.sensitivity.end(ode, state, column);
                    // Columns: parameters, the node's states, shifts. Those of the node are the
                    // transition A_s.
                    let is_node = (parameters.len()..parameters.len() + n).contains(&column);
                    if is_node { &mut self.transitions } else { &mut self.forced }.push(slope);
                }
            }
        }
        expect("derivatives of the segments", self.forced.len(), self.ends.len() * width)
    }

    fn system<'a>(&'a self, ode: &OdeModel, plan: &'a Plan) -> BoundarySystem<'a> {
        let n = ode.n_states;
        let (n_forward, ends) = (n - plan.n_growing, &plan.ends[..]);
        BoundarySystem { n, n_forward, ends, transitions: &self.transitions }
    }

    /// What is missing in each condition on the nodes.
    fn gaps(&self, ode: &OdeModel, plan: &Plan, initial: &[f64], sides: &mut Vec<f64>) {
        let n = ode.n_states;
        let n_forward = n - plan.n_growing;
        let (first, last) = (&self.nodes[..n], &self.nodes[self.nodes.len() - n..]);
        let missing = |row: usize, node: &[f64]| {
            let line = &plan.ends[row * n..(row + 1) * n];
            initial[row] - line.iter().zip(node).map(|(w, x)| w * x).sum::<f64>()
        };
        sides.clear();
        sides.extend((0..n_forward).map(|row| missing(row, first)));
        sides.extend(self.ends.iter().zip(&self.nodes[n..]).map(|(end, node)| end - node));
        sides.extend((n_forward..n).map(|row| missing(row, last)));
    }

    /// Derivatives of the nodes by every column: the same equations with other right sides.
    fn slopes_of_nodes(
        &mut self,
        ode: &OdeModel,
        plan: &Plan,
        wish: &Wish<'_>,
        n_nodes: usize,
    ) -> Result<(), CoreError> {
        self.shoot(ode, plan, wish, true)?;
        let n = ode.n_states;
        let (count, n_forward) = (wish.count(), n - plan.n_growing);
        let (n_free, n_initial) = (wish.free.len(), wish.free_initial.len());
        let width = n_free + wish.free_shift.len();
        let mut sides = vec![0.0; n_nodes * n * count];
        for (column, &place) in wish.free_initial.iter().enumerate() {
            // Conditions at the beginning are the first rows of the system, those at the end its
            // last.
            let row = if place < n_forward { place } else { n_nodes * n - n + place };
            sides[row * count + n_free + column] = 1.0;
        }
        for (place, &slope) in self.forced.iter().enumerate() {
            let (row, column) = (place / width, place % width);
            // What a segment's end gains while its node stays: the right side d_s of its joint.
            let column = if column < n_free { column } else { column + n_initial };
            sides[(n_forward + row) * count + column] = slope;
        }
        self.system(ode, plan).solve(&mut sides, count)?;
        self.node_slopes = sides;
        Ok(())
    }
}

#[cfg(test)]
#[path = "tests/shooting.rs"]
mod tests;
