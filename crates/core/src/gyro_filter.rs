//! ArduPilot's two-pole low-pass (INS_GYRO_FILTER): a Butterworth biquad, prewarped at its cut-off.

/// One channel of the filter.
#[derive(Debug, Clone)]
pub struct GyroFilter {
    feedforward: [f64; 3],
    feedback: [f64; 2],
    delay: [f64; 2],
    started: bool,
}

impl GyroFilter {
    /// Filter with a cut-off (Hz) at a sample rate (Hz); a cut-off of 0 passes everything.
    pub fn new(cutoff_hz: f64, sample_rate_hz: f64) -> Self {
        let mut filter = Self {
            feedforward: [1.0, 0.0, 0.0],
            feedback: [0.0; 2],
            delay: [0.0; 2],
            started: false,
        };
        if cutoff_hz > 0.0 {
            let ohm = (std::f64::consts::PI * cutoff_hz / sample_rate_hz).tan();
            let c = 1.0 + std::f64::consts::SQRT_2 * ohm + ohm * ohm;
            let b0 = ohm * ohm / c;
            filter.feedforward = [b0, 2.0 * b0, b0];
            filter.feedback = [
                2.0 * (ohm * ohm - 1.0) / c,
                (1.0 - std::f64::consts::SQRT_2 * ohm + ohm * ohm) / c,
            ];
        }
        filter
    }

    /// Next sample; the first one is taken as the steady state.
    pub fn apply(&mut self, sample: f64) -> f64 {
        let [a1, a2] = self.feedback;
        if !self.started {
            self.started = true;
            self.delay = [sample / (1.0 + a1 + a2); 2];
        }
        let newest = sample - a1 * self.delay[0] - a2 * self.delay[1];
        let [b0, b1, b2] = self.feedforward;
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
        let (cutoff, rate) = (40.0, 400.0);
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
