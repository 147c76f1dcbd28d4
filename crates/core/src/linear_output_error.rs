//! Linear models on records: exact hold discretisation, sensitivities by one recursion in blocks.
//! (Python side: identification/output_error.py)
//!
//! The state and its derivatives by θ, initial state and input shifts are columns of one matrix S:
//! S⁺ = Φ S + Σ_q K_q · source_q, where the sources are the states themselves (for ∂Φ/∂θ x) and the
//! samples of the inputs. A few columns at a time stay in registers while a block of samples passes.

use crate::discretisation::{Hold, Sampled, StateSpace, discretise};
use crate::error::CoreError;
use crate::linear_simulation::sample;
use crate::output_error::{LANES, Trajectories, Wanted};

const BLOCK: usize = 64;
type Lanes = [f64; LANES];

/// A linear system with derivatives by the free parameters, row-major.
#[derive(Debug, Clone, Default)]
pub struct LinearPoint {
    /// n × n.
    pub a: Vec<f64>,
    /// n × m.
    pub b: Vec<f64>,
    /// p × n.
    pub c: Vec<f64>,
    /// p × m.
    pub d: Vec<f64>,
    /// m delays, s.
    pub delays_s: Vec<f64>,
    /// By each free parameter, in the same shapes.
    pub slopes: Vec<LinearPoint>,
}

impl LinearPoint {
    fn view(&self, n_outputs: usize) -> StateSpace<'_> {
        let Self { a, b, c, d, delays_s, .. } = self;
        StateSpace { a, b, c, d, delays_s, n_outputs }
    }
}

/// Linear systems that depend on free parameters.
pub trait LinearFamily: Sync {
    /// Number of states.
    fn n_states(&self) -> usize;
    /// Number of outputs.
    fn n_outputs(&self) -> usize;
    /// Number of measured inputs.
    fn n_inputs(&self) -> usize;
    /// Number of free parameters.
    fn n_parameters(&self) -> usize;
    /// Measured input behind each column of B; None for a constant 1.
    fn columns(&self) -> &[Option<usize>];
    /// The system at θ.
    ///
    /// # Errors
    /// Where it has no value there.
    fn at(&self, theta: &[f64], with_slopes: bool) -> Result<LinearPoint, CoreError>;
}

/// Inputs of one record (n_inputs × n_samples, time last) on its time base.
#[derive(Debug, Clone)]
pub struct Driven {
    /// Measured inputs.
    pub inputs: Vec<f64>,
    /// Number of samples.
    pub n_samples: usize,
    /// Sample time, s.
    pub sample_s: f64,
}

/// A linear family on records.
#[derive(Debug, Clone)]
pub struct LinearTrajectories<F> {
    family: F,
    records: Vec<Driven>,
    lengths: Vec<usize>,
    hold: Hold,
}

/// The systems of one θ, one for each distinct sample time.
#[derive(Debug, Clone)]
pub struct Systems {
    continuous: LinearPoint,
    by_sample_time: Vec<(f64, Sampled, Vec<Sampled>)>,
}

impl<F: LinearFamily> LinearTrajectories<F> {
    /// Put a family on records.
    ///
    /// # Errors
    /// `Shape` for inputs that do not fit, `NotFinite` for values that are not finite.
    pub fn new(family: F, records: Vec<Driven>, hold: Hold) -> Result<Self, CoreError> {
        for each in &records {
            let (found, needed) = (each.inputs.len(), each.n_samples * family.n_inputs());
            if found != needed || each.n_samples == 0 {
                return Err(CoreError::Shape { what: "inputs of a record", found, needed });
            }
            if let Some(index) = each.inputs.iter().position(|value| !value.is_finite()) {
                return Err(CoreError::NotFinite { what: "the measured inputs", index });
            }
        }
        let lengths = records.iter().map(|each| each.n_samples).collect();
        Ok(Self { family, records, lengths, hold })
    }

    /// The family.
    pub fn family(&self) -> &F {
        &self.family
    }
}

impl<F: LinearFamily> Trajectories for LinearTrajectories<F> {
    type Shared = Systems;

    fn n_outputs(&self) -> usize {
        self.family.n_outputs()
    }

    fn n_parameters(&self) -> usize {
        self.family.n_parameters()
    }

    fn n_shifts(&self) -> usize {
        self.family.n_inputs()
    }

    fn record_lengths(&self) -> &[usize] {
        &self.lengths
    }

    fn n_initial(&self, _record: usize) -> usize {
        self.family.n_states()
    }

    fn is_affine(&self) -> bool {
        true
    }

    fn share(&self, theta: &[f64], with_slopes: bool) -> Result<Systems, CoreError> {
        let continuous = self.family.at(theta, with_slopes)?;
        let p = self.family.n_outputs();
        let slopes: Vec<_> = continuous.slopes.iter().map(|slope| slope.view(p)).collect();
        let mut by_sample_time: Vec<(f64, Sampled, Vec<Sampled>)> = Vec::new();
        for record in &self.records {
            if !by_sample_time.iter().any(|(time, ..)| *time == record.sample_s) {
                let (value, slopes) =
                    discretise(&continuous.view(p), &slopes, record.sample_s, self.hold)?;
                by_sample_time.push((record.sample_s, value, slopes));
            }
        }
        Ok(Systems { continuous, by_sample_time })
    }

    fn run(
        &self,
        shared: &Systems,
        record: usize,
        initial: &[f64],
        shift: &[f64],
        wanted: &Wanted<'_>,
        scratch: &mut Vec<f64>,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let driven = &self.records[record];
        let found = shared.by_sample_time.iter().find(|(time, ..)| *time == driven.sample_s);
        let Some((_, discrete, slopes)) = found else {
            return Err(CoreError::Shape { what: "sample times", found: 0, needed: 1 });
        };
        let layout = Layout::new(&self.family, &shared.continuous, discrete, slopes, wanted);
        let mut state = layout.start(initial, wanted);
        let mut sources = vec![0.0; BLOCK * layout.n_sources];
        let rows_of_block = BLOCK * layout.p * layout.stride;
        scratch.clear();
        scratch.resize(rows_of_block, 0.0);
        for first in (0..driven.n_samples).step_by(BLOCK) {
            let count = BLOCK.min(driven.n_samples - first);
            layout.gather(driven, shift, first, count, &mut sources);
            let rows = &mut scratch[..count * layout.p * layout.stride];
            for chunk in 0..layout.stride / LANES {
                layout.advance(chunk, count, &mut state, &mut sources, rows);
            }
            sink(first, rows);
        }
        Ok(())
    }
}

/// Coefficients of the recursion, the columns in chunks of `LANES`.
struct Layout {
    n: usize,
    p: usize,
    /// Columns by θ.
    n_theta: usize,
    stride: usize,
    n_sources: usize,
    /// Φ then C, (n + p) × n.
    matrix: Vec<f64>,
    /// By chunk, row and source.
    forcing: Vec<Lanes>,
    /// By row: columns of `matrix` that are not zero.
    coupled: Vec<Vec<(usize, f64)>>,
    /// By chunk and row: sources that act, with their weights.
    acting: Vec<Vec<(usize, Lanes)>>,
    /// Measured input and samples ahead of each tap; None for a constant 1.
    taps: Vec<(Option<usize>, isize)>,
}

impl Layout {
    fn new<F: LinearFamily>(
        family: &F,
        continuous: &LinearPoint,
        discrete: &Sampled,
        slopes: &[Sampled],
        wanted: &Wanted<'_>,
    ) -> Self {
        let (n, p) = (family.n_states(), family.n_outputs());
        let n_theta = if wanted.theta { slopes.len() } else { 0 };
        let stride = wanted.stride(n_theta);
        let columns = family.columns();
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
        let mut layout = Self {
            n,
            p,
            n_theta,
            stride,
            n_sources,
            matrix: [discrete.transition.as_slice(), &continuous.c].concat(),
            forcing: vec![[0.0; LANES]; stride / LANES * rows * n_sources],
            coupled: Vec::new(),
            acting: Vec::new(),
            taps,
        };
        for (place, &t) in used.iter().enumerate() {
            layout.add_tap(discrete, t, n + place, 0);
            for (j, slope) in slopes[..n_theta].iter().enumerate() {
                layout.add_tap(slope, t, n + place, 1 + j);
            }
            if let (Some(input), _) = layout.taps[place] {
                for (s, _) in wanted.shift.iter().enumerate().filter(|&(_, &each)| each == input) {
                    let column = 1 + n_theta + wanted.initial.len() + s;
                    layout.add_tap(discrete, t, n_sources - 1, column);
                }
            }
        }
        for (j, slope) in slopes[..n_theta].iter().enumerate() {
            let rates = slope.transition.chunks_exact(n.max(1));
            let outputs = continuous.slopes[j].c.chunks_exact(n.max(1));
            for (row, weights) in rates.chain(outputs).enumerate() {
                for (source, &weight) in weights.iter().enumerate() {
                    layout.add(row, source, 1 + j, weight);
                }
            }
        }
        layout.keep_what_acts();
        layout
    }

    /// Most weights of a model are zero: the recursion passes over the others alone.
    fn keep_what_acts(&mut self) {
        let lines = self.matrix.chunks_exact(self.n.max(1)).take(self.n + self.p);
        self.coupled = lines
            .map(|row| row.iter().copied().enumerate().filter(|&(_, each)| each != 0.0).collect())
            .collect();
        self.coupled.resize(self.n + self.p, Vec::new());
        self.acting = self
            .forcing
            .chunks_exact(self.n_sources)
            .map(|row| {
                let all = row.iter().copied().enumerate();
                all.filter(|(_, weights)| weights.iter().any(|&each| each != 0.0)).collect()
            })
            .collect();
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

    /// S at the first sample, chunk by chunk.
    fn start(&self, initial: &[f64], wanted: &Wanted<'_>) -> Vec<Lanes> {
        let mut state = vec![[0.0; LANES]; self.stride / LANES * self.n];
        for (l, &value) in initial.iter().enumerate() {
            state[l][0] = value;
        }
        for (offset, &l) in wanted.initial.iter().enumerate() {
            let column = 1 + self.n_theta + offset;
            state[column / LANES * self.n + l][column % LANES] = 1.0;
        }
        state
    }

    /// Samples of the inputs behind each tap for a block.
    fn gather(
        &self,
        driven: &Driven,
        shift: &[f64],
        first: usize,
        count: usize,
        sources: &mut [f64],
    ) {
        let length = driven.n_samples;
        for (k, line) in sources.chunks_exact_mut(self.n_sources).take(count).enumerate() {
            for (source, &(input, ahead)) in line[self.n..].iter_mut().zip(&self.taps) {
                *source = match input {
                    Some(j) => {
                        let values = &driven.inputs[j * length..(j + 1) * length];
                        sample(values, first + k, ahead) + shift[j]
                    }
                    None => 1.0,
                };
            }
            line[self.n_sources - 1] = 1.0;
        }
    }

    /// Carry one chunk of columns through a block and write its rows. The first chunk holds the
    /// state itself and leaves it in the sources for the others.
    fn advance(
        &self,
        chunk: usize,
        count: usize,
        state: &mut [Lanes],
        sources: &mut [f64],
        rows: &mut [f64],
    ) {
        let (n, p) = (self.n, self.p);
        let state = &mut state[chunk * n..(chunk + 1) * n];
        let all = n + p;
        let acting = &self.acting[chunk * all..(chunk + 1) * all];
        let mut next = vec![[0.0; LANES]; n];
        let lines =
            sources.chunks_exact_mut(self.n_sources).zip(rows.chunks_exact_mut(p * self.stride));
        for (line, out) in lines.take(count) {
            if chunk == 0 {
                line.iter_mut().zip(state.iter()).for_each(|(source, column)| *source = column[0]);
            }
            for (row, (coupled, acting)) in self.coupled.iter().zip(acting).enumerate() {
                let mut sum = [0.0; LANES];
                for &(column, factor) in coupled {
                    add(&mut sum, factor, &state[column]);
                }
                for &(source, ref weights) in acting {
                    add(&mut sum, line[source], weights);
                }
                if row < n {
                    next[row] = sum;
                } else {
                    let place = (row - n) * self.stride + chunk * LANES;
                    out[place..place + LANES].copy_from_slice(&sum);
                }
            }
            state.copy_from_slice(&next);
        }
    }
}

fn add(sum: &mut Lanes, factor: f64, values: &Lanes) {
    for (entry, value) in sum.iter_mut().zip(values) {
        *entry += factor * value;
    }
}
