//! How much whitened residuals look like disturbances of a model's states, frequency by frequency.
//! (Python side: identification/output_error/disturbed_states.py)
//!
//! A disturbance moves the outputs by w(ω) = P^-½ T diag(F(ω)) [C (jωI − A)⁻¹ b + d] m(ω): F whitens
//! each output, T takes them apart at one instant, P is the power that is left, m the memory of the
//! disturbance. Of v, the residuals treated alike, the score is v*(w w* − diag |w|²)v, summed.

use num_complex::Complex64;

use crate::error::CoreError;
use crate::linear::discretisation::StateSpace;
use crate::linear::linear_response::Eights;
use crate::numerics::complex_lanes::{LANES, Lanes};
use crate::numerics::widest::widest;

/// Halvings of an interval that holds an exponent.
const HALVINGS: usize = 25;
/// Steps of the exponent, over the largest one, that end its search.
const NEAR: f64 = 1e-10;

/// Whitened residuals of one record at its frequencies.
pub struct Residuals<'a> {
    /// Frequencies, rad/s.
    pub omega: &'a [f64],
    /// v, (n_outputs, n_omega).
    pub told: &'a [Complex64],
    /// P, (n_outputs, n_omega).
    pub power: &'a [f64],
    /// Taps of each output's filter, the newest first, (n_outputs, n_taps).
    pub filters: &'a [f64],
    /// T, (n_outputs, n_outputs).
    pub turned: &'a [f64],
    /// Sample time.
    pub step_s: f64,
}

/// Score of each disturbance with each memory, and the square of its spread by chance.
#[derive(Debug, Clone, PartialEq)]
pub struct Scores {
    /// Memory by memory, (n_memories, n_ways).
    pub score: Vec<f64>,
    /// The same of their variance.
    pub variance: Vec<f64>,
}

impl Residuals<'_> {
    /// # Errors
    /// `Shape` where the parts do not fit each other or the system.
    fn check(&self, system: &StateSpace<'_>, n_ways: usize) -> Result<(), CoreError> {
        let (p, n, n_omega) = (system.n_outputs, system.a.len().isqrt(), self.omega.len());
        for (what, found, needed) in [
            ("residuals of a disturbance", self.told.len(), p * n_omega),
            ("powers of residuals", self.power.len(), p * n_omega),
            ("turns of residuals", self.turned.len(), p * p),
            ("taps of filters", self.filters.len() % p.max(1), 0),
            ("entries of a disturbed system", system.a.len(), n * n),
            ("what disturbances push", system.b.len(), n * n_ways),
            ("what outputs see of states", system.c.len(), p * n),
            ("what outputs see of disturbances", system.d.len(), p * n_ways),
        ] {
            if found != needed {
                return Err(CoreError::Shape { what, found, needed });
            }
        }
        Ok(())
    }

    /// Eight frequencies from `first` on; the last is repeated where there are no more.
    fn frequencies(&self, first: usize) -> [f64; LANES] {
        let last = self.omega.len() - 1;
        std::array::from_fn(|lane| self.omega[(first + lane).min(last)])
    }

    /// Make w, but for the memory, of the responses of outputs, in place: (n_outputs, n_ways).
    #[inline(always)]
    fn whiten(&self, first: usize, n_ways: usize, moved: &[Lanes], weights: &mut [Lanes]) {
        let n_omega = self.omega.len();
        let p = self.told.len() / n_omega;
        let omega = self.frequencies(first);
        let mut turn = Lanes::ZERO;
        (0..LANES).for_each(|lane| turn.set(lane, Complex64::cis(-omega[lane] * self.step_s)));
        weights.fill(Lanes::ZERO);
        for (k, taps) in self.filters.chunks_exact(self.filters.len() / p).enumerate() {
            let mut through = Lanes::ZERO;
            for &tap in taps.iter().rev() {
                through = through.times(&turn);
                through.re.iter_mut().for_each(|part| *part += tap);
            }
            for (way, value) in moved[k * n_ways..(k + 1) * n_ways].iter().enumerate() {
                let value = value.times(&through);
                for output in 0..p {
                    let share = self.turned[output * p + k];
                    weights[output * n_ways + way].add_scaled(share, &value);
                }
            }
        }
        for (output, row) in weights.chunks_exact_mut(n_ways).enumerate() {
            let power = &self.power[output * n_omega..(output + 1) * n_omega];
            let scale: [f64; LANES] =
                std::array::from_fn(|k| 1.0 / power[(first + k).min(n_omega - 1)].sqrt());
            for value in row {
                for part in [&mut value.re, &mut value.im] {
                    part.iter_mut().zip(&scale).for_each(|(v, s)| *v *= s);
                }
            }
        }
    }

    /// Work on w, but for the memory, by eight frequencies: the first of them, and w.
    fn by_eights(
        &self,
        system: &StateSpace<'_>,
        n_ways: usize,
        mut work: impl FnMut(usize, &[Lanes]),
    ) -> Result<(), CoreError> {
        self.check(system, n_ways)?;
        let points: Vec<_> = self.omega.iter().map(|&w| Complex64::new(0.0, w)).collect();
        let eights = Eights::new(system, n_ways, &points);
        let mut moved = vec![Lanes::ZERO; system.n_outputs * n_ways];
        let mut weights = moved.clone();
        for first in (0..points.len()).step_by(LANES) {
            eights
                .around(first, &mut |output, way, value| moved[output * n_ways + way] = *value)?;
            widest(
                #[inline(always)]
                || self.whiten(first, n_ways, &moved, &mut weights),
            );
            work(first, &weights);
        }
        Ok(())
    }

    /// Scores of all disturbances, `b` of the system by column, with each of some memories (s).
    ///
    /// # Errors
    /// `Shape` where parts do not fit each other, `Singular` where a frequency is a mode's.
    pub fn scores(
        &self,
        system: &StateSpace<'_>,
        n_ways: usize,
        memories_s: &[f64],
    ) -> Result<Scores, CoreError> {
        let mut found = Scores {
            score: vec![0.0; memories_s.len() * n_ways],
            variance: vec![0.0; memories_s.len() * n_ways],
        };
        self.by_eights(system, n_ways, |first, weights| {
            widest(
                #[inline(always)]
                || self.add_scores(first, n_ways, memories_s, weights, &mut found),
            );
        })?;
        Ok(found)
    }

    #[inline(always)]
    fn add_scores(
        &self,
        first: usize,
        n_ways: usize,
        memories_s: &[f64],
        weights: &[Lanes],
        found: &mut Scores,
    ) {
        let n_omega = self.omega.len();
        let (omega, p) = (self.frequencies(first), weights.len() / n_ways);
        // Lanes beyond the last frequency are nobody's.
        let counts: [f64; LANES] =
            std::array::from_fn(|k| f64::from(u8::from(first + k < n_omega)));
        for way in 0..n_ways {
            let (mut met, mut alone) = (Lanes::ZERO, [0.0; LANES]);
            let (mut size, mut squares) = ([0.0; LANES], [0.0; LANES]);
            for output in 0..p {
                let w = &weights[output * n_ways + way];
                let told = &self.told[output * n_omega..(output + 1) * n_omega];
                for k in 0..LANES {
                    let v = told[(first + k).min(n_omega - 1)];
                    let own = w.re[k] * w.re[k] + w.im[k] * w.im[k];
                    met.re[k] += w.re[k] * v.re + w.im[k] * v.im;
                    met.im[k] += w.re[k] * v.im - w.im[k] * v.re;
                    alone[k] += own * (v.re * v.re + v.im * v.im);
                    size[k] += own;
                    squares[k] += own * own;
                }
            }
            for (place, memory_s) in memories_s.iter().enumerate() {
                let (mut score, mut variance) = (0.0, 0.0);
                for k in 0..LANES {
                    let share = counts[k] / (1.0 + (omega[k] * memory_s) * (omega[k] * memory_s));
                    let together = met.re[k] * met.re[k] + met.im[k] * met.im[k];
                    score += share * (together - alone[k]);
                    variance += share * share * (size[k] * size[k] - squares[k]);
                }
                found.score[place * n_ways + way] += score;
                found.variance[place * n_ways + way] += variance;
            }
        }
    }

    /// |w|² of all disturbances, each with a memory (s) of its own, (n_ways, n_outputs, n_omega).
    ///
    /// # Errors
    /// As `scores`; `Shape` for another number of memories.
    pub fn sizes(
        &self,
        system: &StateSpace<'_>,
        memories_s: &[f64],
    ) -> Result<Vec<f64>, CoreError> {
        let (n_ways, n_omega) = (memories_s.len(), self.omega.len());
        let mut found = vec![0.0; n_ways * system.n_outputs * n_omega];
        self.by_eights(system, n_ways, |first, weights| {
            let count = LANES.min(n_omega - first);
            for (place, w) in weights.iter().enumerate() {
                let (output, way) = (place / n_ways, place % n_ways);
                let at = (way * system.n_outputs + output) * n_omega + first;
                for (k, to) in found[at..at + count].iter_mut().enumerate() {
                    let late = self.omega[first + k] * memories_s[way];
                    *to = (w.re[k] * w.re[k] + w.im[k] * w.im[k]) / (1.0 + late * late);
                }
            }
        })?;
        Ok(found)
    }
}

/// Probability of so large a score, sizes |w|² (n_outputs, n_omega), by saddlepoint.
///
/// v*(w w* − diag |w|²)v of complex normal v has the logarithm of its moments
/// K(s) = −Σ ln(1 + s |w|²) − ln(1 − s Σ |w|²/(1 + s |w|²)).
///
/// Reference: Daniels (1987), International Statistical Review 55.
pub fn chance(score: f64, sizes: &[f64], n_outputs: usize) -> f64 {
    // Also where the score is no number.
    if score.is_nan() || score <= 0.0 || !sizes.iter().any(|&each| each > 0.0) {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, largest(sizes, n_outputs));
    let (end, mut tilt) = (high, 0.5 * high);
    let mut settled = None;
    for _ in 0..HALVINGS {
        let (slope, bend) = slope_and_bend(tilt, sizes, n_outputs);
        if slope <= score {
            low = tilt;
        } else {
            high = tilt;
        }
        // Newton's steps where they stay between what is known, as they do near the end.
        let step = if bend > 0.0 { (score - slope) / bend } else { f64::INFINITY };
        let inside = low < tilt + step && tilt + step < high;
        if inside && step.abs() <= NEAR * end {
            settled = Some(bend);
            break;
        }
        tilt = if inside { tilt + step } else { 0.5 * (low + high) };
    }
    let bend = settled.unwrap_or_else(|| slope_and_bend(tilt, sizes, n_outputs).1);
    let bound = (logarithm(tilt, sizes, n_outputs) - tilt * score).min(0.0).exp();
    let root = tilt * (2.0 * std::f64::consts::PI * bend).sqrt();
    // Where rounding makes the bend negative the bound stands.
    if root > 1.0 { bound / root } else { bound }
}

/// Slope and bend of K at an exponent, eight frequencies side by side.
fn slope_and_bend(tilt: f64, sizes: &[f64], n_outputs: usize) -> (f64, f64) {
    widest(
        #[inline(always)]
        || {
            let n_omega = sizes.len() / n_outputs;
            let (mut slopes, mut bends) = ([0.0; LANES], [0.0; LANES]);
            for begin in (0..n_omega).step_by(LANES) {
                let [mut first, mut second, mut square, mut cube] = [[0.0; LANES]; 4];
                for row in sizes.chunks_exact(n_omega) {
                    // Sizes of zero beyond the last frequency add nothing.
                    let mut here = [0.0; LANES];
                    let known = &row[begin..n_omega.min(begin + LANES)];
                    here[..known.len()].copy_from_slice(known);
                    for k in 0..LANES {
                        let near = 1.0 / (1.0 + tilt * here[k]);
                        let share = here[k] * near;
                        first[k] += share;
                        second[k] += share * near;
                        square[k] += share * share;
                        cube[k] += share * share * near;
                    }
                }
                for k in 0..LANES {
                    let inverse = 1.0 / (1.0 - tilt * first[k]);
                    let ratio = second[k] * inverse;
                    slopes[k] += ratio - first[k];
                    bends[k] += square[k] - 2.0 * cube[k] * inverse + ratio * ratio;
                }
            }
            (slopes.iter().sum(), bends.iter().sum())
        },
    )
}

/// K at an exponent.
fn logarithm(tilt: f64, sizes: &[f64], n_outputs: usize) -> f64 {
    let n_omega = sizes.len() / n_outputs;
    let one = |place: usize| {
        let (mut whole, mut first) = (1.0, 0.0);
        for size in sizes.iter().skip(place).step_by(n_omega) {
            whole *= 1.0 + tilt * size;
            first += size / (1.0 + tilt * size);
        }
        -(whole * (1.0 - tilt * first)).ln()
    };
    (0..n_omega).map(one).sum()
}

/// Exponent below which the moments of all frequencies are finite, by bisection.
fn largest(sizes: &[f64], n_outputs: usize) -> f64 {
    let n_omega = sizes.len() / n_outputs;
    let at = |place: usize| (0..n_outputs).map(move |output| sizes[output * n_omega + place]);
    let others = |place: usize| {
        let most = at(place).fold(0.0, f64::max);
        at(place).sum::<f64>() - most
    };
    let most = (0..n_omega).map(others).fold(0.0, f64::max);
    let is_finite = |place: usize, tried: f64| {
        tried * at(place).map(|size| size / (1.0 + tried * size)).sum::<f64>() < 1.0
    };
    let top = 1.0 / most.max(f64::MIN_POSITIVE);
    // The interval of the narrowest frequency so far: others are asked whether they are narrower.
    let mut bracket = (top * (1.0 - 0.5_f64.powi(HALVINGS as i32)), top);
    for place in 0..n_omega {
        if is_finite(place, bracket.1) {
            continue;
        }
        let (mut low, mut high) = (0.0, top);
        for _ in 0..HALVINGS {
            let tried = 0.5 * (low + high);
            if is_finite(place, tried) {
                low = tried;
            } else {
                high = tried;
            }
        }
        bracket = (low, high);
    }
    bracket.0
}

#[cfg(test)]
#[path = "tests/shown_disturbances.rs"]
mod tests;
