//! Errors one sample ahead of a slow drift under white noise, its gain the most likely one: the
//! filter (1 - pole q⁻¹) / (1 - (pole - gain) q⁻¹). (Python side:
//! identification/output_error/sensor_noise.py)

use crate::error::CoreError;

/// How a gain is searched for.
pub struct GainSearch<'a> {
    /// First samples of each record that are left out of sums.
    pub skip: usize,
    /// Most steps.
    pub steps: usize,
    /// Shares of a step that are tried.
    pub shares: &'a [f64],
    /// Gain in the logarithm of the variance below which the search ends.
    pub settled: f64,
}

/// Errors of all records, each without its first `skip` samples, by Gauss-Newton from `gain`.
///
/// # Errors
/// `Shape` where lengths do not add up to the samples.
pub fn drift_errors(
    samples: &[f64],
    lengths: &[usize],
    pole: f64,
    gain: f64,
    search: &GainSearch<'_>,
) -> Result<Vec<f64>, CoreError> {
    if lengths.iter().sum::<usize>() != samples.len() {
        let (found, needed) = (samples.len(), lengths.iter().sum());
        return Err(CoreError::Shape { what: "samples of a drift", found, needed });
    }
    let mut best = filtered(samples, lengths, pole, gain, search.skip);
    let mut gain = gain;
    for _ in 0..search.steps {
        let before = best.power;
        for share in search.shares {
            let tried = gain + share * best.step;
            if (pole - tried).abs() >= 1.0 {
                continue;
            }
            let found = filtered(samples, lengths, pole, tried, search.skip);
            if found.power < best.power {
                (gain, best) = (tried, found);
                break;
            }
        }
        if (before / best.power).ln() < search.settled {
            break;
        }
    }
    Ok(best.errors)
}

struct Filtered {
    errors: Vec<f64>,
    power: f64,
    step: f64,
}

fn filtered(samples: &[f64], lengths: &[usize], pole: f64, gain: f64, skip: usize) -> Filtered {
    let closed = pole - gain;
    let mut errors = Vec::with_capacity(samples.len());
    let (mut power, mut cross, mut seen) = (0.0, 0.0, 0.0);
    let mut rest = samples;
    for &length in lengths {
        let (record, after) = rest.split_at(length);
        rest = after;
        let (mut state, mut slope) = (0.0, 0.0);
        for (place, value) in record.iter().enumerate() {
            let error = value - state;
            if place >= skip {
                errors.push(error);
                power += error * error;
                cross += slope * error;
                seen += slope * slope;
            }
            slope = closed * slope + error;
            state = closed * state + gain * value;
        }
    }
    Filtered { errors, power, step: cross / (seen + 1e-300) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: GainSearch<'_> =
        GainSearch { skip: 1, steps: 10, shares: &[1.0, 0.5], settled: 1e-12 };

    #[test]
    fn a_pure_drift_is_foretold_to_its_steps() {
        // Steps of one sample in three: without noise of the sensor the gain is the pole.
        let steps = [1.0, 0.0, 0.0, -2.0, 0.0, 0.5, 0.0, 0.0, 3.0, 0.0, 0.0, -1.0];
        let mut value = 0.0;
        let samples: Vec<f64> = steps
            .iter()
            .map(|step| {
                value = 0.9 * value + step;
                value
            })
            .collect();
        let found = filtered(&samples, &[12], 0.9, 0.9, 1).errors;
        for (error, step) in found.iter().zip(&steps[1..]) {
            assert!((error - step).abs() < 1e-12);
        }
        let searched = drift_errors(&samples, &[12], 0.9, 0.2, &SEARCH).unwrap();
        let power = |each: &[f64]| each.iter().map(|e| e * e).sum::<f64>();
        assert!(power(&searched) <= power(&found) + 1e-9);
    }

    #[test]
    fn records_do_not_touch_each_other_and_lengths_fit() {
        let both = filtered(&[1.0, 2.0, 5.0, 1.0, 2.0, 5.0], &[3, 3], 0.8, 0.3, 1).errors;
        assert_eq!(both[..2], both[2..]);
        let found = drift_errors(&[1.0; 3], &[2], 0.8, 0.3, &SEARCH);
        assert!(matches!(found, Err(CoreError::Shape { .. })));
    }
}
