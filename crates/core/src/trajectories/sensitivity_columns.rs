//! Derivatives of a state, column by column, taken over the steps of a trajectory. (Python side: none)

use crate::numerics::widest::widest;
use crate::state_space::ode_model::Mass;
use crate::trajectories::runge_kutta::{STAGES, WEIGHTS};
use crate::trajectories::sensitivity_pattern::{GROUP, Pattern};
use crate::trajectories::trajectory::{Rate, Trajectory};

/// Samples whose derivatives are known side by side.
pub(crate) const BLOCK: usize = 16;
/// Columns that fit a vector register.
const VECTOR: usize = 4;
type Many = [f64; GROUP];

/// Derivatives of the equations along a block of a trajectory, and the lane of the sample at work.
pub(crate) struct Derivatives<'a> {
    pub(crate) trajectory: &'a Trajectory<'a>,
    pub(crate) pattern: &'a Pattern,
    /// Of each stage of each part of a sample interval; then M⁻¹, where it moves.
    pub(crate) stages: &'a [Vec<[f64; BLOCK]>],
    pub(crate) masses: &'a [Vec<[f64; BLOCK]>],
    pub(crate) lane: usize,
}

/// A stage of a step.
#[derive(Debug, Clone, Copy)]
struct Stage {
    place: usize,
    rate: Rate,
}

/// Buffers, kept from run to run.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSteps {
    /// Columns of each group, whole vectors of them.
    widths: Vec<usize>,
    /// S by group, then state.
    pub(crate) reached: Vec<Many>,
    /// Of the group at work, by state.
    moved: Vec<Many>,
    pub(crate) slope: Vec<Many>,
    plain: Vec<Many>,
    sum: Vec<Many>,
}

impl ColumnSteps {
    /// Begin with zeros; the number of groups of columns.
    pub(crate) fn begin(&mut self, n_states: usize, n_columns: usize) -> usize {
        let n_groups = n_columns.div_ceil(GROUP);
        let width = |group: usize| (n_columns - group * GROUP).min(GROUP);
        self.widths.clear();
        self.widths.extend((0..n_groups).map(|g| width(g).div_ceil(VECTOR) * VECTOR));
        self.reached.clear();
        self.reached.resize(n_groups * n_states, [0.0; GROUP]);
        for buffer in [&mut self.moved, &mut self.slope, &mut self.plain, &mut self.sum] {
            buffer.clear();
            buffer.resize(n_states, [0.0; GROUP]);
        }
        n_groups
    }

    /// K of one group of columns at a stage, from the moved sensitivities.
    #[inline(always)]
    fn stage_slopes<const W: usize>(&mut self, known: &Derivatives<'_>, at: Stage, group: usize) {
        let lane = known.lane % BLOCK;
        let stage = &known.stages[at.place][..];
        let links = &known.pattern.by_state[..];
        let mut first = 0;
        for (row, slope) in self.slope.iter_mut().enumerate() {
            let mut sum = [0.0; W];
            while let Some(link) = links.get(first).filter(|link| link.row == row) {
                let factor = stage[link.entry][lane];
                let from = &self.moved[link.from];
                (0..W).for_each(|column| sum[column] -= factor * from[column]);
                first += 1;
            }
            slope[..W].copy_from_slice(&sum);
        }
        for force in &known.pattern.forces[group] {
            // A delay acts through the rate of its input, everything else by itself.
            let late = force.delayed.map_or(1.0, |input| at.rate.of(known.trajectory, input));
            self.slope[force.row][force.lane] -= stage[force.entry][lane] * force.factor * late;
        }
        self.solve_slopes::<W>(known, at.place);
    }

    /// M⁻¹ times the slopes.
    #[inline(always)]
    fn solve_slopes<const W: usize>(&mut self, known: &Derivatives<'_>, place: usize) {
        let Derivatives { trajectory, masses, .. } = known;
        let (n, lane) = (trajectory.ode.n_states, known.lane % BLOCK);
        if trajectory.ode.mass.is_one() {
            return;
        }
        self.plain.copy_from_slice(&self.slope);
        self.slope.iter_mut().for_each(|slope| slope[..W].fill(0.0));
        let (slope, plain) = (&mut self.slope[..], &self.plain[..]);
        let mut add = |row: usize, column: usize, weight: f64| {
            let (to, from) = (&mut slope[row], &plain[column]);
            (0..W).for_each(|place| to[place] += weight * from[place]);
        };
        if let Mass::Fixed(_) = trajectory.ode.mass {
            for &(row, column, weight) in &trajectory.setting.weights {
                add(row, column, weight);
            }
        } else {
            for (entry, weight) in masses[place].iter().enumerate() {
                add(entry / n, entry % n, weight[lane]);
            }
        }
    }

    /// Take all columns over one step.
    pub(crate) fn advance(&mut self, known: &Derivatives<'_>, sample: usize, part: usize) {
        for group in 0..self.widths.len() {
            widest(
                #[inline(always)]
                || match self.widths[group] {
                    4 => self.follow::<4>(known, sample, part, group),
                    8 => self.follow::<8>(known, sample, part, group),
                    12 => self.follow::<12>(known, sample, part, group),
                    _ => self.follow::<GROUP>(known, sample, part, group),
                },
            );
        }
    }

    /// ẋ by the columns of a group at a sample itself, into `slope`: between no stages.
    pub(crate) fn measured(
        &mut self,
        known: &Derivatives<'_>,
        place: usize,
        sample: usize,
        group: usize,
    ) {
        let n = known.trajectory.ode.n_states;
        self.moved.copy_from_slice(&self.reached[group * n..(group + 1) * n]);
        self.stage_slopes::<GROUP>(known, Stage { place, rate: Rate::Sample(sample) }, group);
    }

    #[inline(always)]
    fn follow<const W: usize>(
        &mut self,
        known: &Derivatives<'_>,
        sample: usize,
        part: usize,
        group: usize,
    ) {
        let Trajectory { ode, setting, .. } = known.trajectory;
        let (n, h) = (ode.n_states, setting.step_s);
        let step = sample * setting.substeps + part;
        let own = group * n..(group + 1) * n;
        self.moved.copy_from_slice(&self.reached[own.clone()]);
        self.sum.fill([0.0; GROUP]);
        for (stage, (place, _)) in STAGES.into_iter().enumerate() {
            let rate = Rate::Step(step, place);
            self.stage_slopes::<W>(known, Stage { place: 4 * part + stage, rate }, group);
            let ahead = STAGES.get(stage + 1).map_or(0.0, |next| next.1) * h;
            let begun = &self.reached[own.clone()];
            let rows = self.moved.iter_mut().zip(&mut self.sum).zip(&self.slope).zip(begun);
            for (((moved, sum), slope), begun) in rows {
                for column in 0..W {
                    sum[column] += WEIGHTS[stage] * slope[column];
                    moved[column] = begun[column] + ahead * slope[column];
                }
            }
        }
        for (entry, sum) in self.reached[own].iter_mut().zip(&self.sum) {
            (0..W).for_each(|column| entry[column] += h / 6.0 * sum[column]);
        }
    }
}
