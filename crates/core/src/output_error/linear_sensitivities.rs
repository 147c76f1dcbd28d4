//! Sensitivities of a linear model by one recursion, a block of samples at a time.
//! (Python side: identification/output_error/fit.py)
//!
//! The state and its derivatives by θ, initial state and input shifts are columns of one matrix S:
//! S⁺ = Φ S + Σ_q K_q · source_q, where the sources are the states themselves (for ∂Φ/∂θ x) and the
//! samples of the inputs. The state passes through a block alone; then the sum over the sources,
//! which waits for nothing, fills a few columns of all samples before the recursion runs through.

use crate::linear::block_recursion::{Acting, BLOCK, Line, carry};
use crate::linear::discretisation::Sampled;
use crate::numerics::widest::widest;
use crate::output_error::linear_family::LinearPoint;
use crate::output_error::model_on_records::{LANES, Wanted};

/// One number at each sample.
type Scalars = Line<1>;
/// A few columns at each sample.
type Columns = Line<LANES>;

/// Buffers of a run, kept from block to block.
#[derive(Debug, Clone)]
pub struct Workspace {
    n_states: usize,
    /// States, taps, the constant.
    sources: Vec<Scalars>,
    /// What is left of one output.
    output: Scalars,
    /// The state at the first sample of the block.
    state: Vec<[f64; 1]>,
    /// Its derivatives there, by chunk and state.
    slopes: Vec<[f64; LANES]>,
    /// The same at each sample.
    moved: Vec<Columns>,
    /// Derivatives of one output.
    moved_output: Columns,
}

impl Workspace {
    /// Where the samples behind each tap go.
    pub fn taps(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.sources[self.n_states..].iter_mut().map(|line| line.as_flattened_mut())
    }
}

/// Coefficients of the recursion, the derivatives' columns in chunks of `LANES`: in a row the outputs
/// stand before them.
#[derive(Debug, Clone)]
pub struct Recursion {
    n: usize,
    p: usize,
    /// Columns by θ.
    n_theta: usize,
    stride: usize,
    /// Chunks with derivatives.
    n_chunks: usize,
    /// Number of states, taps and the constant.
    n_sources: usize,
    /// Φ then C, (n + p) × n.
    matrix: Vec<f64>,
    /// What drives the state itself, by row and source.
    drive: Vec<f64>,
    /// What drives the derivatives, by chunk, row and source.
    forcing: Vec<[f64; LANES]>,
    /// What acts on the state and, with the state itself, on the outputs, by row.
    plain: Vec<Acting<1>>,
    /// By row of C: entries that are not zero.
    seen: Vec<Vec<(usize, f64)>>,
    /// What acts on the derivatives, by chunk and row.
    acting: Vec<Acting<LANES>>,
    /// Measured input and samples ahead of each tap; None for a constant 1.
    taps: Vec<(Option<usize>, isize)>,
}

impl Recursion {
    /// Of a model at one θ and one sample time; `columns` are the inputs behind those of B.
    pub fn new(
        n_outputs: usize,
        columns: &[Option<usize>],
        continuous: &LinearPoint,
        discrete: &Sampled,
        slopes: &[Sampled],
        wanted: &Wanted<'_>,
    ) -> Self {
        let n = discrete.transition.len().isqrt();
        let p = n_outputs;
        let n_theta = if wanted.theta { slopes.len() } else { 0 };
        let stride = wanted.stride(n_theta);
        let used: Vec<usize> = (0..discrete.taps.len())
            .filter(|&t| {
                let acts = |each: &Sampled| {
                    let tap = &each.taps[t];
                    tap.state.iter().chain(&tap.output).any(|&weight| weight != 0.0)
                };
                acts(discrete) || slopes[..n_theta].iter().any(acts)
            })
            .collect();
        let taps: Vec<_> = used
            .iter()
            .map(|&t| (columns[discrete.taps[t].input], discrete.taps[t].ahead))
            .collect();
        // The last source is the constant that drives the shifts' columns.
        let n_sources = n + taps.len() + 1;
        let rows = n + p;
        let n_chunks = (wanted.columns(n_theta) - 1).div_ceil(LANES);
        let mut layout = Self {
            n,
            p,
            n_theta,
            stride,
            n_chunks,
            n_sources,
            matrix: [discrete.transition.as_slice(), &continuous.c].concat(),
            drive: vec![0.0; rows * n_sources],
            forcing: vec![[0.0; LANES]; n_chunks * rows * n_sources],
            plain: Vec::new(),
            seen: Vec::new(),
            acting: Vec::new(),
            taps,
        };
        for (place, &t) in used.iter().enumerate() {
            let tap = &discrete.taps[t];
            for (row, &weight) in tap.state.iter().chain(&tap.output).enumerate() {
                layout.drive[row * n_sources + n + place] += weight;
            }
            for (j, slope) in slopes[..n_theta].iter().enumerate() {
                layout.add_tap(slope, t, n + place, j);
            }
            if let (Some(input), _) = layout.taps[place] {
                for (s, _) in wanted.shift.iter().enumerate().filter(|&(_, &each)| each == input) {
                    let column = n_theta + wanted.initial.len() + s;
                    layout.add_tap(discrete, t, n_sources - 1, column);
                }
            }
        }
        for (j, slope) in slopes[..n_theta].iter().enumerate() {
            let rates = slope.transition.chunks_exact(n.max(1));
            let outputs = continuous.slopes[j].c.chunks_exact(n.max(1));
            for (row, weights) in rates.chain(outputs).enumerate() {
                for (source, &weight) in weights.iter().enumerate() {
                    layout.add(row, source, j, weight);
                }
            }
        }
        layout.keep_what_acts();
        layout
    }

    /// Most weights of a model are zero: the recursion passes over the others alone.
    fn keep_what_acts(&mut self) {
        let (n, rows) = (self.n, self.n + self.p);
        let line = |row: usize| &self.matrix[row * n..(row + 1) * n];
        let entries = |row: usize| line(row).iter().copied().enumerate();
        self.seen =
            (n..rows).map(|row| entries(row).filter(|&(_, each)| each != 0.0).collect()).collect();
        let plain = self.drive.chunks_exact(self.n_sources).enumerate().map(|(row, weights)| {
            let states = entries(row).filter(|_| row >= n).map(|(at, each)| (at, [each]));
            let sources = weights.iter().enumerate().map(|(at, &each)| (at, [each]));
            Acting::of(states.chain(sources))
        });
        self.plain = plain.collect();
        let each = self.forcing.chunks_exact(self.n_sources);
        self.acting = each.map(|weights| Acting::of(weights.iter().copied().enumerate())).collect();
    }

    fn add_tap(&mut self, discrete: &Sampled, tap: usize, source: usize, column: usize) {
        let each = &discrete.taps[tap];
        for (row, &weight) in each.state.iter().chain(&each.output).enumerate() {
            self.add(row, source, column, weight);
        }
    }

    fn add(&mut self, row: usize, source: usize, column: usize, weight: f64) {
        let (chunk, lane) = (column / LANES, column % LANES);
        let rows = self.n + self.p;
        self.forcing[(chunk * rows + row) * self.n_sources + source][lane] += weight;
    }

    /// Length of all rows of one sample.
    pub fn row_length(&self) -> usize {
        self.p * self.stride
    }

    /// Measured input and samples ahead of each tap; None for a constant 1.
    pub fn taps(&self) -> &[(Option<usize>, isize)] {
        &self.taps
    }

    /// A workspace with S at the first sample.
    pub fn workspace(&self, initial: &[f64], wanted: &Wanted<'_>) -> Workspace {
        let mut slopes = vec![[0.0; LANES]; self.n_chunks * self.n];
        for (offset, &l) in wanted.initial.iter().enumerate() {
            let column = self.n_theta + offset;
            slopes[column / LANES * self.n + l][column % LANES] = 1.0;
        }
        Workspace {
            n_states: self.n,
            sources: vec![[[1.0]; BLOCK]; self.n_sources],
            output: [[0.0]; BLOCK],
            state: initial.iter().map(|&value| [value]).collect(),
            moved: vec![[[0.0; LANES]; BLOCK]; slopes.len()],
            slopes,
            moved_output: [[0.0; LANES]; BLOCK],
        }
    }

    /// Carry state and derivatives through a block and write its rows, as many as fit.
    pub fn advance(&self, workspace: &mut Workspace, rows: &mut [f64]) {
        widest(
            #[inline(always)]
            || {
                self.advance_state(workspace);
                for chunk in 0..self.n_chunks {
                    self.drive(chunk, workspace);
                }
                let transition = &self.matrix[..self.n * self.n];
                carry(transition, &mut workspace.slopes, &mut workspace.moved);
                for chunk in 0..self.n_chunks {
                    self.write_slopes(chunk, workspace, rows);
                }
                self.write_outputs(workspace, rows);
            },
        );
    }

    /// The state itself, into the sources.
    #[inline(always)]
    fn advance_state(&self, workspace: &mut Workspace) {
        let (states, others) = workspace.sources.split_at_mut(self.n);
        for (line, acting) in states.iter_mut().zip(&self.plain) {
            *line = [[0.0]; BLOCK];
            acting.drive(line, others, self.n);
        }
        carry(&self.matrix[..self.n * self.n], &mut workspace.state, states);
    }

    /// What drives the derivatives of the states.
    #[inline(always)]
    fn drive(&self, chunk: usize, workspace: &mut Workspace) {
        let acting = &self.acting[chunk * (self.n + self.p)..];
        let lines = &mut workspace.moved[chunk * self.n..(chunk + 1) * self.n];
        for (line, acting) in lines.iter_mut().zip(acting) {
            *line = [[0.0; LANES]; BLOCK];
            acting.drive(line, &workspace.sources, 0);
        }
    }

    /// Outputs' derivatives from those of the state.
    #[inline(always)]
    fn write_slopes(&self, chunk: usize, workspace: &mut Workspace, rows: &mut [f64]) {
        let Workspace { sources, moved, moved_output, .. } = workspace;
        let lines = &moved[chunk * self.n..(chunk + 1) * self.n];
        let acting = &self.acting[chunk * (self.n + self.p) + self.n..];
        for (o, (seen, acting)) in self.seen.iter().zip(acting).enumerate() {
            let at = o * self.stride + 1 + chunk * LANES;
            let place = |line: &Columns, factor: f64, rows: &mut [f64]| {
                let places = rows.chunks_exact_mut(self.row_length());
                for (row, values) in places.zip(line) {
                    let values = values.map(|value| factor * value);
                    let into = &mut row[at..];
                    // Zeros of the last chunk may reach the next output's place, which is written
                    // later, or beyond the row.
                    match into.first_chunk_mut::<LANES>() {
                        Some(into) => *into = values,
                        None => into.copy_from_slice(&values[..into.len()]),
                    }
                }
            };
            match seen[..] {
                [(column, factor)] if acting.is_empty() => place(&lines[column], factor, rows),
                _ => {
                    *moved_output = [[0.0; LANES]; BLOCK];
                    acting.drive(moved_output, sources, 0);
                    for &(column, factor) in seen {
                        for (into, values) in moved_output.iter_mut().zip(&lines[column]) {
                            into.iter_mut()
                                .zip(values)
                                .for_each(|(sum, value)| *sum += factor * value);
                        }
                    }
                    place(moved_output, 1.0, rows);
                }
            }
        }
    }

    /// The outputs themselves, into the first column.
    #[inline(always)]
    fn write_outputs(&self, workspace: &mut Workspace, rows: &mut [f64]) {
        for (o, acting) in self.plain[self.n..].iter().enumerate() {
            workspace.output = [[0.0]; BLOCK];
            acting.drive(&mut workspace.output, &workspace.sources, 0);
            let places = rows.chunks_exact_mut(self.row_length());
            for (row, value) in places.zip(workspace.output.as_flattened()) {
                let row = &mut row[o * self.stride..(o + 1) * self.stride];
                if self.n_chunks == 0 {
                    row.fill(0.0);
                }
                row[0] = *value;
            }
        }
    }
}
