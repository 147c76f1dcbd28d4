//! Whether samples of a channel show anything that a closer look could find: one reading of most of them
//! is enough to pass them over. (Python side: record/sample_faults.py)

use super::running_median::running_median;
use super::widest::widest;

const LANES: usize = 8;
/// Relative room for rounding between a median and the count that stands for it.
const ROUNDING: f64 = 1e-9;

/// What one reading of a channel tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleSigns {
    /// Whether all samples and their stamps are finite; nothing else is known where they are not.
    pub is_finite: bool,
    /// Largest sample less the smallest.
    pub range: f64,
    /// Whether any sample is that before.
    pub rests: bool,
    /// Largest change from one sample to the next.
    pub largest_step: f64,
    /// Whether a sample may be farther from its running median than so many times the median of these
    /// distances.
    pub stands_out: bool,
}

impl SampleSigns {
    /// Of at least one sample; `half` neighbours on either side make a running median, of which a sample
    /// stands out that is `times` the median distance away.
    pub fn of(stamps: &[f64], values: &[f64], half: usize, times: f64) -> Self {
        let mut found = Self {
            is_finite: widest(
                #[inline(always)]
                || all_finite(stamps) && all_finite(values),
            ),
            range: 0.0,
            rests: false,
            largest_step: 0.0,
            stands_out: false,
        };
        if !found.is_finite || values.is_empty() {
            return found;
        }
        (found.range, found.largest_step, found.rests) = widest(
            #[inline(always)]
            || moved(values),
        );
        if found.range > 0.0 {
            let medians = running_median(values, half);
            found.stands_out = widest(
                #[inline(always)]
                || stands_out(values, medians, times),
            );
        }
        found
    }
}

/// No number but these times zero is not zero.
#[inline(always)]
fn all_finite(values: &[f64]) -> bool {
    let mut sums = [0.0; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, value)| *sum += value * 0.0);
    }
    sums.iter_mut().zip(rest).for_each(|(sum, value)| *sum += value * 0.0);
    sums.iter().all(|&sum| sum == 0.0)
}

/// Range, largest step, and whether there is a step of zero.
#[inline(always)]
fn moved(values: &[f64]) -> (f64, f64, bool) {
    let (mut low, mut high) = ([values[0]; LANES], [values[0]; LANES]);
    let (mut least, mut most) = ([f64::INFINITY; LANES], [0.0; LANES]);
    let ahead = &values[1..];
    let (chunks, rest) = values[..ahead.len()].as_chunks::<LANES>();
    for (now, next) in chunks.iter().zip(ahead.as_chunks::<LANES>().0) {
        let step: [f64; LANES] = std::array::from_fn(|lane| (next[lane] - now[lane]).abs());
        keep(&mut low, next, |old, new| new < old);
        keep(&mut high, next, |old, new| new > old);
        keep(&mut least, &step, |old, new| new < old);
        keep(&mut most, &step, |old, new| new > old);
    }
    for (now, next) in rest.iter().zip(&ahead[chunks.len() * LANES..]) {
        let step = (next - now).abs();
        (low[0], high[0]) = (low[0].min(*next), high[0].max(*next));
        (least[0], most[0]) = (least[0].min(step), most[0].max(step));
    }
    let [low, least] = [low, least].map(|lanes| lanes.into_iter().fold(f64::INFINITY, f64::min));
    let [high, most] = [high, most].map(|lanes| lanes.into_iter().fold(-f64::INFINITY, f64::max));
    (high - low, most, least == 0.0)
}

/// The new value of each lane where it is beyond the old one.
#[inline(always)]
fn keep(lanes: &mut [f64; LANES], new: &[f64; LANES], beyond: impl Fn(f64, f64) -> bool) {
    for (old, &new) in lanes.iter_mut().zip(new) {
        *old = if beyond(*old, new) { new } else { *old };
    }
}

/// A sample is `times` the median distance away only where most distances are below the largest over
/// `times`: these are counted, in place of a median.
#[inline(always)]
fn stands_out(values: &[f64], mut medians: Vec<f64>, times: f64) -> bool {
    let mut largest = [0.0; LANES];
    for (aways, values) in medians.chunks_mut(LANES).zip(values.chunks(LANES)) {
        for ((away, value), largest) in aways.iter_mut().zip(values).zip(&mut largest) {
            *away = (value - *away).abs();
            *largest = if *away > *largest { *away } else { *largest };
        }
    }
    let largest = largest.into_iter().fold(0.0, f64::max);
    let near = largest / times * (1.0 + ROUNDING);
    let beyond: usize = medians.iter().map(|&away| usize::from(away > near)).sum();
    2 * beyond <= values.len() + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;

    fn signs(values: &[f64]) -> SampleSigns {
        SampleSigns::of(&vec![0.0; values.len()], values, 3, 12.0)
    }

    #[test]
    fn signs_are_those_that_they_say() {
        let mut source = Random::new(5);
        for n in [1, 2, 8, 9, 17, 100, 1003] {
            let values: Vec<f64> = (0..n).map(|_| source.normal()).collect();
            let steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
            let largest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
            let high = values.iter().copied().fold(f64::MIN, f64::max);
            let low = values.iter().copied().fold(f64::MAX, f64::min);
            let found = signs(&values);
            assert!(found.is_finite && !found.rests, "{n}");
            assert_eq!((found.range, found.largest_step), (high - low, largest(&steps)), "{n}");
            for place in 1..n {
                let mut held = values.clone();
                held[place] = held[place - 1];
                assert!(signs(&held).rests, "{n}, {place}");
                let mut spiked = values.clone();
                spiked[place] = 90.0;
                // The last sample goes on beyond its record.
                assert!(n < 100 || place + 4 > n || signs(&spiked).stands_out, "{n}, {place}");
                spiked[place] = f64::NAN;
                assert!(!signs(&spiked).is_finite, "{n}, {place}");
            }
            assert!(n < 100 || !found.stands_out, "{n}");
        }
        assert!(!SampleSigns::of(&[f64::INFINITY], &[1.0], 3, 12.0).is_finite);
        assert_eq!(signs(&[2.0; 9]).range, 0.0);
        assert!(signs(&[]).is_finite);
    }
}
