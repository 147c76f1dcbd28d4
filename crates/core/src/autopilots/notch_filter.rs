//! Notch filters of ArduPilot and PX4: the same recursion, two ways to state the shape (Python side:
//! `control/autopilots/filters.py`).

use num_traits::{Float, FloatConst};

/// Coefficients of a second-order section: b0, b1, b2, a1, a2 with a0 = 1.
pub type Section<F> = [F; 5];

/// ArduPilot's notch: gain 10^(−attenuation/20) at the centre.
/// None where the firmware leaves it off: a centre outside 0 to half the rate, or no quality.
pub fn ardupilot_notch<F: Float + FloatConst>(
    sample_rate_hz: F,
    center_hz: F,
    quality: F,
    attenuation_db: F,
) -> Option<Section<F>> {
    let two = F::one() + F::one();
    let inside = center_hz > F::zero() && center_hz < sample_rate_hz / two;
    if !(inside && quality > F::zero()) {
        return None;
    }
    let omega = F::TAU() * center_hz / sample_rate_hz;
    let alpha = omega.sin() / (two * quality);
    let ten = F::from(10.0)?;
    let root = ten.powf(-attenuation_db / F::from(40.0)?);
    let scale = F::one() / (F::one() + alpha);
    let middle = -two * omega.cos() * scale;
    let depth = alpha * root * root;
    Some([
        (F::one() + depth) * scale,
        middle,
        (F::one() - depth) * scale,
        middle,
        (F::one() - alpha) * scale,
    ])
}

/// Quality of ArduPilot's notch from its bandwidth, measured in octaves below the centre.
pub fn ardupilot_quality<F: Float>(center_hz: F, bandwidth_hz: F) -> F {
    let two = F::one() + F::one();
    let lower = center_hz - bandwidth_hz / two;
    if lower <= F::zero() {
        return F::zero();
    }
    let ratio = two.powf((center_hz / lower).log2() * two);
    ratio.sqrt() / (ratio - F::one())
}

/// PX4's notch: nothing passes at the centre, −3 dB a bandwidth apart.
/// None where the firmware leaves it off.
pub fn px4_notch<F: Float + FloatConst>(
    sample_rate_hz: F,
    center_hz: F,
    bandwidth_hz: F,
) -> Option<Section<F>> {
    let two = F::one() + F::one();
    let inside = center_hz > F::zero() && center_hz < sample_rate_hz / two;
    if !(inside && bandwidth_hz > F::zero()) {
        return None;
    }
    let least = sample_rate_hz * F::from(0.001)?;
    let (center, bandwidth) = (center_hz.max(least), bandwidth_hz.max(least));
    let alpha = (F::PI() * bandwidth / sample_rate_hz).tan();
    let scale = F::one() / (alpha + F::one());
    let middle = -two * (F::TAU() * center / sample_rate_hz).cos() * scale;
    Some([scale, middle, scale, middle, (F::one() - alpha) * scale])
}

/// One channel of a notch, direct form I.
#[derive(Debug, Clone)]
pub struct Notch<F> {
    section: Section<F>,
    inputs: [F; 2],
    outputs: [F; 2],
    started: bool,
}

impl<F: Float> Notch<F> {
    /// A filter at rest.
    pub fn new(section: Section<F>) -> Self {
        let zero = F::zero();
        Self { section, inputs: [zero; 2], outputs: [zero; 2], started: false }
    }

    /// Next sample; the first one is taken as the steady state.
    pub fn apply(&mut self, sample: F) -> F {
        if !self.started {
            self.started = true;
            self.inputs = [sample; 2];
            self.outputs = [sample; 2];
            return sample;
        }
        let [b0, b1, b2, a1, a2] = self.section;
        let ([x1, x2], [y1, y2]) = (self.inputs, self.outputs);
        let output = sample * b0 + x1 * b1 + x2 * b2 - y1 * a1 - y2 * a2;
        self.inputs = [sample, x1];
        self.outputs = [output, y1];
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn amplitude(section: Section<f64>, frequency_hz: f64, rate_hz: f64) -> f64 {
        let mut notch = Notch::new(section);
        let mut peak: f64 = 0.0;
        for k in 0..20_000 {
            let angle = std::f64::consts::TAU * frequency_hz * f64::from(k) / rate_hz;
            let output = notch.apply(angle.sin());
            peak = if k > 15_000 { peak.max(output.abs()) } else { 0.0 };
        }
        peak
    }

    #[test]
    fn depth_at_the_centre() {
        let section = ardupilot_notch(1000.0, 80.0, 2.0, 40.0).unwrap();
        assert!((amplitude(section, 80.0, 1000.0) - 0.01).abs() < 1e-4);
        let section = px4_notch(1000.0, 80.0, 20.0).unwrap();
        assert!(amplitude(section, 80.0, 1000.0) < 1e-9);
    }

    #[test]
    fn refuses_what_the_firmware_leaves_off() {
        assert!(ardupilot_notch(400.0, 200.0, 2.0, 40.0).is_none());
        assert!(ardupilot_notch(400.0, 50.0, 0.0, 40.0).is_none());
        assert!(px4_notch(400.0, 0.0, 20.0).is_none());
        assert_eq!(ardupilot_quality(10.0, 20.0), 0.0);
    }
}
