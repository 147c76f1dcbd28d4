//! A slow drift beside an autoregression, told apart by expectation and maximisation over a spectrum.
//! (Python side: uncertainty/slow_drift.py)
//!
//! Dempster, Laird & Rubin (1977), J. Royal Statistical Society B 39(1), section 2.

use crate::error::CoreError;
use crate::numerics::levinson;
use crate::numerics::widest::widest;

/// Bins that are worked on side by side.
const LANES: usize = 8;
/// Significands below two that are multiplied before a logarithm is taken of them.
const FACTORS: usize = 1000;

/// A periodogram, and what its bins are weighted by.
pub struct Spectrum<'a> {
    /// Power at the bins of a real transform, none negative.
    pub power: &'a [f64],
    /// Rows of the inverse of that transform, (n_lags, n_bins): the first holds the weights of bins.
    /// Empty where the transform is long: then they follow from `turns`, lag by lag.
    pub cosines: &'a [f64],
    /// One less the cosine of each bin's angle.
    pub turns: &'a [f64],
    /// Length of the transform.
    pub length: usize,
    /// Samples.
    pub n: usize,
}

/// Constants of the rounds.
#[derive(Debug, Clone, Copy)]
pub struct Rounds {
    /// Most of them.
    pub most: usize,
    /// Relative change of a drift's variance that ends them.
    pub settled: f64,
    /// Power of one line over the whole power that no sound model reaches.
    pub sharpest: f64,
    /// Of the mean power, to which power is raised where rounding decides.
    pub cut: f64,
}

/// An autoregression and the drift beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Autocovariances of the autoregression.
    pub lags: Vec<f64>,
    /// Its weights.
    pub weights: Vec<f64>,
    /// Variance of the drift.
    pub variance: f64,
}

impl Spectrum<'_> {
    /// Whether there is one of everything for each bin, and lags in the table for `count`.
    fn fits(&self, count: usize) -> bool {
        let n_bins = self.length / 2 + 1;
        count > 0
            && [self.power.len(), self.turns.len()] == [n_bins; 2]
            && (self.cosines.is_empty() || self.cosines.len() >= count * n_bins)
    }

    fn lags_of(&self, power: &[f64], count: usize) -> Vec<f64> {
        if self.cosines.is_empty() {
            return widest(
                #[inline(always)]
                || self.lags_by_turns(power, count),
            );
        }
        let rows = self.cosines.chunks_exact(self.power.len()).take(count);
        let Some(folded) = Folded::of(power, self.length) else {
            return rows.map(|row| self.along(row, power)).collect();
        };
        let lag = |(k, row): (usize, &[f64])| {
            let part = folded.of_lag(k);
            self.along(&row[..part.len()], part)
        };
        rows.enumerate().map(lag).collect()
    }

    fn along(&self, row: &[f64], power: &[f64]) -> f64 {
        widest(
            #[inline(always)]
            || product(row, power),
        )
    }

    /// The same without a table: cos kω = 2 cos ω cos (k − 1)ω − cos (k − 2)ω.
    #[inline(always)]
    fn lags_by_turns(&self, power: &[f64], count: usize) -> Vec<f64> {
        let mut sums = vec![[0.0; LANES]; count];
        for begin in (0..power.len()).step_by(LANES) {
            let taken = LANES.min(power.len() - begin);
            let [mut weighted, mut twice, mut now] = [[0.0; LANES]; 3];
            for k in 0..taken {
                weighted[k] = self.weight(begin + k) * power[begin + k];
                now[k] = 1.0 - self.turns[begin + k];
                twice[k] = 2.0 * now[k];
            }
            let mut before = [1.0; LANES];
            for sum in &mut sums {
                for k in 0..LANES {
                    sum[k] += weighted[k] * before[k];
                    (before[k], now[k]) = (now[k], twice[k] * now[k] - before[k]);
                }
            }
        }
        sums.iter().map(|sum| sum.iter().sum()).collect()
    }

    /// How often a bin stands in the whole transform, over its length.
    #[inline(always)]
    fn weight(&self, bin: usize) -> f64 {
        let ends = bin == 0 || 2 * bin == self.length;
        (if ends { 1.0 } else { 2.0 }) / self.length as f64
    }

    /// The autoregression of a power; its valleys are raised where its lags are no autocovariance.
    fn fitted(&self, power: &[f64], count: usize, cut: f64) -> (Vec<f64>, Vec<f64>) {
        let lags = self.lags_of(power, count);
        let (weights, sound) = levinson::weights(&lags, self.n as f64);
        if sound {
            return (lags, weights);
        }
        let mean = power.iter().map(|each| each.max(0.0)).sum::<f64>() / power.len() as f64;
        let raised: Vec<f64> = power.iter().map(|each| each.max(cut * mean)).collect();
        let lags = self.lags_of(&raised, count);
        let (weights, _) = levinson::weights(&lags, self.n as f64);
        (lags, weights)
    }

    /// Both parts after some rounds, or fewer where these change nothing any more; `corner` is one
    /// less the drift's pole, rad per sample.
    ///
    /// # Errors
    /// `Shape` where there is not one of everything for each bin.
    pub fn apart(&self, begun: Parts, corner: f64, rounds: Rounds) -> Result<Parts, CoreError> {
        let (n_bins, count) = (self.power.len(), begun.lags.len());
        if !self.fits(count) || begun.weights.len() >= count {
            let needed = self.length / 2 + 1;
            return Err(CoreError::Shape { what: "bins of a spectrum", found: n_bins, needed });
        }
        let shape = self.shape(corner);
        let mut parts = begun;
        let mut rest = vec![0.0; n_bins];
        for _ in 0..rounds.most {
            let level = Level::of(&parts, self.length, rounds.sharpest);
            let slow = widest(
                #[inline(always)]
                || self.share(&level, &shape, parts.variance, &mut rest),
            );
            (parts.lags, parts.weights) = self.fitted(&rest, count, rounds.cut);
            let before = parts.variance;
            parts.variance = slow;
            if (slow - before).abs() <= rounds.settled * before {
                break;
            }
        }
        Ok(parts)
    }

    /// Spectrum of a drift of unit variance.
    fn shape(&self, corner: f64) -> Vec<f64> {
        let pole = 1.0 - corner;
        let drive = 1.0 - pole * pole;
        let under = |turn: &f64| drive / (corner * corner + 2.0 * pole * turn);
        self.turns.iter().map(under).collect()
    }

    /// Twice Whittle's likelihood of two parts: −n times the mean of ln S + P / S.
    ///
    /// # Errors
    /// `Shape` where there is not one of everything for each bin.
    pub fn likelihood(&self, parts: &Parts, corner: f64, sharpest: f64) -> Result<f64, CoreError> {
        let (n_bins, needed) = (self.power.len(), self.length / 2 + 1);
        if !self.fits(parts.lags.len()) || parts.weights.len() >= parts.lags.len() {
            return Err(CoreError::Shape { what: "bins of a spectrum", found: n_bins, needed });
        }
        let level = Level::of(parts, self.length, sharpest);
        let mut whole = self.shape(corner);
        let sum = widest(
            #[inline(always)]
            || {
                for (own, turn) in whole.chunks_mut(LANES).zip(self.turns.chunks(LANES)) {
                    let mut turns = [0.0; LANES];
                    turns[..turn.len()].copy_from_slice(turn);
                    let other = level.at(&turns);
                    own.iter_mut().zip(other).for_each(|(s, o)| *s = o + parts.variance * *s);
                }
                logarithms(&whole) + ratios(self.power, &whole)
            },
        );
        Ok(-(self.n as f64) * sum / n_bins as f64)
    }

    /// What each part is expected to hold: the autoregression's power, and the drift's variance.
    #[inline(always)]
    fn share(&self, level: &Level<'_>, shape: &[f64], variance: f64, rest: &mut [f64]) -> f64 {
        let mut total = [0.0; LANES];
        let (powers, power) = self.power.as_chunks::<LANES>();
        let (turns, turn) = self.turns.as_chunks::<LANES>();
        let (shapes, shape) = shape.as_chunks::<LANES>();
        let (wholes, rest) = rest.as_chunks_mut::<LANES>();
        let mut begin = 0;
        for (((power, turn), shape), left) in powers.iter().zip(turns).zip(shapes).zip(wholes) {
            let own = shape.map(|each| variance * each);
            self.share_of(begin, level, (power, turn, &own), (left, &mut total));
            begin += LANES;
        }
        // Bins beyond the last one have no power and no drift.
        let filled = |part: &[f64]| std::array::from_fn(|k| part.get(k).copied().unwrap_or(0.0));
        let (power, turn, shape): ([f64; LANES], _, [f64; LANES]) =
            (filled(power), filled(turn), filled(shape));
        let (own, mut left) = (shape.map(|each| variance * each), [0.0; LANES]);
        self.share_of(begin, level, (&power, &turn, &own), (&mut left, &mut total));
        rest.copy_from_slice(&left[..rest.len()]);
        total.iter().sum()
    }

    /// The same of some bins side by side: power, one less the cosine, the drift's own.
    #[inline(always)]
    fn share_of(
        &self,
        begin: usize,
        level: &Level<'_>,
        (power, turn, own): (&[f64; LANES], &[f64; LANES], &[f64; LANES]),
        (left, total): (&mut [f64; LANES], &mut [f64; LANES]),
    ) {
        let other = level.at(turn);
        for k in 0..LANES {
            let share = own[k] / (other[k] + own[k]).max(f64::MIN_POSITIVE);
            let mixed = share * other[k];
            total[k] += self.weight(begin + k) * (share * share * power[k] + mixed);
            let beside = 1.0 - share;
            left[k] = beside * beside * power[k] + mixed;
        }
    }
}

/// A power whose bins meet those with the same cosine, but for its sign: cos k(π − ω) = ±cos kω.
struct Folded {
    /// Of lags that are multiples of four, of other even lags, and of odd ones.
    parts: [Vec<f64>; 3],
}

impl Folded {
    /// None where no bin stands at π.
    fn of(power: &[f64], length: usize) -> Option<Self> {
        let last = power.len() - 1;
        if length % 2 == 1 || last == 0 {
            return None;
        }
        let (mut sums, differences) = met(power);
        if last % 2 == 1 {
            return Some(Self { parts: [sums.clone(), sums, differences] });
        }
        // The middle bin had nothing to meet: the weights of lags count it twice, the first once.
        *sums.last_mut()? *= 2.0;
        let (fourth, other) = met(&sums);
        Some(Self { parts: [fourth, other, differences] })
    }

    /// What meets the first numbers of a lag's row.
    fn of_lag(&self, lag: usize) -> &[f64] {
        &self.parts[match lag % 4 {
            0 => 0,
            2 => 1,
            _ => 2,
        }]
    }
}

/// Sums and differences of the first bins with the last ones, backwards; the middle one stays.
fn met(power: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (middle, pairs) = (power.len() / 2, power.iter().zip(power.iter().rev()));
    let pairs = pairs.take(middle);
    let mut sums: Vec<f64> = pairs.clone().map(|(a, b)| a + b).collect();
    let mut differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
    if power.len() % 2 == 1 {
        sums.push(power[middle]);
        differences.push(0.0);
    }
    (sums, differences)
}

/// The spectrum of an autoregression: what its recursion does not foretell over |1 − Σ w zᵏ|².
struct Level<'a> {
    weights: &'a [f64],
    innovation: f64,
    /// Gain below which there is a pole that rounding puts onto the circle.
    least: f64,
}

impl<'a> Level<'a> {
    fn of(parts: &'a Parts, length: usize, sharpest: f64) -> Self {
        let told: f64 = parts.weights.iter().zip(&parts.lags[1..]).map(|(w, r)| w * r).sum();
        let innovation = (parts.lags[0] - told).max(0.0);
        let most = sharpest * length as f64 * parts.lags[0].max(f64::MIN_POSITIVE);
        Self {
            weights: &parts.weights,
            innovation,
            least: (innovation / most).max(f64::MIN_POSITIVE),
        }
    }

    /// By one less the cosine of each bin's angle.
    #[inline(always)]
    fn at(&self, turn: &[f64; LANES]) -> [f64; LANES] {
        if self.weights.is_empty() {
            return [self.innovation; LANES];
        }
        let cosine = turn.map(|t| 1.0 - t);
        let sine = turn.map(|t| (t * (2.0 - t)).max(0.0).sqrt());
        let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
        // Horner's scheme in z = exp(−jω) over 1, −w₁, −w₂ …
        for &weight in self.weights.iter().rev() {
            for k in 0..LANES {
                let (x, y) = (re[k] - weight, im[k]);
                re[k] = x * cosine[k] + y * sine[k];
                im[k] = y * cosine[k] - x * sine[k];
            }
        }
        std::array::from_fn(|k| {
            let real = 1.0 + re[k];
            self.innovation / (real * real + im[k] * im[k]).max(self.least)
        })
    }
}

/// Σ ln of positive numbers: of the product of their significands, and their exponents.
#[inline(always)]
fn logarithms(values: &[f64]) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    const ONE: u64 = 1023 << 52;
    let (mut sum, mut exponents, mut normal) = (0.0, [0_u64; LANES], true);
    for part in values.chunks(FACTORS * LANES) {
        let mut products = [1.0; LANES];
        let (chunks, rest) = part.as_chunks::<LANES>();
        for chunk in chunks {
            for k in 0..LANES {
                let bits = chunk[k].to_bits();
                normal &= bits.wrapping_sub(1 << 52) < EXPONENT - (1 << 52);
                exponents[k] += bits >> 52;
                products[k] *= f64::from_bits((bits & !EXPONENT) | ONE);
            }
        }
        sum += products.iter().chain(rest).map(|each| each.ln()).sum::<f64>();
    }
    if !normal {
        return values.iter().map(|each| each.ln()).sum();
    }
    let count = values.len() - values.len() % LANES;
    let turns = exponents.iter().sum::<u64>() as f64 - 1023.0 * count as f64;
    sum + turns * std::f64::consts::LN_2
}

/// Σ a / b.
#[inline(always)]
fn ratios(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (whole, more) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = whole.remainder().iter().zip(more.remainder()).map(|(x, y)| x / y).sum();
    for (x, y) in whole.zip(more) {
        for k in 0..LANES {
            sums[k] += x[k] / y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[inline(always)]
fn product(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 2 * LANES];
    let (whole, more) = (a.chunks_exact(2 * LANES), b.chunks_exact(2 * LANES));
    let rest: f64 = whole.remainder().iter().zip(more.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in whole.zip(more) {
        for k in 0..2 * LANES {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
#[path = "tests/slow_drift.rs"]
mod tests;
