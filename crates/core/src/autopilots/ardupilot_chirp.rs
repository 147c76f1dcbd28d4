//! ArduPilot's system-identification chirp (Python side: `excitation/sweep.py`).
//!
//! A dwell at the start frequency, then a frequency that grows exponentially, under raised-cosine
//! fades. The autopilot computes in single precision; with `f32` the order of operations here is
//! the autopilot's, so that a logged target is matched to rounding. `f64` serves design.

use num_traits::{Float, FloatConst};

use crate::error::CoreError;

/// A chirp: frequencies in Hz, times in s from the first moment of the chirp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chirp<F> {
    start_rad_s: F,
    stop_rad_s: F,
    record_s: F,
    fade_in_s: F,
    fade_out_s: F,
    hold_s: F,
    /// Natural logarithm of stop over start frequency.
    growth: F,
}

/// The waveform and what was swept at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChirpSample<F> {
    /// Signal, in the unit of the magnitude.
    pub value: F,
    /// Instantaneous frequency, rad/s.
    pub frequency_rad_s: F,
}

impl<F: Float + FloatConst> Chirp<F> {
    /// A chirp with ArduPilot's dwell of two cycles at the start frequency.
    ///
    /// # Errors
    /// [`CoreError::Range`] as for [`Chirp::with_hold`].
    pub fn new(
        start_hz: F,
        stop_hz: F,
        record_s: F,
        fade_in_s: F,
        fade_out_s: F,
    ) -> Result<Self, CoreError> {
        let two = F::one() + F::one();
        Self::with_hold(start_hz, stop_hz, record_s, fade_in_s, fade_out_s, two / start_hz)
    }

    /// A chirp with a dwell of `hold_s` at the start frequency.
    ///
    /// # Errors
    /// [`CoreError::Range`] for frequencies that are not positive, a record that is not longer than
    /// the dwell, or fades that are negative or longer than the record.
    pub fn with_hold(
        start_hz: F,
        stop_hz: F,
        record_s: F,
        fade_in_s: F,
        fade_out_s: F,
        hold_s: F,
    ) -> Result<Self, CoreError> {
        let zero = F::zero();
        for (what, frequency) in
            [("chirp start frequency", start_hz), ("chirp stop frequency", stop_hz)]
        {
            require(frequency > zero, what, frequency, "a positive number of Hz")?;
        }
        require(hold_s >= zero, "chirp dwell", hold_s, "zero or more seconds")?;
        require(
            record_s > hold_s,
            "chirp record length",
            record_s,
            "more seconds than the dwell (two cycles of the start frequency) lasts",
        )?;
        for (what, fade) in [("chirp fade-in", fade_in_s), ("chirp fade-out", fade_out_s)] {
            let fits = fade >= zero && fade <= record_s;
            require(fits, what, fade, "between zero and the record length")?;
        }
        let two_pi = F::PI() + F::PI();
        let start_rad_s = two_pi * start_hz;
        let stop_rad_s = two_pi * stop_hz;
        Ok(Self {
            start_rad_s,
            stop_rad_s,
            record_s,
            fade_in_s,
            fade_out_s,
            hold_s,
            growth: (stop_rad_s / start_rad_s).ln(),
        })
    }

    /// Length of the dwell, s.
    pub fn hold_s(&self) -> F {
        self.hold_s
    }

    /// Waveform and instantaneous frequency `time_s` after the start; silent outside the record.
    pub fn sample(&self, time_s: F, magnitude: F) -> ChirpSample<F> {
        let zero = F::zero();
        if time_s <= zero {
            return ChirpSample { value: zero, frequency_rad_s: self.start_rad_s };
        }
        if time_s > self.record_s {
            return ChirpSample { value: zero, frequency_rad_s: self.stop_rad_s };
        }
        let (phase, frequency_rad_s) = self.phase(time_s);
        ChirpSample { value: self.fade(time_s) * magnitude * phase.sin(), frequency_rad_s }
    }

    fn phase(&self, time_s: F) -> (F, F) {
        let start = self.start_rad_s;
        if time_s <= self.hold_s {
            return (start * time_s - start * self.hold_s, start);
        }
        if self.growth == F::zero() {
            return (start * time_s, start);
        }
        let sweep_s = self.record_s - self.hold_s;
        let grown = (self.growth * (time_s - self.hold_s) / sweep_s).exp();
        ((start * sweep_s / self.growth) * (grown - F::one()), start * grown)
    }

    fn fade(&self, time_s: F) -> F {
        let one = F::one();
        let half = one / (one + one);
        let fade_out_start_s = self.record_s - self.fade_out_s;
        if time_s <= self.fade_in_s {
            half - half * (F::PI() * time_s / self.fade_in_s).cos()
        } else if time_s <= fade_out_start_s {
            one
        } else {
            half - half * (F::PI() * (time_s - fade_out_start_s) / self.fade_out_s + F::PI()).cos()
        }
    }
}

fn require<F: Float>(
    holds: bool,
    what: &'static str,
    found: F,
    needed: &'static str,
) -> Result<(), CoreError> {
    let found = found.to_f64().unwrap_or(f64::NAN);
    if holds && found.is_finite() { Ok(()) } else { Err(CoreError::Range { what, found, needed }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Settings of the published rig flight and values computed for it independently.
    const SPOTS: [(f64, f64, f64); 5] = [
        (1.0, 0.004426275, 0.05),
        (5.0, 0.15, 0.05),
        (60.0, -0.149803391, 0.139127970),
        (100.0, 0.068238868, 1.077217345),
        (129.0, -0.010752534, 4.750592537),
    ];

    #[test]
    fn double_precision_meets_the_spot_values() {
        let chirp = Chirp::<f64>::new(0.05, 5.0, 130.0, 5.0, 5.0).unwrap();
        for (time_s, value, hertz) in SPOTS {
            let sample = chirp.sample(time_s, 0.15);
            assert!((sample.value - value).abs() < 1e-9, "{time_s}: {sample:?}");
            let found = sample.frequency_rad_s / std::f64::consts::TAU;
            assert!((found - hertz).abs() < 1e-9, "{time_s}: {found}");
        }
    }

    #[test]
    fn single_precision_stays_within_the_rounding_of_the_phase() {
        let single = Chirp::<f32>::new(0.05, 5.0, 130.0, 5.0, 5.0).unwrap();
        for (time_s, value, _) in SPOTS {
            let sample = single.sample(time_s as f32, 0.15);
            // 622 rad of phase in single precision: a few units in the last place are 1e-4 rad.
            assert!((f64::from(sample.value) - value).abs() < 0.15 * 2e-4, "{time_s}: {sample:?}");
        }
    }

    #[test]
    fn is_silent_outside_and_continuous_at_the_end_of_the_dwell() {
        let chirp = Chirp::<f64>::new(0.5, 40.0, 70.0, 15.0, 2.0).unwrap();
        assert_eq!(chirp.sample(0.0, 1.0).value, 0.0);
        assert_eq!(chirp.sample(70.001, 1.0).value, 0.0);
        assert_eq!(chirp.hold_s(), 4.0);
        let before = chirp.sample(4.0 - 1e-9, 1.0);
        let after = chirp.sample(4.0 + 1e-9, 1.0);
        assert!((before.value - after.value).abs() < 1e-7);
        assert!((before.frequency_rad_s - after.frequency_rad_s).abs() < 1e-7);
    }

    #[test]
    fn equal_frequencies_make_a_sine() {
        let chirp = Chirp::<f64>::new(1.0, 1.0, 20.0, 0.0, 0.0).unwrap();
        assert!((chirp.sample(7.25, 2.0).value - 2.0).abs() < 1e-9);
    }

    #[test]
    fn refuses_what_cannot_be_flown() {
        for (start, stop, record, fade_in, fade_out) in [
            (0.0, 5.0, 10.0, 1.0, 1.0),
            (1.0, -5.0, 10.0, 1.0, 1.0),
            (1.0, f64::NAN, 10.0, 1.0, 1.0),
            (0.1, 5.0, 10.0, 1.0, 1.0),
            (1.0, 5.0, 10.0, -1.0, 1.0),
            (1.0, 5.0, 10.0, 1.0, 11.0),
        ] {
            assert!(Chirp::new(start, stop, record, fade_in, fade_out).is_err());
        }
    }
}
