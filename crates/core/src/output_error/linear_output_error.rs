//! Linear models on records: exact hold discretisation, sensitivities by one recursion in blocks.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::linear::block_recursion::BLOCK;
use crate::linear::discretisation::{Hold, Sampled, Tap, discretise};
use crate::linear::linear_simulation::sample;
use crate::output_error::linear_family::{LinearFamily, LinearPoint};
use crate::output_error::linear_sensitivities::{Recursion, Workspace};
use crate::output_error::model_on_records::{Directed, Trajectories, Wanted};
use crate::output_error::record_data::RecordInputs;

/// A linear family on records.
#[derive(Debug, Clone)]
pub struct LinearTrajectories<F> {
    family: F,
    records: Vec<RecordInputs>,
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
    pub fn new(family: F, records: Vec<RecordInputs>, hold: Hold) -> Result<Self, CoreError> {
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
        let mut workspace = recursion.workspace(initial, wanted);
        let row_length = recursion.row_length();
        scratch.clear();
        scratch.resize(BLOCK * row_length, 0.0);
        for first in (0..driven.n_samples).step_by(BLOCK) {
            let count = BLOCK.min(driven.n_samples - first);
            let rows = &mut scratch[..count * row_length];
            gather(driven, recursion.taps(), shift, first, count, &mut workspace);
            recursion.advance(&mut workspace, rows);
            sink(first, rows);
        }
        Ok(())
    }
}

impl<F: LinearFamily> Directed for LinearTrajectories<F> {
    fn along(&self, shared: &Systems, step: &[f64]) -> Systems {
        let Systems { continuous, by_sample_time } = shared;
        let outputs = continuous.slopes.iter().map(|slope| slope.c.as_slice());
        let slope = LinearPoint { c: summed(outputs, step), ..LinearPoint::default() };
        let sampled = by_sample_time.iter().map(|(time, value, slopes)| {
            let transition = summed(slopes.iter().map(|each| each.transition.as_slice()), step);
            let taps = value.taps.iter().enumerate().map(|(t, tap)| Tap {
                state: summed(slopes.iter().map(|each| each.taps[t].state.as_slice()), step),
                output: summed(slopes.iter().map(|each| each.taps[t].output.as_slice()), step),
                ..tap.clone()
            });
            let along = Sampled { transition, taps: taps.collect() };
            (*time, value.clone(), vec![along])
        });
        let by_sample_time = sampled.collect();
        let continuous = LinearPoint { slopes: vec![slope], ..continuous.clone() };
        Systems { continuous, by_sample_time }
    }
}

/// Numbers weighed and added up, place by place.
fn summed<'a>(parts: impl Iterator<Item = &'a [f64]>, weights: &[f64]) -> Vec<f64> {
    let mut found = Vec::new();
    for (part, weight) in parts.zip(weights) {
        found.resize(part.len(), 0.0);
        found.iter_mut().zip(part).for_each(|(sum, value)| *sum += weight * value);
    }
    found
}

/// Samples of the inputs behind each tap for a block.
fn gather(
    driven: &RecordInputs,
    taps: &[(Option<usize>, isize)],
    shift: &[f64],
    first: usize,
    count: usize,
    workspace: &mut Workspace,
) {
    for (line, &(input, ahead)) in workspace.taps().zip(taps) {
        let Some(j) = input else { continue };
        let values = &driven.inputs[j * driven.n_samples..(j + 1) * driven.n_samples];
        let inside = first.checked_add_signed(ahead);
        match inside.and_then(|start| values.get(start..start + count)) {
            Some(values) => line.iter_mut().zip(values).for_each(|(u, v)| *u = v + shift[j]),
            None => line[..count].iter_mut().enumerate().for_each(|(k, u)| {
                *u = sample(values, first + k, ahead) + shift[j];
            }),
        }
    }
}
