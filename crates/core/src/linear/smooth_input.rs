//! Smooth (band-limited) inputs between their samples, by the polynomial through the eight nearest.
//! (Python side: record/hold.py)
//!
//! A run takes straight lines between points of a finer grid. A line of step h weakens ω by
//! sinc²(ωh/2) = 1 − (ωh)²/12 + …; a twelfth of the second difference gives that back.
//!
//! Reference: Meijering (2002), Proc. IEEE 90 (interpolation by polynomials and what it costs near
//! half the sampling rate); the error is below a hundredth up to two fifths of it.

/// Samples that one value takes.
pub const NODES: usize = 8;
/// Steps within a sample in which a linear model follows a smooth input.
pub const FINER: usize = 4;
/// Samples before and behind the interval that have weights, delays of part of a sample included.
pub const REACH: isize = 5;
/// Number of samples from `-REACH` to `REACH`.
pub const WIDTH: usize = 2 * REACH as usize + 1;

/// Weights of samples `-REACH..=REACH` about an interval, and their derivatives by the place.
pub type Weights = [(f64, f64); WIDTH];

/// Weights that give the signal at a place in samples, −2 to 2, past the interval's first sample.
pub fn interpolation(place: f64) -> Weights {
    let mut found = [(0.0, 0.0); WIDTH];
    let before = place.floor();
    let t = place - before;
    let first = before as isize - 3;
    for j in 0..NODES {
        let (mut product, mut slope) = (1.0, 0.0);
        for k in (0..NODES).filter(|&k| k != j) {
            let scale = 1.0 / (j as f64 - k as f64);
            let factor = (t - (k as f64 - 3.0)) * scale;
            slope = slope * factor + product * scale;
            product *= factor;
        }
        found[(first + j as isize + REACH) as usize] = (product, slope);
    }
    found
}

/// Weights of the point at `place` of a line of straight pieces, each 1/`parts` of a sample long.
pub fn corner(place: f64, parts: f64) -> Weights {
    let (fine, share) = (1.0 / FINER as f64, FINER as f64 / parts);
    let mut found = interpolation(place);
    let twelfth = share * share / 12.0;
    for (beside, weight) in [(place - fine, 1.0), (place, -2.0), (place + fine, 1.0)] {
        for (into, each) in found.iter_mut().zip(interpolation(beside)) {
            into.0 -= twelfth * weight * each.0;
            into.1 -= twelfth * weight * each.1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(place: f64, signal: impl Fn(f64) -> f64) -> (f64, f64) {
        let sum = |pick: fn(&(f64, f64)) -> f64| {
            let weights = interpolation(place);
            let each = weights.iter().enumerate();
            each.map(|(k, weight)| pick(weight) * signal(k as f64 - REACH as f64)).sum()
        };
        (sum(|w| w.0), sum(|w| w.1))
    }

    #[test]
    fn polynomials_and_their_slopes_are_exact() {
        for place in [-1.3, -0.25, 0.0, 0.4, 1.0, 1.25] {
            let (value, slope) = at(place, |t| 1.0 - t + 0.01 * t.powi(7));
            assert!((value - (1.0 - place + 0.01 * place.powi(7))).abs() < 1e-9);
            assert!((slope - (-1.0 + 0.07 * place.powi(6))).abs() < 1e-9);
        }
    }

    #[test]
    fn a_sine_below_two_fifths_of_half_the_rate_is_followed() {
        for place in [0.1, 0.5, 0.9] {
            let (value, _) = at(place, |t| (1.2 * t).sin());
            assert!((value - (1.2 * place).sin()).abs() < 6e-3);
        }
    }

    #[test]
    fn weights_of_a_corner_give_a_constant_back() {
        let sum: f64 = corner(-0.7, 4.0).iter().map(|w| w.0).sum();
        assert!((sum - 1.0).abs() < 1e-13);
    }
}
