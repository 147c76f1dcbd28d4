//! Binding of `flightid_core::autopilots::ardupilot_chirp` (used by `excitation/sweep.py`).

use flightid_core::CoreError;
use flightid_core::autopilots::ardupilot_chirp::Chirp;
use num_traits::{Float, FloatConst};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::RowMajor1;

type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// ardupilot_chirp(time_s: NDArray[np.float64], magnitude: float, start_hz: float, stop_hz: float, record_s: float, fade_in_s: float, fade_out_s: float, hold_s: float | None, single_precision: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// Waveform and instantaneous frequency (rad/s) at stamps from the start of the chirp.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn ardupilot_chirp<'py>(
    py: Python<'py>,
    time_s: RowMajor1<'py, f64>,
    magnitude: f64,
    start_hz: f64,
    stop_hz: f64,
    record_s: f64,
    fade_in_s: f64,
    fade_out_s: f64,
    hold_s: Option<f64>,
    single_precision: bool,
) -> PyResult<Pair<'py>> {
    let stamps = time_s.as_slice()?;
    let settings = [start_hz, stop_hz, record_s, fade_in_s, fade_out_s];
    let (values, frequencies) = py
        .detach(|| {
            if single_precision {
                waveform::<f32>(stamps, magnitude, settings, hold_s)
            } else {
                waveform::<f64>(stamps, magnitude, settings, hold_s)
            }
        })
        .map_err(from_core)?;
    Ok((values.into_pyarray(py), frequencies.into_pyarray(py)))
}

fn waveform<F: Float + FloatConst + Into<f64>>(
    stamps: &[f64],
    magnitude: f64,
    settings: [f64; 5],
    hold_s: Option<f64>,
) -> Result<(Vec<f64>, Vec<f64>), CoreError> {
    let narrow = |value: f64| F::from(value).unwrap_or_else(F::nan);
    let [start, stop, record, fade_in, fade_out] = settings.map(narrow);
    let chirp = match hold_s {
        None => Chirp::new(start, stop, record, fade_in, fade_out)?,
        Some(hold) => Chirp::with_hold(start, stop, record, fade_in, fade_out, narrow(hold))?,
    };
    let samples = stamps.iter().map(|&time_s| chirp.sample(narrow(time_s), narrow(magnitude)));
    Ok(samples.map(|sample| (sample.value.into(), sample.frequency_rad_s.into())).unzip())
}

/// Add the functions of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(ardupilot_chirp, module)?)
}
