//! Derivatives of a state, column by column, taken over the steps of a trajectory. (Python side: none)

use crate::trajectories::runge_kutta::{STAGES, WEIGHTS};
use crate::trajectories::sensitivity_flow::{Flow, Folded};
use crate::trajectories::sensitivity_pattern::{GROUP, VECTOR, VECTORS};

/// Numbers of a group of columns.
pub(crate) type Many = [[f64; VECTOR]; VECTORS];
const NONE: Many = [[0.0; VECTOR]; VECTORS];

/// Buffers, kept from run to run.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColumnSteps {
    /// S by group, then state.
    pub(crate) reached: Vec<Many>,
    /// K of the sample at work, by group, then state.
    pub(crate) slope: Vec<Many>,
    /// S within a step, of every other stage; by group, for what no column reaches stays zero.
    moved: [Vec<Many>; 2],
    sum: Vec<Many>,
    /// What drives the columns, by group, stage, state.
    driven: Vec<Many>,
}

/// Do something with as many vectors as a row has; a row that nothing reaches is left out.
macro_rules! by_width {
    ($width:expr, $work:ident, $($argument:expr),+) => {
        match $width {
            0 => {}
            1 => $work::<1>($($argument),+),
            2 => $work::<2>($($argument),+),
            3 => $work::<3>($($argument),+),
            4 => $work::<4>($($argument),+),
            5 => $work::<5>($($argument),+),
            6 => $work::<6>($($argument),+),
            7 => $work::<7>($($argument),+),
            _ => $work::<VECTORS>($($argument),+),
        }
    };
}

/// The sum of a row's links: their states, their values, and S.
#[derive(Clone, Copy)]
struct Row<'a> {
    driven: &'a Many,
    sources: &'a [usize],
    values: &'a [f64],
    from: &'a [Many],
}

impl Row<'_> {
    #[inline(always)]
    fn slope<const V: usize>(self) -> [[f64; VECTOR]; V] {
        let mut sum: [[f64; VECTOR]; V] = std::array::from_fn(|v| self.driven[v]);
        for (&source, &value) in self.sources.iter().zip(self.values) {
            let from = &self.from[source];
            for (sum, from) in sum.iter_mut().zip(from) {
                (0..VECTOR).for_each(|lane| sum[lane] += value * from[lane]);
            }
        }
        sum
    }
}

#[inline(always)]
fn keep<const V: usize>(row: Row<'_>, slope: &mut Many) {
    slope[..V].copy_from_slice(&row.slope::<V>());
}

/// A stage whose end another one follows.
#[inline(always)]
fn pass<const V: usize>(
    row: Row<'_>,
    (stage, ahead): (usize, f64),
    begun: &Many,
    sum: &mut Many,
    next: &mut Many,
) {
    let slope = row.slope::<V>();
    for v in 0..V {
        for lane in 0..VECTOR {
            let before = if stage == 0 { 0.0 } else { sum[v][lane] };
            sum[v][lane] = before + WEIGHTS[stage] * slope[v][lane];
            next[v][lane] = begun[v][lane] + ahead * slope[v][lane];
        }
    }
}

/// The stage that ends a step.
#[inline(always)]
fn finish<const V: usize>(row: Row<'_>, sixth: f64, sum: &Many, reached: &mut Many) {
    let slope = row.slope::<V>();
    for v in 0..V {
        for lane in 0..VECTOR {
            reached[v][lane] += sixth * (sum[v][lane] + slope[v][lane]);
        }
    }
}

impl ColumnSteps {
    /// Begin from derivatives of the state (n_states × columns).
    pub(crate) fn begin(&mut self, flow: &Flow, seeds: &[f64]) {
        let n = flow.counts.len();
        let n_groups = flow.places.len().div_ceil(GROUP);
        let resized = |buffer: &mut Vec<Many>, length: usize| {
            buffer.clear();
            buffer.resize(length, NONE);
        };
        resized(&mut self.driven, n_groups * STAGES.len() * n);
        resized(&mut self.sum, n);
        let [even, odd] = &mut self.moved;
        let by_group = [&mut self.reached, &mut self.slope, even, odd];
        by_group.into_iter().for_each(|each| resized(each, n_groups * n));
        for (state, seeds) in seeds.chunks_exact(flow.places.len().max(1)).enumerate() {
            for (&place, &seed) in flow.places.iter().zip(seeds) {
                self.reached[place / GROUP * n + state][place % GROUP / VECTOR][place % VECTOR] =
                    seed;
            }
        }
    }

    /// Derivative of a state by the column at a place.
    pub(crate) fn at(&self, n_states: usize, state: usize, place: usize) -> f64 {
        self.reached[place / GROUP * n_states + state][place % GROUP / VECTOR][place % VECTOR]
    }

    /// Take all columns over one step, whose stages are known for a sample of a block.
    #[inline(always)]
    pub(crate) fn advance(&mut self, flow: &Flow, stages: &[Folded], sample: usize, step_s: f64) {
        let n = flow.counts.len();
        for (stage, known) in stages.iter().enumerate() {
            self.drive(flow, known, sample, stage);
        }
        for group in 0..flow.widths.len() / n.max(1) {
            self.follow(flow, stages, sample, step_s, group);
        }
    }

    /// Put what drives the columns of a stage where its rows begin their sums.
    #[inline(always)]
    fn drive(&mut self, flow: &Flow, known: &Folded, sample: usize, stage: usize) {
        let (n, count) = (flow.counts.len(), flow.drives.len());
        for (drive, &value) in flow.drives.iter().zip(&known.drives[sample * count..]) {
            let (group, lane) = (drive.place / GROUP, drive.place % GROUP);
            let row = &mut self.driven[(group * STAGES.len() + stage) * n + drive.row];
            row[lane / VECTOR][lane % VECTOR] = value;
        }
    }

    #[inline(always)]
    fn follow(&mut self, flow: &Flow, stages: &[Folded], sample: usize, step_s: f64, group: usize) {
        let n = flow.counts.len();
        let own = group * n..(group + 1) * n;
        let (begun, widths) = (&mut self.reached[own.clone()], &flow.widths[own.clone()]);
        let [even, odd] = &mut self.moved;
        let (even, odd) = (&mut even[own.clone()], &mut odd[own]);
        for (stage, known) in stages.iter().enumerate() {
            let driven = &self.driven[(group * STAGES.len() + stage) * n..][..n];
            let (mut sources, mut values) = (&flow.sources[..], known.of(flow, sample));
            // S moved to this stage is read, and that of the next is written, in turn.
            let (from, next) =
                if stage % 2 == 0 { (&*odd, &mut *even) } else { (&*even, &mut *odd) };
            for row in 0..n {
                let here;
                (here, sources) = sources.split_at(flow.counts[row]);
                let factors;
                (factors, values) = values.split_at(flow.counts[row]);
                let of = |from| Row { driven: &driven[row], sources: here, values: factors, from };
                let sum = &mut self.sum[row];
                match STAGES.get(stage + 1) {
                    Some(next_stage) => {
                        let row_of = if stage == 0 { of(&*begun) } else { of(from) };
                        let moves = (stage, next_stage.1 * step_s);
                        by_width!(
                            widths[row],
                            pass,
                            row_of,
                            moves,
                            &begun[row],
                            sum,
                            &mut next[row]
                        );
                    }
                    None => {
                        by_width!(
                            widths[row],
                            finish,
                            of(from),
                            step_s / 6.0,
                            sum,
                            &mut begun[row]
                        );
                    }
                }
            }
        }
    }

    /// ẋ by the columns of a group at a sample itself, into `slope`: between no stages.
    #[inline(always)]
    pub(crate) fn measured(&mut self, flow: &Flow, known: &Folded, sample: usize, group: usize) {
        let n = flow.counts.len();
        self.drive(flow, known, sample, 0);
        let from = &self.reached[group * n..(group + 1) * n];
        let driven = &self.driven[group * STAGES.len() * n..][..n];
        let (mut sources, mut values) = (&flow.sources[..], known.of(flow, sample));
        for (row, driven) in driven.iter().enumerate() {
            let here;
            (here, sources) = sources.split_at(flow.counts[row]);
            let factors;
            (factors, values) = values.split_at(flow.counts[row]);
            let row_of = Row { driven, sources: here, values: factors, from };
            let place = group * n + row;
            by_width!(flow.widths[place], keep, row_of, &mut self.slope[place]);
        }
    }
}

impl Folded {
    /// Values of all links at a sample of the block.
    #[inline(always)]
    fn of(&self, flow: &Flow, sample: usize) -> &[f64] {
        let count = flow.sources.len();
        &self.links[sample * count..][..count]
    }
}
