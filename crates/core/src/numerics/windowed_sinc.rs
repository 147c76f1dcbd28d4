//! Samples between uniform samples, by a sinc under a Kaiser window.
//! (Python side: `record/interpolation.py`)

use std::f64::consts::TAU;

use super::widest::widest;

/// Phases are rounded to so many parts of a sample: rational ratios repeat a few of them.
const PARTS: f64 = 1e9;
/// Phases whose weights are remembered, a power of two.
const REMEMBERED: u32 = 64;
const LANES: usize = 8;

/// Uniform samples at fractional positions. The ends are continued by odd reflection, `half + 1`
/// samples beyond which the last of them holds. Weights of a position sum to one about it, so that
/// constants and lines come out exactly.
///
/// `cutoff` is the −6 dB frequency in cycles per sample, `half` half of the kernel's length in
/// samples, `beta` Kaiser's. Oppenheim & Schafer, Discrete-Time Signal Processing, eq. 7.75.
pub fn windowed_sinc(
    values: &[f64],
    positions: &[f64],
    cutoff: f64,
    half: usize,
    beta: f64,
) -> Vec<f64> {
    if values.is_empty() {
        return vec![f64::NAN; positions.len()];
    }
    widest(
        #[inline(always)]
        || {
            let mut kernel = Kernel::new(cutoff, half, beta);
            positions.iter().map(|&position| kernel.sample(values, position)).collect()
        },
    )
}

struct Kernel {
    half: usize,
    /// 2π times the cutoff.
    rate: f64,
    /// Taps from the one at position 0, then sine and cosine of `rate` times them.
    taps: Vec<f64>,
    sines: Vec<f64>,
    cosines: Vec<f64>,
    /// Taylor coefficients of the window in 1 − (distance / half length)², highest first.
    window: Vec<f64>,
    /// Phase, in parts, and weights of each place.
    known: Vec<(i64, Vec<f64>)>,
    /// Samples around a position near an end.
    around: Vec<f64>,
    /// The window at the taps of a phase.
    shape: Vec<f64>,
}

impl Kernel {
    fn new(cutoff: f64, half: usize, beta: f64) -> Self {
        let rate = TAU * cutoff;
        let count = 2 * half + 2;
        let taps: Vec<f64> = (0..count).map(|place| place as f64 - half as f64).collect();
        Self {
            half,
            rate,
            sines: taps.iter().map(|tap| (rate * tap).sin()).collect(),
            cosines: taps.iter().map(|tap| (rate * tap).cos()).collect(),
            window: bessel(beta),
            known: vec![(-1, vec![0.0; count]); REMEMBERED as usize],
            around: vec![0.0; count],
            shape: vec![0.0; count],
            taps,
        }
    }

    #[inline(always)]
    fn sample(&mut self, values: &[f64], position: f64) -> f64 {
        let nearest = position.floor();
        let phase = ((position - nearest) * PARTS).round_ties_even();
        let place = (phase as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (64 - REMEMBERED.ilog2());
        let place = place as usize;
        if self.known[place].0 != phase as i64 {
            let mut weights = std::mem::take(&mut self.known[place].1);
            self.weigh(&mut weights, phase / PARTS);
            self.known[place] = (phase as i64, weights);
        }
        let weights = &self.known[place].1;
        let first = nearest as i64 - self.half as i64;
        let inside = usize::try_from(first).ok().and_then(|at| values.get(at..at + weights.len()));
        if let Some(inside) = inside {
            return dot(weights, inside);
        }
        let (low, high) = (-(self.half as i64) - 1, (values.len() + self.half) as i64);
        for (offset, sample) in self.around.iter_mut().enumerate() {
            *sample = continued(values, first.saturating_add(offset as i64).clamp(low, high));
        }
        dot(weights, &self.around)
    }

    #[inline(always)]
    fn weigh(&mut self, weights: &mut [f64], phase: f64) {
        let (sine, cosine) = (self.rate * phase).sin_cos();
        let reach = 1.0 / (self.half as f64 + 1.0);
        let count = weights.len();
        for start in (0..count).step_by(LANES) {
            let mut inside = [0.0; LANES];
            let mut ratio = [0.0; LANES];
            for lane in 0..LANES.min(count - start) {
                let distance = self.taps[start + lane] - phase;
                let share = distance * reach;
                inside[lane] = (1.0 - share * share).max(0.0);
                let numerator =
                    self.sines[start + lane] * cosine - self.cosines[start + lane] * sine;
                ratio[lane] = numerator / (self.rate * distance);
            }
            let mut window = [0.0; LANES];
            for coefficient in &self.window {
                for lane in 0..LANES {
                    window[lane] = window[lane] * inside[lane] + coefficient;
                }
            }
            for lane in 0..LANES.min(count - start) {
                let window = if inside[lane] > 0.0 { window[lane] } else { 0.0 };
                self.shape[start + lane] = window;
                weights[start + lane] = ratio[lane] * window;
            }
        }
        // Next to the position the difference of two products has lost its digits.
        for (weight, tap) in weights.iter_mut().zip(&self.taps).skip(self.half).take(2) {
            let distance = tap - phase;
            let (angle, share) = (self.rate * distance, distance * reach);
            let window =
                self.window.iter().fold(0.0, |sum, each| sum * (1.0 - share * share) + each);
            *weight = window * if angle == 0.0 { 1.0 } else { angle.sin() / angle };
        }
        let whole: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= whole);
        self.centre(weights, phase);
    }

    /// Moves the weights' mean to their position, by the window tilted, which stops what it stops.
    #[inline(always)]
    fn centre(&self, weights: &mut [f64], phase: f64) {
        let moment = |of: &[f64]| -> f64 {
            of.iter().zip(&self.taps).map(|(each, tap)| each * (tap - phase)).sum()
        };
        let mean = moment(&self.shape) / self.shape.iter().sum::<f64>();
        let tilted = |(window, tap): (&f64, &f64)| window * (tap - phase - mean);
        let power: f64 = self
            .shape
            .iter()
            .zip(&self.taps)
            .map(|(window, tap)| window * (tap - phase - mean).powi(2))
            .sum();
        let late = moment(weights) / power;
        for (weight, place) in weights.iter_mut().zip(self.shape.iter().zip(&self.taps)) {
            *weight -= late * tilted(place);
        }
    }
}

/// Coefficients of I₀(β√u) in u, highest first, as far as they count at u = 1: all are positive, so
/// that nothing cancels (Abramowitz & Stegun, eq. 9.6.12).
fn bessel(beta: f64) -> Vec<f64> {
    let (mut terms, mut sum, mut term) = (Vec::new(), 0.0, 1.0);
    while term > 1e-18 * sum {
        terms.push(term);
        sum += term;
        term *= (0.5 * beta / terms.len() as f64).powi(2);
    }
    terms.reverse();
    terms
}

/// A sample, or what odd reflection makes of it beyond the ends.
fn continued(values: &[f64], mut at: i64) -> f64 {
    let last = values.len() as i64 - 1;
    let (mut sign, mut level) = (1.0, 0.0);
    while last > 0 && !(0..=last).contains(&at) {
        let edge = if at < 0 { 0 } else { last };
        level += sign * 2.0 * values[edge as usize];
        sign = -sign;
        at = 2 * edge - at;
    }
    level + sign * values[at.clamp(0, last) as usize]
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::windowed_sinc;

    #[test]
    fn a_line_goes_on_through_its_ends() {
        let line: Vec<f64> = (0..200).map(|k| 3.0 + 0.5 * f64::from(k)).collect();
        let at: Vec<f64> = (0..400).map(|k| 0.4987 * f64::from(k)).collect();
        for (cutoff, half) in [(0.5, 33), (0.225, 66)] {
            let made = windowed_sinc(&line, &at, cutoff, half, 10.06);
            for (value, place) in made.iter().zip(&at) {
                assert!((value - 3.0 - 0.5 * place).abs() < 1e-12, "{value} at {place}");
            }
        }
    }

    #[test]
    fn one_sample_is_a_constant() {
        assert_eq!(windowed_sinc(&[2.0], &[0.0, 0.25], 0.5, 3, 10.06)[0], 2.0);
    }
}
