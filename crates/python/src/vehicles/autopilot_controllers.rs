//! Binding of the autopilots' controllers and filters (Python side: `control/autopilots/`). Everything
//! runs in the firmware's single precision or, for linear views, in double.

use crate::group::read;
use crate::row_major::{RowMajor1, RowMajor2};
use flightid_core::autopilots::ardupilot_mode::square_root_law;
use flightid_core::autopilots::ardupilot_pid::{Pid, PidGains};
use flightid_core::autopilots::gyro_filter::low_pass;
use flightid_core::autopilots::notch_filter::{
    Section, ardupilot_notch, ardupilot_quality, px4_notch,
};
use flightid_core::autopilots::px4_rate_control::{RateControl, RateGains, RateInputs, gyro_chain};
use num_traits::{Float, FloatConst};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Gains of AC_PID from a group.
///
/// # Errors
/// `ValueError` where the group lacks one.
pub fn pid_gains<'py, F>(m: &Bound<'py, PyDict>) -> PyResult<PidGains<F>>
where
    for<'a> F: FromPyObject<'a, 'py, Error = PyErr>,
{
    Ok(read!(
        m,
        PidGains {
            p,
            i,
            d,
            ff,
            d_ff,
            imax,
            pdmx,
            fltt,
            flte,
            fltd,
            smax,
            target_notch,
            error_notch,
        }
    ))
}

fn narrow<F: Float>(value: f64) -> F {
    F::from(value).unwrap_or_else(F::nan)
}

fn narrowed<F: Float>(values: &[f64]) -> Vec<F> {
    values.iter().map(|&value| narrow(value)).collect()
}

fn widened<F: Float>(values: impl IntoIterator<Item = F>) -> Vec<f64> {
    values.into_iter().map(|value| value.to_f64().unwrap_or(f64::NAN)).collect()
}

fn rows<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let array = Array2::from_shape_vec((values.len() / width, width), values)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

struct PidRun<'a> {
    loop_time_s: f64,
    target: &'a [f64],
    measured: &'a [f64],
    limited: &'a [bool],
    leak: Option<[f64; 2]>,
    slew_scale: f64,
    start: Option<[f64; 4]>,
}

impl PidRun<'_> {
    fn rows<F: Float + FloatConst>(&self, gains: PidGains<F>) -> Vec<f64> {
        let mut pid =
            Pid::new(gains, narrow(self.loop_time_s)).with_slew_scale(narrow(self.slew_scale));
        if let Some([share, floor]) = self.leak {
            pid = pid.with_leak(narrow(share), narrow(floor));
        }
        if let Some(start) = self.start {
            pid = pid.resumed(start.map(narrow));
        }
        let inputs = self.target.iter().zip(self.measured).zip(self.limited);
        inputs
            .flat_map(|((&target, &measured), &limited)| {
                let t = pid.update(narrow(target), narrow(measured), limited);
                widened([t.target, t.error, t.p, t.i, t.d, t.ff, t.d_ff, t.dmod, t.slew_rate])
            })
            .collect()
    }
}

/// ardupilot_pid(gains: dict[str, Any], loop_time_s: float, target: NDArray[np.float64], measured: NDArray[np.float64], limited: NDArray[np.bool_], leak: tuple[float, float] | None, slew_scale: float, start: tuple[float, float, float, float] | None, single_precision: bool) -> NDArray[np.float64]
///
/// Terms of ArduPilot's rate PID, (n, 9): filtered target, filtered error, P, I, D, FF, D_FF, factor
/// and rate of the slew limiter. `start`: filtered target, error, derivative and integrator of the loop
/// before; at rest where left out.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn ardupilot_pid<'py>(
    py: Python<'py>,
    gains: &Bound<'py, PyDict>,
    loop_time_s: f64,
    target: RowMajor1<'py, f64>,
    measured: RowMajor1<'py, f64>,
    limited: RowMajor1<'py, bool>,
    leak: Option<[f64; 2]>,
    slew_scale: f64,
    start: Option<[f64; 4]>,
    single_precision: bool,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (target, measured) = (target.as_slice()?, measured.as_slice()?);
    let limited = limited.as_slice()?;
    let run = PidRun { loop_time_s, target, measured, limited, leak, slew_scale, start };
    let values = if single_precision {
        let gains = pid_gains::<f32>(gains)?;
        py.detach(|| run.rows(gains))
    } else {
        let gains = pid_gains::<f64>(gains)?;
        py.detach(|| run.rows(gains))
    };
    rows(py, values, 9)
}

fn rate_gains<'py, F>(m: &Bound<'py, PyDict>) -> PyResult<RateGains<F>>
where
    for<'a> F: FromPyObject<'a, 'py, Error = PyErr>,
{
    Ok(read!(m, RateGains { p, i, d, ff, int_limit, output_cutoff_hz, old }))
}

fn px4_rows<F: Float + FloatConst>(
    gains: RateGains<F>,
    loop_time_s: f64,
    signals: [&[f64]; 4],
    flags: &[bool],
    start: Option<[f64; 2]>,
) -> Vec<f64> {
    let mut control = RateControl::new(gains, narrow(loop_time_s));
    if let Some(start) = start {
        control = control.resumed(start.map(narrow));
    }
    let [setpoint, rate, acceleration, thrust] = signals;
    flags
        .chunks_exact(3)
        .enumerate()
        .flat_map(|(k, flags)| {
            let t = control.update(RateInputs {
                setpoint: narrow(setpoint[k]),
                rate: narrow(rate[k]),
                acceleration: narrow(acceleration[k]),
                thrust: narrow(thrust[k]),
                saturated: [flags[0], flags[1]],
                landed: flags[2],
            });
            widened([t.p, t.i, t.d, t.ff, t.output])
        })
        .collect()
}

/// px4_rate_control(gains: dict[str, Any], loop_time_s: float, signals: NDArray[np.float64], flags: NDArray[np.bool_], start: tuple[float, float] | None, single_precision: bool) -> NDArray[np.float64]
///
/// Terms of PX4's rate controller, (n, 5): P, I, D, FF, output. Signals are (4, n): set-point, rate,
/// acceleration, thrust; flags (n, 3): saturated upwards, downwards, landed. `start`: integral and rate of
/// the loop before.
#[pyfunction]
fn px4_rate_control<'py>(
    py: Python<'py>,
    gains: &Bound<'py, PyDict>,
    loop_time_s: f64,
    signals: RowMajor2<'py, f64>,
    flags: RowMajor2<'py, bool>,
    start: Option<[f64; 2]>,
    single_precision: bool,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (values, flags) = (signals.as_slice()?, flags.as_slice()?);
    let n = flags.len() / 3;
    if values.len() != 4 * n || flags.len() != 3 * n {
        return Err(PyValueError::new_err("signals are (4, n) and flags (n, 3)"));
    }
    let signals = std::array::from_fn(|row| &values[row * n..(row + 1) * n]);
    let found = if single_precision {
        let gains = rate_gains::<f32>(gains)?;
        py.detach(|| px4_rows(gains, loop_time_s, signals, flags, start))
    } else {
        let gains = rate_gains::<f64>(gains)?;
        py.detach(|| px4_rows(gains, loop_time_s, signals, flags, start))
    };
    rows(py, found, 5)
}

struct GyroRun<'a> {
    raw: &'a [f64],
    sample_rate_hz: f64,
    notches: &'a [Section<f64>],
    cutoffs_hz: [f64; 2],
    decimation: usize,
}

impl GyroRun<'_> {
    fn values<F: Float + FloatConst>(&self) -> (Vec<f64>, Vec<f64>) {
        let notches: Vec<Section<F>> =
            self.notches.iter().map(|section| section.map(narrow)).collect();
        let [cutoff, derivative] = self.cutoffs_hz.map(narrow);
        let (rate, slope) = gyro_chain(
            &narrowed(self.raw),
            narrow(self.sample_rate_hz),
            &notches,
            cutoff,
            derivative,
            self.decimation,
        );
        (widened(rate), widened(slope))
    }
}

type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// gyro_filters(raw: NDArray[np.float64], sample_rate_hz: float, notches: list[tuple[float, float, float, float, float]], cutoff_hz: float, derivative_cutoff_hz: float, decimation: int, single_precision: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// Raw gyro samples to filtered rate and angular acceleration, every `decimation`-th kept.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn gyro_filters<'py>(
    py: Python<'py>,
    raw: RowMajor1<'py, f64>,
    sample_rate_hz: f64,
    notches: Vec<Section<f64>>,
    cutoff_hz: f64,
    derivative_cutoff_hz: f64,
    decimation: usize,
    single_precision: bool,
) -> PyResult<Pair<'py>> {
    let cutoffs_hz = [cutoff_hz, derivative_cutoff_hz];
    let run =
        GyroRun { raw: raw.as_slice()?, sample_rate_hz, notches: &notches, cutoffs_hz, decimation };
    let (rate, slope) =
        py.detach(|| if single_precision { run.values::<f32>() } else { run.values::<f64>() });
    Ok((rate.into_pyarray(py), slope.into_pyarray(py)))
}

/// ardupilot_notch_section(sample_rate_hz: float, center_hz: float, quality: float, attenuation_db: float) -> tuple[float, float, float, float, float] | None
///
/// b0, b1, b2, a1, a2 of ArduPilot's notch; None where the firmware leaves it off.
#[pyfunction]
fn ardupilot_notch_section(
    sample_rate_hz: f64,
    center_hz: f64,
    quality: f64,
    attenuation_db: f64,
) -> Option<(f64, f64, f64, f64, f64)> {
    ardupilot_notch(sample_rate_hz, center_hz, quality, attenuation_db).map(Into::into)
}

/// ardupilot_notch_quality(center_hz: float, bandwidth_hz: float) -> float
///
/// Quality of ArduPilot's notch from its bandwidth; 0 where the firmware leaves it off.
#[pyfunction]
fn ardupilot_notch_quality(center_hz: f64, bandwidth_hz: f64) -> f64 {
    ardupilot_quality(center_hz, bandwidth_hz)
}

/// px4_notch_section(sample_rate_hz: float, center_hz: float, bandwidth_hz: float) -> tuple[float, float, float, float, float] | None
///
/// b0, b1, b2, a1, a2 of PX4's notch; None where the firmware leaves it off.
#[pyfunction]
fn px4_notch_section(
    sample_rate_hz: f64,
    center_hz: f64,
    bandwidth_hz: f64,
) -> Option<(f64, f64, f64, f64, f64)> {
    px4_notch(sample_rate_hz, center_hz, bandwidth_hz).map(Into::into)
}

/// gyro_low_pass_section(sample_rate_hz: float, cutoff_hz: float) -> tuple[float, float, float, float, float] | None
///
/// b0, b1, b2, a1, a2 of the two-pole gyro filter; None for a cut-off of 0.
#[pyfunction]
fn gyro_low_pass_section(sample_rate_hz: f64, cutoff_hz: f64) -> Option<(f64, f64, f64, f64, f64)> {
    low_pass(sample_rate_hz, cutoff_hz).map(Into::into)
}

/// square_root_law(error_rad: NDArray[np.float64], gain_1_s: float, acceleration_rad_s2: float) -> NDArray[np.float64]
///
/// Rate targets (rad/s) of ArduPilot's angle controller.
#[pyfunction]
#[pyo3(name = "square_root_law")]
fn square_root_laws<'py>(
    py: Python<'py>,
    error_rad: RowMajor1<'py, f64>,
    gain_1_s: f64,
    acceleration_rad_s2: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let law = |&error: &f64| square_root_law(error, gain_1_s, acceleration_rad_s2);
    Ok(error_rad.as_slice()?.iter().map(law).collect::<Vec<f64>>().into_pyarray(py))
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(ardupilot_pid, module)?)?;
    module.add_function(wrap_pyfunction!(px4_rate_control, module)?)?;
    module.add_function(wrap_pyfunction!(gyro_filters, module)?)?;
    module.add_function(wrap_pyfunction!(ardupilot_notch_section, module)?)?;
    module.add_function(wrap_pyfunction!(ardupilot_notch_quality, module)?)?;
    module.add_function(wrap_pyfunction!(px4_notch_section, module)?)?;
    module.add_function(wrap_pyfunction!(gyro_low_pass_section, module)?)?;
    module.add_function(wrap_pyfunction!(square_root_laws, module)?)?;
    Ok(())
}
