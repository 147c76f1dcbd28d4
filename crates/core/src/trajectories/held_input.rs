//! Sampled inputs between their samples, delayed, as straight lines over the steps of an integration.
//!
//! Each step takes the line that has the area and the first moment of the true input over it: the
//! input itself where it is straight there; where a delay moves a corner (first-order hold) or a jump
//! (zero-order hold) inside the step, its smooth stand-in, whose effect on the state is wrong only in
//! third order of the step. So the trajectory is a differentiable function of the delays.

use crate::error::CoreError;
use crate::linear::discretisation::Hold;
use crate::linear::smooth_input::{REACH, Weights, corner, interpolation};

/// A line over one step: values at its ends, and their derivatives by the delay.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Line {
    /// Value where the step begins.
    pub start: f64,
    /// Value where it ends.
    pub end: f64,
    /// Derivative of `start` by the delay, 1/s.
    pub start_slope: f64,
    /// Derivative of `end` by the delay, 1/s.
    pub end_slope: f64,
}

impl Line {
    /// Value and derivative by the delay at the beginning (0), middle (1) and end (2) of the step.
    pub(crate) fn at(&self, place: usize) -> (f64, f64) {
        match place {
            0 => (self.start, self.start_slope),
            1 => (0.5 * (self.start + self.end), 0.5 * (self.start_slope + self.end_slope)),
            _ => (self.end, self.end_slope),
        }
    }
}

/// One delayed input of one record.
#[derive(Debug, Clone, Default)]
pub struct HeldInput {
    /// Steps in time order, `substeps` for each sample interval.
    pub steps: Vec<Line>,
    /// Value at each sample and its derivative by the delay.
    pub samples: Vec<(f64, f64)>,
}

impl HeldInput {
    /// Follow a sampled input; before its first and after its last sample it keeps their values.
    ///
    /// # Errors
    /// `Range` for a delay that is negative or has no meaning.
    pub fn follow(
        &mut self,
        samples: &[f64],
        delay_s: f64,
        sample_s: f64,
        substeps: usize,
        hold: Hold,
    ) -> Result<(), CoreError> {
        let late = delay_s / sample_s;
        if !(0.0..1e9).contains(&late) {
            let needed = "zero or positive seconds";
            return Err(CoreError::Range { what: "input delay", found: delay_s, needed });
        }
        let lag = late.floor();
        let (fraction, lag) = (late - lag, lag as usize);
        self.steps.clear();
        self.samples.clear();
        if hold == Hold::BandLimited {
            self.follow_smooth(samples, (lag, fraction), sample_s, substeps);
            return Ok(());
        }
        let last = samples.len().saturating_sub(1);
        for k in 0..samples.len() {
            let at = |shift: usize| samples[(k + shift).saturating_sub(lag + 1).min(last)];
            let near = [at(0), at(1), at(2)];
            self.samples.push(if hold == Hold::First {
                let change = near[0] - near[1];
                (near[1] + fraction * change, change / sample_s)
            } else {
                (if fraction > 0.0 { near[0] } else { near[1] }, 0.0)
            });
            for part in 0..substeps {
                self.steps.push(line(near, fraction, part as f64, substeps as f64, hold, sample_s));
            }
        }
        Ok(())
    }

    /// The same of a smooth input, late by whole samples and part of one.
    fn follow_smooth(
        &mut self,
        samples: &[f64],
        (lag, fraction): (usize, f64),
        sample_s: f64,
        substeps: usize,
    ) {
        let last = samples.len().saturating_sub(1);
        let parts = substeps as f64;
        // All samples have the same weights.
        let centre = interpolation(-fraction);
        let points: Vec<Weights> =
            (0..=substeps).map(|part| corner(part as f64 / parts - fraction, parts)).collect();
        for k in 0..samples.len() {
            let value = |weights: &Weights| {
                let pairs = weights.iter().enumerate().map(|(j, &(value, slope))| {
                    let place = (k + j).saturating_sub(lag + REACH as usize).min(last);
                    (value * samples[place], -slope * samples[place] / sample_s)
                });
                pairs.fold((0.0, 0.0), |sum, each| (sum.0 + each.0, sum.1 + each.1))
            };
            self.samples.push(value(&centre));
            let mut before = value(&points[0]);
            for point in &points[1..] {
                let after = value(point);
                self.steps.push(Line {
                    start: before.0,
                    end: after.0,
                    start_slope: before.1,
                    end_slope: after.1,
                });
                before = after;
            }
        }
    }
}

/// The line of part `part` of `parts` of a sample interval whose input has its corner at `corner`
/// (in sample times): `near` holds the samples whose delayed stamps lie about the interval.
fn line(near: [f64; 3], corner: f64, part: f64, parts: f64, hold: Hold, sample_s: f64) -> Line {
    // The corner in units of the part.
    let place = corner * parts - part;
    let rest = 1.0 - place;
    let inside = (0.0..1.0).contains(&place);
    let [before, centre, after] = near;
    // Value at the ends and its derivative by the corner, with mean and slope of what the corner adds.
    // ∫f and 12 ∫(t − ½) f: the line of these has the area and the first moment of f.
    let (ends, ends_slope, step, mean, slope, mean_rate, slope_rate);
    match hold {
        Hold::BandLimited => return Line::default(),
        Hold::Zero => {
            let level = if place < 0.0 { centre } else { before };
            (ends, ends_slope) = ([level; 2], 0.0);
            step = centre - before;
            (mean, slope) = (rest, 6.0 * place * rest);
            (mean_rate, slope_rate) = (-1.0, 6.0 * (1.0 - 2.0 * place));
        }
        Hold::First => {
            let rate = if place < 0.0 { after - centre } else { centre - before };
            ends = [part, part + 1.0].map(|end| centre + (end / parts - corner) * rate);
            ends_slope = -rate;
            step = (after - 2.0 * centre + before) / parts;
            mean = 0.5 * rest * rest;
            slope = 12.0 * rest * rest * (rest / 3.0 + 0.5 * (place - 0.5));
            (mean_rate, slope_rate) = (-rest, -6.0 * rest * place);
        }
    }
    let (by_step, rate) = if inside { (step, step * parts) } else { (0.0, 0.0) };
    let slopes =
        [-0.5, 0.5].map(|end| (ends_slope + rate * (mean_rate + end * slope_rate)) / sample_s);
    Line {
        start: ends[0] + by_step * (mean - 0.5 * slope),
        end: ends[1] + by_step * (mean + 0.5 * slope),
        start_slope: slopes[0],
        end_slope: slopes[1],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: [f64; 5] = [0.0, 1.0, -2.0, 0.5, 3.0];

    fn follow(delay: f64, substeps: usize, hold: Hold) -> HeldInput {
        let mut held = HeldInput::default();
        held.follow(&SAMPLES, delay, 0.1, substeps, hold).unwrap();
        held
    }

    #[test]
    fn without_delay_lines_are_the_input() {
        let held = follow(0.0, 2, Hold::First);
        for k in 0..4 {
            let middle = 0.5 * (SAMPLES[k] + SAMPLES[k + 1]);
            let found = [held.steps[2 * k], held.steps[2 * k + 1]];
            let ends = [found[0].start, found[0].end, found[1].start, found[1].end];
            let wanted = [SAMPLES[k], middle, middle, SAMPLES[k + 1]];
            for (end, wanted) in ends.iter().zip(wanted) {
                assert!((end - wanted).abs() < 1e-14);
            }
        }
        let held = follow(0.0, 2, Hold::Zero);
        assert!((0..8).all(|j| held.steps[j].start == SAMPLES[j / 2]));
    }

    #[test]
    fn area_and_moment_of_a_moved_corner_are_kept() {
        for (hold, delay) in [(Hold::First, 0.013), (Hold::Zero, 0.013), (Hold::First, 0.088)] {
            let held = follow(delay, 1, hold);
            let value = |t: f64| {
                let s = ((t - delay) / 0.1).clamp(0.0, 4.0);
                let k = (s.floor() as usize).min(3);
                let part = if hold == Hold::First { s - k as f64 } else { 0.0 };
                SAMPLES[k] + part * (SAMPLES[k + 1] - SAMPLES[k])
            };
            for k in 0..3 {
                let n = 100_000;
                let (mut area, mut moment) = (0.0, 0.0);
                for i in 0..n {
                    let s = (i as f64 + 0.5) / n as f64;
                    let u = value(0.1 * (k as f64 + s));
                    (area, moment) = (area + u / n as f64, moment + u * s / n as f64);
                }
                let (a, b) = (held.steps[k].start, held.steps[k].end);
                assert!((area - 0.5 * (a + b)).abs() < 1e-4, "{hold:?} {k}");
                assert!((moment - (a + 2.0 * b) / 6.0).abs() < 1e-4, "{hold:?} {k}");
            }
        }
    }

    #[test]
    fn derivatives_by_the_delay_match_differences() {
        for hold in [Hold::First, Hold::Zero] {
            for (delay, substeps) in [(0.013, 1), (0.037, 3), (0.151, 2)] {
                let h = 1e-6;
                let (up, down) =
                    (follow(delay + h, substeps, hold), follow(delay - h, substeps, hold));
                for (j, line) in follow(delay, substeps, hold).steps.iter().enumerate() {
                    for place in 0..3 {
                        let change = up.steps[j].at(place).0 - down.steps[j].at(place).0;
                        let error = change / (2.0 * h) - line.at(place).1;
                        assert!(error.abs() < 1e-5, "{hold:?} {delay} {j} {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_smooth_input_and_its_slope_by_the_delay_follow_the_signal() {
        let samples: Vec<f64> = (0..40).map(|k| (0.8 * f64::from(k)).sin()).collect();
        let mut held = HeldInput::default();
        held.follow(&samples, 0.013, 0.1, 4, Hold::BandLimited).unwrap();
        for j in 40..120 {
            let phase = 8.0 * (0.025 * f64::from(j) - 0.013);
            let line = held.steps[j as usize];
            // Points of the lines are raised by what straight lines weaken.
            assert!((line.start - (1.0 + 0.04 / 12.0) * phase.sin()).abs() < 1e-3);
            assert!((line.start_slope + 8.0 * phase.cos()).abs() < 5e-2);
        }
    }

    #[test]
    fn a_negative_delay_is_refused() {
        let found = HeldInput::default().follow(&SAMPLES, -0.1, 0.1, 1, Hold::First);
        assert!(matches!(found, Err(CoreError::Range { .. })));
    }
}
