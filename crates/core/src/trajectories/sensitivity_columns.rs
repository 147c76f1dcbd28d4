//! Derivatives of a state, column by column, taken over the steps of a trajectory. (Python side: none)

use crate::numerics::died_away::leave_out;
use crate::trajectories::sensitivity_flow::{Drive, Flow, Folded};
use crate::trajectories::sensitivity_pattern::{GROUP, Samples, VECTOR, VECTORS};
use crate::trajectories::step_map::StepMap;

/// Numbers of a group of columns.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Many(pub(crate) [[f64; VECTOR]; VECTORS]);
const NONE: Many = Many([[0.0; VECTOR]; VECTORS]);
/// Place of what drives a row, behind S of even and of odd steps.
const DRIVEN: usize = 2;

/// Buffers, kept from run to run.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSteps {
    /// By group, then state: S of even and of odd steps, and what drives the row. Side by side, for
    /// stores to one of them must not seem to hit what is read of another (addresses modulo 4096 differ).
    rows: Vec<[Many; 3]>,
    /// Which S is at hand.
    now: usize,
}

/// Sum a row with as many vectors as it has; one that nothing reaches is left out.
macro_rules! by_width {
    ($width:expr, $row:expr, $rows:expr) => {
        match $width {
            0 => {}
            1 => $row.sum::<1>($rows),
            2 => $row.sum::<2>($rows),
            3 => $row.sum::<3>($rows),
            4 => $row.sum::<4>($rows),
            5 => $row.sum::<5>($rows),
            6 => $row.sum::<6>($rows),
            7 => $row.sum::<7>($rows),
            _ => $row.sum::<VECTORS>($rows),
        }
    };
}

/// The sum of a row's factors: their states and values.
#[derive(Clone, Copy)]
struct Row<'a> {
    place: usize,
    sources: &'a [usize],
    values: &'a [f64],
    now: usize,
}

impl Row<'_> {
    #[inline(always)]
    fn sum<const V: usize>(self, rows: &mut [[Many; 3]]) {
        let mut sum: [[f64; VECTOR]; V] = std::array::from_fn(|v| rows[self.place][DRIVEN].0[v]);
        for (&source, &value) in self.sources.iter().zip(self.values) {
            let from = &rows[source][self.now].0;
            for (sum, from) in sum.iter_mut().zip(from) {
                (0..VECTOR).for_each(|lane| sum[lane] += value * from[lane]);
            }
        }
        rows[self.place][1 - self.now].0[..V].copy_from_slice(&sum);
    }
}

/// The links of all rows, one row after the other.
#[derive(Clone, Copy)]
struct Links<'a> {
    counts: &'a [usize],
    sources: &'a [usize],
    values: &'a [f64],
}

impl ColumnSteps {
    /// Begin from derivatives of the state (n_states × columns).
    pub(crate) fn begin(&mut self, flow: &Flow, seeds: &[f64]) {
        let n = flow.counts.len();
        let n_groups = flow.places.len().div_ceil(GROUP);
        self.rows.clear();
        self.rows.resize(n_groups * n, [NONE; 3]);
        self.now = 0;
        for (state, seeds) in seeds.chunks_exact(flow.places.len().max(1)).enumerate() {
            for (&place, &seed) in flow.places.iter().zip(seeds) {
                let row = &mut self.rows[place / GROUP * n + state][self.now];
                row.0[place % GROUP / VECTOR][place % VECTOR] = seed;
            }
        }
    }

    /// S of a state by a group's columns.
    #[inline(always)]
    pub(crate) fn reached(&self, n_states: usize, state: usize, group: usize) -> &Many {
        &self.rows[group * n_states + state][self.now]
    }

    /// ẋ of a state by a group's columns, right after `measured`.
    #[inline(always)]
    pub(crate) fn rate(&self, n_states: usize, state: usize, group: usize) -> &Many {
        &self.rows[group * n_states + state][1 - self.now]
    }

    /// Derivative of a state by the column at a place.
    pub(crate) fn at(&self, n_states: usize, state: usize, place: usize) -> f64 {
        let row = self.reached(n_states, state, place / GROUP);
        row.0[place % GROUP / VECTOR][place % VECTOR]
    }

    /// Leave out what has died away.
    pub(crate) fn settle(&mut self) {
        self.rows.iter_mut().for_each(|row| leave_out(row[self.now].0.as_flattened_mut()));
    }

    /// Whether all derivatives are numbers.
    pub(crate) fn is_finite(&self) -> bool {
        let all = |row: &[Many; 3]| row[self.now].0.as_flattened().iter().all(|v| v.is_finite());
        self.rows.iter().all(all)
    }

    /// Put what drives the columns where their rows begin their sums.
    #[inline(always)]
    fn drive(&mut self, n_states: usize, drives: &[Drive], values: impl Iterator<Item = f64>) {
        for (drive, value) in drives.iter().zip(values) {
            let row = &mut self.rows[drive.place / GROUP * n_states + drive.row][DRIVEN];
            row.0[drive.place % GROUP / VECTOR][drive.place % VECTOR] = value;
        }
    }

    /// Take all columns over a part of the interval of a sample of a block.
    #[inline(always)]
    pub(crate) fn advance(&mut self, flow: &Flow, map: &StepMap, (part, sample): (usize, usize)) {
        let (values, driven) = map.at(part, sample).split_at(map.sources.len());
        self.drive(flow.counts.len(), &map.drives, driven.iter().copied());
        let links = Links { counts: &map.counts, sources: &map.sources, values };
        self.multiply(flow, links);
        self.now = 1 - self.now;
    }

    /// Find ẋ by the columns at a sample itself: between no stages.
    #[inline(always)]
    pub(crate) fn measured(&mut self, flow: &Flow, known: &Folded, sample: usize) {
        let at = |lanes: &Samples| lanes.0[sample];
        let (links, driven) = known.split_at(flow.sources.len());
        let values: Vec<f64> = links.iter().map(at).collect();
        // What drives a row within a step need not drive its rate.
        self.rows.iter_mut().for_each(|row| row[DRIVEN] = NONE);
        self.drive(flow.counts.len(), &flow.drives, driven.iter().map(at));
        let links = Links { counts: &flow.counts, sources: &flow.sources, values: &values };
        self.multiply(flow, links);
    }

    /// All links and what drives the rows, into the S that is not at hand.
    #[inline(always)]
    fn multiply(&mut self, flow: &Flow, links: Links<'_>) {
        let n = links.counts.len();
        let groups = self.rows.chunks_exact_mut(n.max(1)).zip(flow.widths.chunks_exact(n.max(1)));
        for (rows, widths) in groups {
            let Links { mut sources, mut values, .. } = links;
            for (place, &count) in links.counts.iter().enumerate() {
                let here;
                (here, sources) = sources.split_at(count);
                let factors;
                (factors, values) = values.split_at(count);
                let row = Row { place, sources: here, values: factors, now: self.now };
                by_width!(widths[place], row, rows);
            }
        }
    }
}
