//! Linear models on records: exact hold discretisation, sensitivities by one recursion in blocks.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::linear::block_recursion::BLOCK;
use crate::linear::discretisation::{Hold, Sampled, StateSpace, discretise};
use crate::linear::linear_simulation::sample;
use crate::records::output_error::{Trajectories, Wanted};
use crate::records::sensitivity_recursion::{Recursion, Room};

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
        let (p, columns) = (self.family.n_outputs(), self.family.columns());
        let recursion = Recursion::new(p, columns, &shared.continuous, discrete, slopes, wanted);
        let mut room = recursion.room(initial, wanted);
        let row_length = recursion.row_length();
        scratch.clear();
        scratch.resize(BLOCK * row_length, 0.0);
        for first in (0..driven.n_samples).step_by(BLOCK) {
            let count = BLOCK.min(driven.n_samples - first);
            let rows = &mut scratch[..count * row_length];
            driven.gather(recursion.taps(), shift, first, count, &mut room);
            recursion.advance(&mut room, rows);
            sink(first, rows);
        }
        Ok(())
    }
}

impl Driven {
    /// Samples of the inputs behind each tap for a block.
    fn gather(
        &self,
        taps: &[(Option<usize>, isize)],
        shift: &[f64],
        first: usize,
        count: usize,
        room: &mut Room,
    ) {
        for (line, &(input, ahead)) in room.taps().zip(taps) {
            let Some(j) = input else { continue };
            let values = &self.inputs[j * self.n_samples..(j + 1) * self.n_samples];
            let inside = first.checked_add_signed(ahead);
            match inside.and_then(|start| values.get(start..start + count)) {
                Some(values) => line.iter_mut().zip(values).for_each(|(u, v)| *u = v + shift[j]),
                None => line[..count].iter_mut().enumerate().for_each(|(k, u)| {
                    *u = sample(values, first + k, ahead) + shift[j];
                }),
            }
        }
    }
}
