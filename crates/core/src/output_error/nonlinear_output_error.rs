//! Equations of motion on many records, for output error. (Python side:
//! identification/output_error/equation_records.py)

use std::sync::{Mutex, PoisonError};

use crate::error::CoreError;
use crate::linear::discretisation::Hold;
use crate::output_error::model_on_records::{Trajectories, Wanted};
use crate::output_error::record_data::RecordInputs;
use crate::state_space::ode_model::OdeModel;
use crate::trajectories::runge_kutta::{Course, expect};
use crate::trajectories::shooting::{Flight, Plan, Wish};

/// How one record is run.
#[derive(Debug, Clone)]
pub struct Passage {
    /// Its inputs.
    pub driven: RecordInputs,
    /// Runge–Kutta steps in a sample interval.
    pub substeps: usize,
    /// A single run, or segments.
    pub plan: Plan,
}

/// A model by its equations on records, some of its parameters free.
pub struct EquationTrajectories {
    ode: OdeModel,
    values: Vec<f64>,
    free: Vec<usize>,
    hold: Hold,
    passages: Vec<Passage>,
    lengths: Vec<usize>,
    /// Buffers that wait for the next run of each record.
    flights: Vec<Mutex<Vec<Flight>>>,
}

impl EquationTrajectories {
    /// Take the values of all parameters and the indices of the free ones.
    ///
    /// # Errors
    /// `Shape` for what does not fit.
    pub fn new(
        ode: OdeModel,
        values: &[f64],
        free: &[usize],
        hold: Hold,
        passages: Vec<Passage>,
    ) -> Result<Self, CoreError> {
        expect("parameter values", values.len(), ode.n_parameters())?;
        if let Some(&found) = free.iter().find(|&&index| index >= values.len()) {
            let needed = values.len();
            return Err(CoreError::Shape { what: "index of a free parameter", found, needed });
        }
        for passage in &passages {
            let needed = ode.n_inputs() * passage.driven.n_samples;
            expect("inputs of a record", passage.driven.inputs.len(), needed)?;
            passage.plan.check(ode.n_states(), passage.driven.n_samples)?;
        }
        Ok(Self {
            values: values.to_vec(),
            free: free.to_vec(),
            hold,
            lengths: passages.iter().map(|passage| passage.driven.n_samples).collect(),
            flights: passages.iter().map(|_| Mutex::default()).collect(),
            passages,
            ode,
        })
    }

    /// State at the first sample of a record, and its derivatives (n_states × columns) by θ and the
    /// wanted initial numbers and shifts.
    ///
    /// # Errors
    /// Where the trajectory has no value.
    pub fn start(
        &self,
        record: usize,
        theta: &[f64],
        initial: &[f64],
        shift: &[f64],
        wanted: &Wanted<'_>,
    ) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
        let shared = self.share(theta, true)?;
        let mut flight = Flight::default();
        let stride = wanted.stride(self.free.len());
        let mut sink = |_: usize, _: &mut [f64]| {};
        self.fly(&mut flight, record, &shared, (initial, shift), wanted, stride, &mut sink)?;
        let (state, slopes) = flight.start(&self.ode);
        Ok((state.to_vec(), slopes.to_vec()))
    }

    #[allow(clippy::too_many_arguments)]
    fn fly(
        &self,
        flight: &mut Flight,
        record: usize,
        parameters: &[f64],
        (initial, shift): (&[f64], &[f64]),
        wanted: &Wanted<'_>,
        stride: usize,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let Passage { driven, substeps, plan } = &self.passages[record];
        let course = Course {
            inputs: &driven.inputs,
            n_samples: driven.n_samples,
            sample_s: driven.sample_s,
            hold: self.hold,
            substeps: *substeps,
        };
        let wish = Wish {
            parameters,
            initial,
            shift,
            free: if wanted.theta { &self.free } else { &[] },
            free_initial: wanted.initial,
            free_shift: wanted.shift,
        };
        flight.run(&self.ode, &course, plan, &wish, stride, sink)
    }
}

impl Trajectories for EquationTrajectories {
    /// Values of all parameters.
    type Shared = Vec<f64>;

    fn n_outputs(&self) -> usize {
        self.ode.n_outputs()
    }

    fn n_parameters(&self) -> usize {
        self.free.len()
    }

    fn n_shifts(&self) -> usize {
        self.ode.n_inputs()
    }

    fn record_lengths(&self) -> &[usize] {
        &self.lengths
    }

    fn n_initial(&self, _record: usize) -> usize {
        self.ode.n_states()
    }

    fn is_affine(&self) -> bool {
        self.ode.is_affine()
    }

    fn share(&self, theta: &[f64], _with_slopes: bool) -> Result<Vec<f64>, CoreError> {
        expect("free parameters", theta.len(), self.free.len())?;
        let mut values = self.values.clone();
        for (&place, &value) in self.free.iter().zip(theta) {
            values[place] = value;
        }
        Ok(values)
    }

    fn run(
        &self,
        shared: &Vec<f64>,
        record: usize,
        initial: &[f64],
        shift: &[f64],
        wanted: &Wanted<'_>,
        _scratch: &mut Vec<f64>,
        sink: &mut dyn FnMut(usize, &mut [f64]),
    ) -> Result<(), CoreError> {
        let waiting = &self.flights[record];
        let taken = waiting.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut flight = taken.unwrap_or_default();
        let stride = wanted.stride(self.free.len());
        let found = self.fly(&mut flight, record, shared, (initial, shift), wanted, stride, sink);
        waiting.lock().unwrap_or_else(PoisonError::into_inner).push(flight);
        found
    }
}
