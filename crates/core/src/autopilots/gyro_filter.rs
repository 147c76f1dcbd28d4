//! Two-pole low-pass of the gyro in ArduPilot (INS_GYRO_FILTER) and PX4 (IMU_GYRO_CUTOFF): a
//! Butterworth section, prewarped at its cut-off (Python side: `control/autopilots/filters.py`).

use crate::autopilots::notch_filter::Section;
use num_traits::{Float, FloatConst};

/// b0, b1, b2, a1, a2 of the low-pass; None for a cut-off of 0, which switches it off.
pub fn low_pass<F: Float + FloatConst>(sample_rate_hz: F, cutoff_hz: F) -> Option<Section<F>> {
    if cutoff_hz <= F::zero() {
        return None;
    }
    let (one, two) = (F::one(), F::one() + F::one());
    let ohm = (F::PI() * cutoff_hz / sample_rate_hz).tan();
    let c = one + F::SQRT_2() * ohm + ohm * ohm;
    let b0 = ohm * ohm / c;
    let a1 = two * (ohm * ohm - one) / c;
    let a2 = (one - F::SQRT_2() * ohm + ohm * ohm) / c;
    Some([b0, two * b0, b0, a1, a2])
}

/// One channel of the filter, direct form II.
#[derive(Debug, Clone)]
pub struct GyroFilter<F> {
    section: Section<F>,
    delay: [F; 2],
    started: bool,
}

impl<F: Float + FloatConst> GyroFilter<F> {
    /// Filter with a cut-off (Hz) at a sample rate (Hz); a cut-off of 0 passes everything.
    pub fn new(cutoff_hz: F, sample_rate_hz: F) -> Self {
        let zero = F::zero();
        let passing = [F::one(), zero, zero, zero, zero];
        let section = low_pass(sample_rate_hz, cutoff_hz).unwrap_or(passing);
        Self { section, delay: [zero; 2], started: false }
    }

    /// Next sample; the first one is taken as the steady state.
    pub fn apply(&mut self, sample: F) -> F {
        let [b0, b1, b2, a1, a2] = self.section;
        if !self.started {
            self.started = true;
            self.delay = [sample / (F::one() + a1 + a2); 2];
        }
        let newest = sample - a1 * self.delay[0] - a2 * self.delay[1];
        let output = b0 * newest + b1 * self.delay[0] + b2 * self.delay[1];
        self.delay = [newest, self.delay[0]];
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_is_one_at_rest_and_half_power_at_the_cut_off() {
        let (cutoff, rate): (f64, f64) = (40.0, 400.0);
        let mut filter = GyroFilter::new(cutoff, rate);
        assert!((filter.apply(2.0) - 2.0).abs() < 1e-12);
        let mut peak: f64 = 0.0;
        for k in 0..4000 {
            let angle = 2.0 * std::f64::consts::PI * cutoff * f64::from(k) / rate + 0.3;
            let output = filter.apply(angle.sin());
            // The two quadrature samples of a period of ten give the amplitude of a sine.
            peak = if k > 3000 { peak.max(output.abs()) } else { 0.0 };
        }
        assert!(peak <= std::f64::consts::FRAC_1_SQRT_2 + 1e-9 && peak > 0.66);
    }

    #[test]
    fn a_cut_off_of_zero_is_off() {
        let mut filter = GyroFilter::new(0.0, 400.0);
        assert_eq!((filter.apply(1.0), filter.apply(-3.0)), (1.0, -3.0));
    }
}
