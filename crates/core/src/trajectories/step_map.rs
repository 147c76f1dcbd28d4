//! One step of a trajectory's derivatives as a map S₊ = Φ S + Ψ, for a block of samples side by side.
//! (Python side: none)
//!
//! The four stages are linear in S: with X₁ = I, K_s = A_s X_s + B_s and X_{s+1} = I + c h K_s, Φ and Ψ
//! are I + h/6 (K₁ + 2 K₂ + 2 K₃ + K₄). Stages are sparse and known for all samples of a block, so they
//! are joined in whole vectors of samples; in sequence each sample's columns meet one product.

use crate::trajectories::runge_kutta::{STAGES, WEIGHTS};
use crate::trajectories::sensitivity_flow::{Drive, Flow, Folded};
use crate::trajectories::sensitivity_pattern::{BLOCK, Samples};

const NONE: Samples = Samples([0.0; BLOCK]);
/// Place of the sum among the numbers of an entry, behind those of X.
const SUM: usize = 2;
/// Of an entry that no stage has.
const NEVER: usize = usize::MAX;

/// One entry of K at one stage.
#[derive(Debug, Clone, Copy)]
struct Cell {
    entry: usize,
    /// What its sum begins with, among the links and drives.
    begins: Option<usize>,
    /// Products in its sum.
    count: usize,
    /// Whether stages before had nothing here.
    is_new: bool,
    /// 1 on the diagonal of Φ, else 0.
    unit: f64,
}

/// Which entries the map of a run has, and how they are made.
#[derive(Debug, Clone, Default)]
pub(crate) struct StepMap {
    /// Number of entries of each row of Φ.
    pub(crate) counts: Vec<usize>,
    /// State of each entry of Φ, row after row.
    pub(crate) sources: Vec<usize>,
    /// Entries of Ψ; those of a sample follow its Φ.
    pub(crate) drives: Vec<Drive>,
    cells: [Vec<Cell>; STAGES.len()],
    /// Place among links, and entry of X, of every product, stage by stage.
    products: Vec<(u32, u32)>,
    /// Of each entry X of even and of odd stages, and the sum over stages: side by side, for stores to
    /// one of them must not seem to hit what is read of another (their addresses modulo 4096 differ).
    work: Vec<[Samples; 3]>,
    /// Of each part of the samples' intervals, then sample, its Φ, then its Ψ.
    lines: Vec<f64>,
}

/// Where K is not always zero, by row, then column: the states, and after them the run's columns.
struct Pattern {
    n: usize,
    width: usize,
    /// Stage from which on an entry is there.
    born: Vec<usize>,
    /// Drive of an entry.
    drives: Vec<Option<usize>>,
}

impl Pattern {
    fn new(flow: &Flow) -> Self {
        let (n, width) = (flow.counts.len(), flow.counts.len() + flow.places.len());
        let mut found =
            Self { n, width, born: vec![NEVER; n * width], drives: vec![None; n * width] };
        for (number, drive) in flow.drives.iter().enumerate() {
            let at = drive.row * width + n + drive.place;
            (found.born[at], found.drives[at]) = (0, Some(number));
        }
        // X begins as the unit matrix: also where K comes later, its diagonal is set anew by all stages.
        for row in (0..n).filter(|&row| flow.is_reached[row]) {
            found.born[row * (width + 1)] = 0;
        }
        for stage in 0..STAGES.len() {
            let before = found.born.clone();
            for (row, state, _) in links(flow) {
                // X is the unit matrix, and what K had before.
                let reached = |&column: &usize| before[state * width + column] < stage;
                for column in (0..width).filter(reached).chain([state]) {
                    let born = &mut found.born[row * width + column];
                    *born = stage.min(*born);
                }
            }
        }
        found
    }

    /// Rows and columns where a stage's K is not always zero.
    fn at_stage(&self, stage: usize) -> impl Iterator<Item = (usize, usize)> {
        let there = move |at: &usize| self.born[*at] <= stage;
        (0..self.born.len()).filter(there).map(|at| (at / self.width, at % self.width))
    }

    fn is_known(&self, row: usize, column: usize, stage: usize) -> bool {
        self.born[row * self.width + column] <= stage
    }
}

/// Rows, states and numbers of the links through which a column passes.
fn links(flow: &Flow) -> impl Iterator<Item = (usize, usize, usize)> {
    let rows = flow.counts.iter().enumerate();
    let rows = rows.flat_map(|(row, &count)| std::iter::repeat_n(row, count));
    let all = rows.zip(&flow.sources).enumerate();
    all.filter(|(_, (_, state))| flow.is_reached[**state]).map(|(k, (row, &state))| (row, state, k))
}

impl StepMap {
    /// The entries of a flow's map, with room for those of all parts of a sample's interval.
    pub(crate) fn new(flow: &Flow, n_parts: usize) -> Self {
        let pattern = Pattern::new(flow);
        let n = pattern.n;
        let mut entries: Vec<(usize, usize)> = (0..n)
            .flat_map(|row| (0..pattern.width).map(move |column| (row, column)))
            .filter(|&(row, column)| pattern.is_known(row, column, STAGES.len() - 1))
            .collect();
        entries.sort_by_key(|&(_, column)| column >= n);
        let mut map = Self { counts: vec![0; n], ..Self::default() };
        for &(row, column) in &entries {
            if column < n {
                map.counts[row] += 1;
                map.sources.push(column);
            } else {
                map.drives.push(Drive { row, place: column - n });
            }
        }
        map.plan(flow, &pattern, &entries);
        map.work = vec![[NONE; 3]; entries.len()];
        map.lines = vec![0.0; n_parts * BLOCK * entries.len()];
        map
    }

    /// How K comes from stage to stage.
    fn plan(&mut self, flow: &Flow, pattern: &Pattern, entries: &[(usize, usize)]) {
        let mut places = vec![0; pattern.born.len()];
        for (place, &(row, column)) in entries.iter().enumerate() {
            places[row * pattern.width + column] = place;
        }
        let mut by_row = vec![Vec::new(); pattern.n];
        links(flow).for_each(|(row, state, link)| by_row[row].push((state, link)));
        for stage in 0..STAGES.len() {
            for (row, column) in pattern.at_stage(stage) {
                let at = row * pattern.width + column;
                let drive = pattern.drives[at].map(|drive| flow.sources.len() + drive);
                let mut cell = Cell {
                    entry: places[at],
                    begins: drive,
                    count: 0,
                    is_new: pattern.born[at] == stage,
                    unit: unit(row, column),
                };
                for &(state, link) in &by_row[row] {
                    let is_unit = state == column;
                    if stage == 0 && is_unit {
                        cell.begins = Some(link);
                    } else if stage > 0 && (is_unit || pattern.is_known(state, column, stage - 1)) {
                        let from = places[state * pattern.width + column];
                        self.products.push((link as u32, from as u32));
                        cell.count += 1;
                    }
                }
                self.cells[stage].push(cell);
            }
        }
    }

    /// Φ, then Ψ, over a part of the interval of a sample of the block.
    #[inline(always)]
    pub(crate) fn at(&self, part: usize, sample: usize) -> &[f64] {
        let width = self.work.len();
        &self.lines[(part * BLOCK + sample) * width..][..width]
    }

    /// Join the stages of a part of the interval of each sample of a block.
    #[inline(always)]
    pub(crate) fn join(&mut self, part: usize, stages: &[Folded], step_s: f64) {
        let width = self.work.len();
        let own = part * BLOCK * width..(part + 1) * BLOCK * width;
        let mut products = &self.products[..];
        for (stage, known) in stages.iter().enumerate() {
            let (from, next) = if stage % 2 == 0 { (1, 0) } else { (0, 1) };
            for cell in &self.cells[stage] {
                let here;
                (here, products) = products.split_at(cell.count);
                let mut slope = cell.begins.map_or(NONE, |place| known[place]).0;
                for &(link, entry) in here {
                    let (link, moved) =
                        (&known[link as usize].0, &self.work[entry as usize][from].0);
                    (0..BLOCK).for_each(|lane| slope[lane] += link[lane] * moved[lane]);
                }
                let work = &mut self.work[cell.entry];
                let mut sum = if cell.is_new { NONE.0 } else { work[SUM].0 };
                let Some(&(_, share)) = STAGES.get(stage + 1) else {
                    let lines = self.lines[own.clone()].iter_mut().skip(cell.entry).step_by(width);
                    for (lane, entry) in lines.enumerate() {
                        *entry = cell.unit + step_s / 6.0 * (sum[lane] + slope[lane]);
                    }
                    continue;
                };
                for lane in 0..BLOCK {
                    sum[lane] += WEIGHTS[stage] * slope[lane];
                    slope[lane] = cell.unit + share * step_s * slope[lane];
                }
                (work[SUM], work[next]) = (Samples(sum), Samples(slope));
            }
        }
    }
}

/// Entry of the unit matrix.
fn unit(row: usize, column: usize) -> f64 {
    if row == column { 1.0 } else { 0.0 }
}
