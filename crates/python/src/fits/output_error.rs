//! Face of `flightid_core::output_error::likelihood` for every kind of model. (Python side:
//! identification/output_error/fit.py)

use flightid_core::CoreError;
use flightid_core::fits::least_squares::{Options, Problem};
use flightid_core::linear::discretisation::Hold;
use flightid_core::output_error::likelihood::{Estimate, fit_from};
use flightid_core::output_error::linear_family::LinearFamily;
use flightid_core::output_error::linear_output_error::LinearTrajectories;
use flightid_core::output_error::model_on_records::{Directed, LANES, Trajectories, Wanted};
use flightid_core::output_error::output_error_weights::Noise;
use flightid_core::output_error::record_data::{RecordData, RecordInputs};
use flightid_core::output_error::slope_sums::Sloped;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::least_squares::{Callback, WrittenResiduals};
use crate::interrupt;
use crate::row_major::{RowMajor1, RowMajor2};

/// Inputs and outputs (channels × samples) and sample time of one record.
pub type Flown<'py> = (RowMajor2<'py, f64>, RowMajor2<'py, f64>, f64);
/// Initial state, input shifts, output biases of one record, which entries of each are free, and the
/// bounds of those, none or one for each.
pub type Own<'py> = (
    RowMajor1<'py, f64>,
    RowMajor1<'py, f64>,
    RowMajor1<'py, f64>,
    Vec<usize>,
    Vec<usize>,
    Vec<usize>,
    Vec<(f64, f64)>,
);
/// Rows are starts; lower and upper bounds; most steps.
pub type SearchArguments<'py> =
    (RowMajor2<'py, f64>, RowMajor1<'py, f64>, RowMajor1<'py, f64>, usize);
/// Full covariance, limit of the loss, share of Gaussian variance within it.
pub type NoiseArguments = (bool, f64, f64);
/// θ, objective, noise covariance, own numbers, which are determined, iterations, termination.
type Ending<'py> = (
    Bound<'py, PyArray1<f64>>,
    f64,
    Bound<'py, PyArray2<f64>>,
    Vec<Bound<'py, PyArray1<f64>>>,
    Vec<Vec<bool>>,
    usize,
    &'static str,
);

/// Inputs of the records, copied out of NumPy.
///
/// # Errors
/// NumPy's own.
pub fn driven(records: &[Flown<'_>]) -> PyResult<Vec<RecordInputs>> {
    records
        .iter()
        .map(|(inputs, outputs, sample_s)| {
            let n_samples = outputs.as_array().ncols();
            Ok(RecordInputs { inputs: inputs.as_slice()?.to_vec(), n_samples, sample_s: *sample_s })
        })
        .collect()
}

/// Hold by its name.
///
/// # Errors
/// Another name.
pub fn hold(name: &str) -> PyResult<Hold> {
    match name {
        "zero" => Ok(Hold::Zero),
        "first" => Ok(Hold::First),
        "band_limited" => Ok(Hold::BandLimited),
        _ => Err(pyo3::exceptions::PyValueError::new_err(format!("no such hold: {name}"))),
    }
}

/// A linear family on records.
///
/// # Errors
/// Where records and family do not fit.
pub fn linear<F: LinearFamily>(
    family: Result<F, CoreError>,
    records: &[Flown<'_>],
    name: &str,
) -> PyResult<LinearTrajectories<F>> {
    let family = family.map_err(from_core)?;
    LinearTrajectories::new(family, driven(records)?, hold(name)?).map_err(from_core)
}

/// Measurements and own numbers of the records.
///
/// # Errors
/// NumPy's own.
pub fn record_data(records: &[Flown<'_>], own: Vec<Own<'_>>) -> PyResult<Vec<RecordData>> {
    records
        .iter()
        .zip(own)
        .map(|((_, outputs, _), own)| {
            let (initial, shift, bias, free_initial, free_shift, free_bias, limits) = own;
            Ok(RecordData {
                measured: by_sample(outputs)?,
                initial: initial.as_slice()?.to_vec(),
                shift: shift.as_slice()?.to_vec(),
                bias: bias.as_slice()?.to_vec(),
                free_initial,
                free_shift,
                free_bias,
                limits,
            })
        })
        .collect()
}

/// A linear family on one record, what was measured there, and where its parameters stand.
pub struct OnRecord<F: LinearFamily> {
    /// The family, driven by the record's inputs.
    pub trajectories: LinearTrajectories<F>,
    /// Measurements and own numbers, of that record alone.
    pub data: Vec<RecordData>,
    /// Free parameters.
    pub theta: Vec<f64>,
}

impl<F: LinearFamily> OnRecord<F> {
    /// Of all values, those that are free.
    ///
    /// # Errors
    /// Where record and family do not fit, and NumPy's own.
    pub fn new(
        family: Result<F, CoreError>,
        (values, free): (&[f64], &[usize]),
        (record, own): (Flown<'_>, Own<'_>),
        hold: &str,
    ) -> PyResult<Self> {
        let records = [record];
        let trajectories = linear(family, &records, hold)?;
        let data = record_data(&records, vec![own])?;
        let theta = free.iter().map(|&place| values[place]).collect();
        Ok(Self { trajectories, data, theta })
    }
}

/// Copy a few numbers, of which calls that move memory would cost more than the numbers.
fn copy_few(from: &[f64], into: &mut [f64]) {
    let (chunks, rest) = from.as_chunks::<LANES>();
    let into = &mut into[..from.len()];
    let (wide, last) = into.as_chunks_mut::<LANES>();
    wide.iter_mut().zip(chunks).for_each(|(into, each)| *into = *each);
    for (place, value) in rest.iter().enumerate() {
        last[place] = *value;
    }
}

/// Channels, sample by sample: reading them in that order would cost what a run costs.
fn by_sample(channels: &RowMajor2<'_, f64>) -> PyResult<Vec<f64>> {
    let (p, n) = channels.as_array().dim();
    let mut found = vec![0.0; p * n];
    for (o, row) in channels.as_slice()?.chunks_exact(n.max(1)).enumerate() {
        let places = found.chunks_exact_mut(p);
        places.zip(row).for_each(|(sample, value)| sample[o] = *value);
    }
    Ok(found)
}

/// Fit from each start, or the words of the error that stopped it; with responses beside the records
/// where there are any, or with residuals written in Python.
///
/// # Errors
/// Where records and model do not belong together, what the residuals raised, or the user interrupts.
pub fn fit<'py, T: Trajectories>(
    py: Python<'py>,
    trajectories: &T,
    data: &[RecordData],
    noise: NoiseArguments,
    beside: Option<&(impl Problem + Clone + Sync)>,
    written: Option<WrittenResiduals<'py>>,
    search: SearchArguments<'py>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let exact = Options {
        maximum_iterations: search.3,
        gradient_tolerance: 1e-8,
        step_tolerance: 1e-10,
        cost_tolerance: 1e-14,
        ..Options::default()
    };
    let Some(written) = written else {
        return fit_beside(py, trajectories, data, noise, beside, search, &exact);
    };
    // Their derivatives are differences: no nearer.
    let options = Options { gradient_tolerance: 1e-5, cost_tolerance: 1e-9, ..exact };
    let problem = Callback::new(written, trajectories.n_parameters());
    let found = fit_beside(py, trajectories, data, noise, Some(&problem), search, &options);
    problem.raised().map_or(found, Err)
}

fn fit_beside<'py, T: Trajectories>(
    py: Python<'py>,
    trajectories: &T,
    data: &[RecordData],
    noise: NoiseArguments,
    beside: Option<&(impl Problem + Clone + Sync)>,
    search: SearchArguments<'py>,
    options: &Options,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let (starts, lower, upper, _) = search;
    let width = trajectories.n_parameters().max(1);
    let starts: Vec<_> = starts.as_slice()?.chunks_exact(width).map(<[f64]>::to_vec).collect();
    let (lower, upper) = (lower.as_slice()?, upper.as_slice()?);
    let (full, limit, consistency) = noise;
    let noise = Noise { full, limit, consistency };
    let work = |stop: interrupt::Stop<'_>| {
        fit_from(trajectories, data, &noise, beside, &starts, (lower, upper), options, stop)
    };
    let found = if starts.len() == 1 && data.len() == 1 {
        interrupt::run_here(py, work)?
    } else {
        interrupt::run_beside(py, work)?
    };
    let p = trajectories.n_outputs();
    found.into_iter().map(|each| outcome(py, each, p)).collect()
}

fn outcome<'py>(
    py: Python<'py>,
    found: Result<Estimate, CoreError>,
    p: usize,
) -> PyResult<Bound<'py, PyAny>> {
    match found {
        Ok(found) => {
            let values: Ending<'py> = (
                found.theta.into_pyarray(py),
                found.objective,
                found.noise.into_pyarray(py).reshape([p, p])?,
                found.own.into_iter().map(|own| own.into_pyarray(py)).collect(),
                found.determined,
                found.iterations,
                found.termination.name(),
            );
            Ok(values.into_pyobject(py)?.into_any())
        }
        // A wrong shape is the caller's fault; anything else belongs to this start alone.
        Err(error @ (CoreError::Shape { .. } | CoreError::Range { .. })) => Err(from_core(error)),
        Err(error) => Ok(error.to_string().into_pyobject(py)?.into_any()),
    }
}

/// Outputs (n_outputs × n_samples) of one record without bias, and their derivatives by θ, free
/// initial states, free shifts and free biases (n_outputs × n_samples × columns).
///
/// # Errors
/// Where the model has no run at θ.
#[allow(clippy::type_complexity)]
pub fn run<'py, T: Trajectories>(
    py: Python<'py>,
    trajectories: &T,
    data: &[RecordData],
    record: usize,
    theta: &[f64],
    with_slopes: bool,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
    let Some(own) = data.get(record) else {
        let error = CoreError::Shape { what: "records", found: data.len(), needed: record + 1 };
        return Err(from_core(error));
    };
    let (p, n) = (trajectories.n_outputs(), trajectories.record_lengths()[record]);
    let none: &[usize] = &[];
    let wanted = Wanted {
        theta: with_slopes,
        initial: if with_slopes { &own.free_initial } else { none },
        shift: if with_slopes { &own.free_shift } else { none },
    };
    let run = wanted.columns(trajectories.n_parameters()) - 1;
    let biases: &[usize] = if with_slopes { &own.free_bias } else { none };
    if let Some(&found) = biases.iter().find(|&&output| output >= p) {
        let error = CoreError::Shape { what: "output of a bias", found, needed: p };
        return Err(from_core(error));
    }
    let columns = run + biases.len();
    let stride = wanted.stride(trajectories.n_parameters());
    let mut outputs = vec![0.0; p * n];
    // NumPy asks for large pages, which long records need thousands of times fewer of.
    let made = PyArray3::<f64>::zeros(py, [p, n, columns], false);
    let mut writable = made.readwrite();
    let slopes = writable.as_slice_mut()?;
    let mut sink = |first: usize, rows: &mut [f64]| {
        for o in 0..p {
            let bias = biases.iter().position(|&output| output == o);
            for (k, sample) in rows.chunks_exact(p * stride).enumerate() {
                let (row, at) = (&sample[o * stride..(o + 1) * stride], o * n + first + k);
                outputs[at] = row[0];
                let into = &mut slopes[at * columns..(at + 1) * columns];
                copy_few(&row[1..1 + run], into);
                if let Some(bias) = bias {
                    into[run + bias] = 1.0;
                }
            }
        }
    };
    trajectories
        .share(theta, with_slopes)
        .and_then(|shared| {
            let (initial, shift) = (&own.initial, &own.shift);
            let scratch = &mut Vec::new();
            trajectories.run(&shared, record, initial, shift, &wanted, scratch, &mut sink)
        })
        .map_err(from_core)?;
    drop(writable);
    Ok((outputs.into_pyarray(py).reshape([p, n])?, made))
}

/// Residuals (n_outputs × n_samples), and by output products of all columns with these last.
pub type Summed<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// Residuals of one record, its run's where none are given, and by output the products of all columns
/// of derivatives (θ, free initial states, shifts, biases) with these last.
///
/// # Errors
/// Where the model has no run at θ, or residuals are of another length.
pub fn slope_products<'py, T: Trajectories>(
    py: Python<'py>,
    trajectories: &T,
    data: &RecordData,
    theta: &[f64],
    given: Option<RowMajor2<'py, f64>>,
) -> PyResult<Summed<'py>> {
    let sloped = Sloped::new(trajectories, 0, data, theta).map_err(from_core)?;
    let given = given.as_ref().map(|each| each.as_slice()).transpose()?;
    let (left, products) = sloped.products(given).map_err(from_core)?;
    let (p, width) = (trajectories.n_outputs(), sloped.n_columns() + 1);
    let left = left.into_pyarray(py);
    let n = trajectories.record_lengths()[0];
    Ok((left.reshape([p, n])?, products.into_pyarray(py).reshape([p, width, width])?))
}

/// What a step of all columns leaves of residuals.
///
/// # Errors
/// As `slope_products`.
pub fn slope_step<'py, T: Directed>(
    py: Python<'py>,
    trajectories: &T,
    data: &RecordData,
    theta: &[f64],
    given: RowMajor2<'py, f64>,
    step: RowMajor1<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let sloped = Sloped::new(trajectories, 0, data, theta).map_err(from_core)?;
    let left = sloped.stepped(given.as_slice()?, step.as_slice()?).map_err(from_core)?;
    left.into_pyarray(py).reshape([trajectories.n_outputs(), trajectories.record_lengths()[0]])
}
