//! The one-pole low-pass of ArduPilot and PX4 (Python side: `control/autopilots/filters.py`).

use num_traits::{Float, FloatConst};

/// Weight of the newest sample, Δt/(Δt + 1/(2πf)); a cut-off of 0 Hz switches the filter off.
pub fn newest_weight<F: Float + FloatConst>(dt: F, cutoff_hz: F) -> F {
    if cutoff_hz <= F::zero() {
        return F::one();
    }
    let rc = F::one() / (F::TAU() * cutoff_hz);
    dt / (dt + rc)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_is_off_passes_everything() {
        assert_eq!(newest_weight(0.0025_f32, 0.0), 1.0);
        assert!((newest_weight(0.0025_f32, 20.0) - 0.239_057).abs() < 1e-6);
    }
}
