//! What carries the derivatives of a state along: M⁻¹ and the derivatives of the equations folded into
//! one sparse product, for a block of samples side by side. (Python side: none)

use std::collections::BTreeMap;

use crate::state_space::ode_model::Mass;
use crate::tape::derivative_tape::Entry;
use crate::tape::tape_program::Lanes;
use crate::trajectories::runge_kutta::STAGES;
use crate::trajectories::sensitivity_pattern::{BLOCK, GROUP, Pattern, Samples, VECTOR};
use crate::trajectories::trajectory::Trajectory;

/// An entry of −M⁻¹: the same in the whole run, or by its place among those of each sample.
#[derive(Debug, Clone, Copy)]
enum Weight {
    Fixed(f64),
    Moving(usize),
}

/// What one derivative of one equation adds to a link or drive.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Number of the link, or of the drive after all links.
    into: usize,
    /// Place among the entries.
    entry: usize,
    weight: Weight,
    factor: f64,
    /// Input whose rate by the delay multiplies it too.
    delayed: Option<usize>,
}

/// A column that moves a row by itself, without any state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    pub(crate) row: usize,
    /// Place of its column.
    pub(crate) place: usize,
}

/// ∂ẋ/∂x and ∂ẋ by the columns, sparse: found once for a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flow {
    /// Number of links of each row.
    pub(crate) counts: Vec<usize>,
    /// State of each link, row after row.
    pub(crate) sources: Vec<usize>,
    pub(crate) drives: Vec<Drive>,
    /// Columns by their places: those that reach most rows come first.
    pub(crate) order: Vec<usize>,
    /// Place of each column.
    pub(crate) places: Vec<usize>,
    /// Vectors of each row that are not always zero, by group of columns, then row.
    pub(crate) widths: Vec<usize>,
    /// Whether any column reaches a row.
    pub(crate) is_reached: Vec<bool>,
    parts: Vec<Part>,
}

/// Values of links, then drives, at a stage of all samples of a block.
pub(crate) type Folded = Vec<Samples>;

/// Where in a block a stage stands: a part of the samples' intervals and its stage, or the samples.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Instant {
    Stage(usize, usize),
    Sample,
}

impl Flow {
    /// Fold the pattern of a run's residuals; `seeds` (n_states × columns) are derivatives of the state
    /// at its beginning.
    pub(crate) fn new(
        trajectory: &Trajectory<'_>,
        pattern: &Pattern,
        seeds: &[f64],
        n_columns: usize,
    ) -> Self {
        let n = trajectory.ode.n_states;
        let (mut links, mut drives) = (BTreeMap::new(), BTreeMap::new());
        for (row, column, weight) in solved(trajectory) {
            for link in pattern.by_state.iter().filter(|link| link.row == column) {
                let found: &mut Vec<_> = links.entry((row, link.from)).or_default();
                found.push((link.entry, weight, 1.0, None));
            }
            for force in pattern.forces.iter().filter(|force| force.row == column) {
                let found: &mut Vec<_> = drives.entry((row, force.column)).or_default();
                found.push((force.entry, weight, force.factor, force.delayed));
            }
        }
        let mut flow = Self { counts: vec![0; n], ..Self::default() };
        for &(row, from) in links.keys() {
            flow.counts[row] += 1;
            flow.sources.push(from);
        }
        flow.arrange(drives.keys().copied(), seeds, n_columns);
        let drive = |&(row, column): &(usize, usize)| Drive { row, place: flow.places[column] };
        flow.drives = drives.keys().map(drive).collect();
        flow.parts = parts(links.into_values().chain(drives.into_values()));
        flow
    }

    /// Order the columns, and find which vectors of each row are ever reached.
    fn arrange(
        &mut self,
        drives: impl Iterator<Item = (usize, usize)>,
        seeds: &[f64],
        n_columns: usize,
    ) {
        let n = self.counts.len();
        let mut reached: Vec<bool> = seeds.iter().map(|&seed| seed != 0.0).collect();
        drives.for_each(|(row, column)| reached[row * n_columns + column] = true);
        // A chain of states passes everything on after as many rounds as it is long.
        for _ in 0..n {
            let mut first = 0;
            for row in 0..n {
                for link in first..first + self.counts[row] {
                    for column in 0..n_columns {
                        let from = reached[self.sources[link] * n_columns + column];
                        reached[row * n_columns + column] |= from;
                    }
                }
                first += self.counts[row];
            }
        }
        let rows = |column: usize| (0..n).filter(|row| reached[row * n_columns + column]).count();
        let mut order: Vec<usize> = (0..n_columns).collect();
        order.sort_by_key(|&column| n - rows(column));
        self.places = vec![0; n_columns];
        (0..n_columns).for_each(|place| self.places[order[place]] = place);
        let n_groups = n_columns.div_ceil(GROUP);
        self.widths = vec![0; n_groups * n];
        for row in 0..n {
            for place in (0..n_columns).filter(|&p| reached[row * n_columns + order[p]]) {
                self.widths[place / GROUP * n + row] = place % GROUP / VECTOR + 1;
            }
        }
        self.order = order;
        self.is_reached =
            (0..n).map(|row| (0..n_groups).any(|g| self.widths[g * n + row] > 0)).collect();
    }

    /// Values at one stage of the samples `start..stop` from the derivatives of the residuals and,
    /// where M moves, its inverse.
    pub(crate) fn fold(
        &self,
        trajectory: &Trajectory<'_>,
        (start, stop): (usize, usize),
        instant: Instant,
        (entries, slopes): (&[Entry], &Lanes<BLOCK>),
        inverse: &[[f64; BLOCK]],
        into: &mut Folded,
    ) {
        let of = |part: &Part| -> [f64; BLOCK] {
            let slope = &slopes[entries[part.entry].register];
            match part.weight {
                Weight::Fixed(weight) => slope.map(|slope| part.factor * weight * slope),
                Weight::Moving(place) => {
                    let weight = &inverse[place];
                    std::array::from_fn(|lane| -part.factor * weight[lane] * slope[lane])
                }
            }
        };
        into.clear();
        into.resize(self.sources.len() + self.drives.len(), Samples([0.0; BLOCK]));
        for part in &self.parts {
            let mut values = of(part);
            if let Some(input) = part.delayed {
                // A delay acts through the rate of its input, everything else by itself.
                let held = &trajectory.setting.held[input];
                for (lane, value) in values.iter_mut().enumerate() {
                    let sample = (start + lane).min(stop - 1);
                    *value *= match instant {
                        Instant::Sample => held.samples[sample].1,
                        Instant::Stage(part, stage) => {
                            let step = sample * trajectory.setting.substeps + part;
                            held.steps[step].at(STAGES[stage].0).1
                        }
                    };
                }
            }
            into[part.into].0.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }
}

/// Row, column and value of what is not always zero of −M⁻¹.
fn solved(trajectory: &Trajectory<'_>) -> Vec<(usize, usize, Weight)> {
    let n = trajectory.ode.n_states;
    match trajectory.ode.mass {
        Mass::One => (0..n).map(|i| (i, i, Weight::Fixed(-1.0))).collect(),
        Mass::Fixed(_) => {
            let entries = trajectory.setting.weights.iter();
            entries.map(|&(i, j, weight)| (i, j, Weight::Fixed(-weight))).collect()
        }
        Mass::Moving(_) => {
            (0..n * n).map(|place| (place / n, place % n, Weight::Moving(place))).collect()
        }
    }
}

type Found = Vec<(usize, Weight, f64, Option<usize>)>;

fn parts(found: impl Iterator<Item = Found>) -> Vec<Part> {
    let each = |(into, found): (usize, Found)| {
        found.into_iter().map(move |(entry, weight, factor, delayed)| Part {
            into,
            entry,
            weight,
            factor,
            delayed,
        })
    };
    found.enumerate().flat_map(each).collect()
}
