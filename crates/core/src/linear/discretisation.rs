//! Exact hold discretisation of a linear system with input delays, and its derivatives.
//! (Python side: simulation/simulate.py)
//!
//! ẋ = A x + B u(t − τ), y = C x + D u(t − τ), one delay for each input, sampled at t = k T. Between
//! samples the input is constant (zero-order hold) or linear (first-order hold), and a delay that is
//! no multiple of T moves the corners of that input between the samples. Each step is cut at the
//! corner and both pieces are integrated without approximation (Franklin, Powell & Workman, *Digital
//! Control of Dynamic Systems*, 3rd ed., sections 4.3.3 and 6.3). A smooth input has no corners: it is
//! taken as straight lines between points of a finer grid (`smooth_input.rs`). Neighbouring samples
//! act on a step; each is a tap with its weights.

use crate::error::CoreError;
use crate::linear::hold_integrals::{HoldIntegrals, Jet, add_product};
use crate::linear::smooth_input::{FINER, REACH, corner, interpolation};

/// What an input does between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// Constant until the next sample.
    Zero,
    /// Linear to the next sample.
    First,
    /// Smooth, without power above half the sampling rate.
    BandLimited,
}

/// Continuous state space, row-major, with one delay (s) for each input.
#[derive(Debug, Clone, Copy)]
pub struct StateSpace<'a> {
    /// n × n.
    pub a: &'a [f64],
    /// n × m.
    pub b: &'a [f64],
    /// p × n.
    pub c: &'a [f64],
    /// p × m.
    pub d: &'a [f64],
    /// m delays, s.
    pub delays_s: &'a [f64],
    /// Number of outputs p.
    pub n_outputs: usize,
}

/// One sample of one input in one step: x⁺ += state · u, y += output · u with u = input[k + ahead].
#[derive(Debug, Clone, PartialEq)]
pub struct Tap {
    /// Column of the input.
    pub input: usize,
    /// Samples ahead of the step's first; negative for the past.
    pub ahead: isize,
    /// n weights.
    pub state: Vec<f64>,
    /// p weights.
    pub output: Vec<f64>,
}

/// A system in discrete time: x⁺ = Φ x + Σ taps, y = C x + Σ taps.
#[derive(Debug, Clone)]
pub struct Sampled {
    /// Φ, n × n.
    pub transition: Vec<f64>,
    /// Samples of inputs that act on a step, input by input.
    pub taps: Vec<Tap>,
}

/// Derivatives of a `Sampled` by one direction, in its shape.
pub type SampledSlope = Sampled;

/// Matrix of one tap before it meets the input's column, with its derivative by the delay.
struct Weight {
    ahead: isize,
    state: Jet,
    state_by_delay: Vec<f64>,
    value: f64,
    value_by_delay: f64,
}

/// Discretise a system and its derivatives by some directions, at a sample time in seconds.
///
/// # Errors
/// `Shape` where matrices disagree, `Range` for a sample time or delay without meaning, `NotFinite`
/// where an entry or an exponential is not finite.
pub fn discretise(
    system: &StateSpace<'_>,
    slopes: &[StateSpace<'_>],
    sample_s: f64,
    hold: Hold,
) -> Result<(Sampled, Vec<SampledSlope>), CoreError> {
    discretise_each(system, slopes, sample_s, &vec![hold; system.delays_s.len()])
}

/// As `discretise`, with what each input does between samples.
///
/// # Errors
/// As `discretise`, and `Shape` where there is not one hold for each input.
pub fn discretise_each(
    system: &StateSpace<'_>,
    slopes: &[StateSpace<'_>],
    sample_s: f64,
    holds: &[Hold],
) -> Result<(Sampled, Vec<SampledSlope>), CoreError> {
    let (n, m, p) = check(system, sample_s)?;
    require("holds of the inputs", holds.len(), m)?;
    for slope in slopes {
        check_sizes(slope, n, m, p)?;
    }
    let a = Jet { value: system.a.to_vec(), slopes: slopes.iter().map(|s| s.a.to_vec()).collect() };
    let whole = HoldIntegrals::new(&a, n, sample_s)?;
    let mut found = Sampled { transition: whole.transition.value.clone(), taps: Vec::new() };
    let mut derived: Vec<_> = (whole.transition.slopes.iter())
        .map(|slope| Sampled { transition: slope.clone(), taps: Vec::new() })
        .collect();
    let mut known: Vec<((f64, Hold), Vec<Weight>)> = Vec::new();
    for (input, &hold) in holds.iter().enumerate() {
        let delay = system.delays_s[input];
        let key = (delay, hold);
        // Inputs of one delay and hold share their matrices.
        if !known.iter().any(|(each, _)| *each == key) {
            known.push((key, weights(&a, &whole, n, sample_s, delay, hold)?));
        }
        let Some((_, weights)) = known.iter().find(|(each, _)| *each == key) else { continue };
        for weight in weights {
            found.taps.push(weight.tap(system, input, n, p));
            for (k, (slope, into)) in slopes.iter().zip(&mut derived).enumerate() {
                into.taps.push(weight.slope(system, slope, k, input, n, p));
            }
        }
    }
    Ok((found, derived))
}

impl Weight {
    fn tap(&self, system: &StateSpace<'_>, input: usize, n: usize, p: usize) -> Tap {
        let m = system.delays_s.len();
        let mut state = vec![0.0; n];
        add_times(&mut state, &self.state.value, |i| system.b[i * m + input]);
        let output = (0..p).map(|o| self.value * system.d[o * m + input]).collect();
        Tap { input, ahead: self.ahead, state, output }
    }

    fn slope(
        &self,
        system: &StateSpace<'_>,
        slope: &StateSpace<'_>,
        direction: usize,
        input: usize,
        n: usize,
        p: usize,
    ) -> Tap {
        let m = system.delays_s.len();
        let later = slope.delays_s[input];
        let mut state = vec![0.0; n];
        add_times(&mut state, &self.state.value, |i| slope.b[i * m + input]);
        add_times(&mut state, &self.state.slopes[direction], |i| system.b[i * m + input]);
        if later != 0.0 {
            add_times(&mut state, &self.state_by_delay, |i| later * system.b[i * m + input]);
        }
        let output = (0..p)
            .map(|o| {
                self.value * slope.d[o * m + input]
                    + self.value_by_delay * later * system.d[o * m + input]
            })
            .collect();
        Tap { input, ahead: self.ahead, state, output }
    }
}

fn add_times(result: &mut [f64], matrix: &[f64], vector: impl Fn(usize) -> f64) {
    let n = result.len();
    for (i, entry) in result.iter_mut().enumerate() {
        *entry += (0..n).map(|j| matrix[i * n + j] * vector(j)).sum::<f64>();
    }
}

fn sum(n: usize, directions: usize, parts: &[(f64, &Jet)]) -> Jet {
    let mut result = Jet { value: vec![0.0; n * n], slopes: vec![vec![0.0; n * n]; directions] };
    parts.iter().for_each(|&(factor, part)| result.add(factor, part));
    result
}

/// Whole samples in a delay, and the fraction of a sample that is left.
pub fn split_delay(delay_s: f64, sample_s: f64) -> (usize, f64) {
    let in_samples = delay_s / sample_s;
    // A delay that is a whole number of samples but for rounding must not make an empty piece.
    let nearest = in_samples.round();
    let in_samples = if (in_samples - nearest).abs() < 1e-9 { nearest } else { in_samples };
    (in_samples.floor() as usize, in_samples - in_samples.floor())
}

fn weights(
    a: &Jet,
    whole: &HoldIntegrals,
    n: usize,
    sample_s: f64,
    delay_s: f64,
    hold: Hold,
) -> Result<Vec<Weight>, CoreError> {
    let (lag, f) = split_delay(delay_s, sample_s);
    if hold == Hold::BandLimited {
        return smooth_weights(a, n, sample_s, lag as isize, f);
    }
    let early = HoldIntegrals::new(a, n, f * sample_s)?;
    let split;
    let late = if f == 0.0 {
        whole
    } else {
        split = HoldIntegrals::new(a, n, (1.0 - f) * sample_s)?;
        &split
    };
    let count = a.slopes.len();
    let before = late.transition.product(1.0, &early.constant, n);
    let before_ramp = late.transition.product(1.0, &early.ramp, n);
    let (d_before, d_ramp) = by_delay(a, &early, late, n);
    let (late_1, late_2) = (&late.constant, &late.ramp);
    let (d_late_1, d_late_2) = (&late.transition.value, &late.constant.value);
    let s = 1.0 / sample_s;
    let first = -(lag as isize) - 1;
    let mut found = match hold {
        Hold::BandLimited => Vec::new(),
        Hold::Zero => {
            let (past, now) = if f > 0.0 { (1.0, 0.0) } else { (0.0, 1.0) };
            vec![
                weight(first, before, d_before, past, 0.0),
                weight(first + 1, late_1.clone(), combine(&[(-1.0, d_late_1)]), now, 0.0),
            ]
        }
        Hold::First => vec![
            weight(
                first,
                sum(n, count, &[(f, &before), (-s, &before_ramp)]),
                combine(&[(f, &d_before), (s, &before.value), (-s, &d_ramp)]),
                f,
                s,
            ),
            weight(
                first + 1,
                sum(
                    n,
                    count,
                    &[(1.0 - f, &before), (s, &before_ramp), (1.0, late_1), (-s, late_2)],
                ),
                combine(&[
                    (1.0 - f, &d_before),
                    (-s, &before.value),
                    (s, &d_ramp),
                    (-1.0, d_late_1),
                    (s, d_late_2),
                ]),
                1.0 - f,
                -s,
            ),
            weight(first + 2, sum(n, count, &[(s, late_2)]), combine(&[(-s, d_late_2)]), 0.0, 0.0),
        ],
    };
    if f == 0.0 && count == 0 {
        // Without a delay between samples the past sample has no weight; its derivative has one.
        found.remove(0);
    }
    Ok(found)
}

/// Taps of a smooth input: straight lines between `FINER` points of the interval, whose weights on
/// the end of the interval are shared out to the samples that make the points.
fn smooth_weights(
    a: &Jet,
    n: usize,
    sample_s: f64,
    lag: isize,
    f: f64,
) -> Result<Vec<Weight>, CoreError> {
    let parts = FINER as f64;
    let step = sample_s / parts;
    let fine = HoldIntegrals::new(a, n, step)?;
    let count = a.slopes.len();
    let at_end = sum(n, count, &[(1.0 / step, &fine.ramp)]);
    let at_start = sum(n, count, &[(1.0, &fine.constant), (-1.0, &at_end)]);
    // From the last point to the first: each step back is one more transition.
    let mut points = vec![at_end.clone()];
    let (mut start, mut end) = (at_start, at_end);
    for _ in 1..FINER {
        end = fine.transition.product(1.0, &end, n);
        points.push(sum(n, count, &[(1.0, &start), (1.0, &end)]));
        start = fine.transition.product(1.0, &start, n);
    }
    points.push(start);
    points.reverse();
    let shares: Vec<_> = (0..=FINER).map(|j| corner(j as f64 / parts - f, parts)).collect();
    let samples = interpolation(-f);
    let taps = samples.iter().enumerate().map(|(k, &(value, slope))| {
        let each: Vec<_> = shares.iter().map(|share| share[k]).collect();
        let terms: Vec<_> = each.iter().zip(&points).map(|(w, point)| (w.0, point)).collect();
        let moved: Vec<_> =
            each.iter().zip(&points).map(|(w, point)| (-w.1 / sample_s, &point.value)).collect();
        let ahead = k as isize - REACH - lag;
        weight(ahead, sum(n, count, &terms), combine(&moved), value, -slope / sample_s)
    });
    Ok(taps.collect())
}

/// Derivatives by the delay of what the early piece leaves after the late one: the early piece
/// grows and the late one shrinks.
fn by_delay(
    a: &Jet,
    early: &HoldIntegrals,
    late: &HoldIntegrals,
    n: usize,
) -> (Vec<f64>, Vec<f64>) {
    let product = |x: &[f64], y: &[f64]| {
        let mut result = vec![0.0; n * n];
        add_product(&mut result, 1.0, x, y, n);
        result
    };
    let shrink = product(&a.value, &late.transition.value);
    let before = combine(&[
        (-1.0, &product(&shrink, &early.constant.value)),
        (1.0, &product(&late.transition.value, &early.transition.value)),
    ]);
    let ramp = combine(&[
        (-1.0, &product(&shrink, &early.ramp.value)),
        (1.0, &product(&late.transition.value, &early.constant.value)),
    ]);
    (before, ramp)
}

fn weight(ahead: isize, state: Jet, by_delay: Vec<f64>, value: f64, slope: f64) -> Weight {
    Weight { ahead, state, state_by_delay: by_delay, value, value_by_delay: slope }
}

fn combine(parts: &[(f64, &Vec<f64>)]) -> Vec<f64> {
    let mut result = vec![0.0; parts.first().map_or(0, |(_, part)| part.len())];
    for &(factor, part) in parts {
        for (entry, value) in result.iter_mut().zip(part) {
            *entry += factor * value;
        }
    }
    result
}

fn require(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

fn check_sizes(system: &StateSpace<'_>, n: usize, m: usize, p: usize) -> Result<(), CoreError> {
    require("matrix A", system.a.len(), n * n)?;
    require("matrix B", system.b.len(), n * m)?;
    require("matrix C", system.c.len(), p * n)?;
    require("matrix D", system.d.len(), p * m)?;
    require("input delays", system.delays_s.len(), m)
}

fn check(system: &StateSpace<'_>, sample_s: f64) -> Result<(usize, usize, usize), CoreError> {
    let n = system.a.len().isqrt();
    let (m, p) = (system.delays_s.len(), system.n_outputs);
    check_sizes(system, n, m, p)?;
    if !(sample_s > 0.0 && sample_s.is_finite()) {
        return Err(CoreError::Range {
            what: "sample time",
            found: sample_s,
            needed: "positive seconds",
        });
    }
    if let Some(&found) = system.delays_s.iter().find(|&&d| !(d >= 0.0 && d / sample_s < 1e9)) {
        return Err(CoreError::Range {
            what: "input delay",
            found,
            needed: "zero or positive seconds",
        });
    }
    Ok((n, m, p))
}
