//! What a polynomial that is divided by remembers, and how its answer to a constant comes to rest.
//! (Python side: none)

use crate::black_box::digital_filter::divide;

/// Below this share of its largest value what a filter remembers is lost in rounding.
const FORGOTTEN: f64 = 1e-17;
/// Samples after which a memory is looked at first.
const SHORTEST: usize = 64;

/// A steady input of one through 1/C, and through it again.
pub struct Steady {
    /// Both answers while they move.
    pub answers: [Vec<f64>; 2],
    /// Where they come to rest.
    pub ends: [f64; 2],
    /// Samples after which 1/C² has forgotten a pulse.
    pub lasting: usize,
}

impl Steady {
    /// Of a polynomial that forgets within `limit` samples; `more` samples of its answers beyond.
    pub fn of(c: &[f64], limit: usize, more: usize) -> Option<Self> {
        let lasting = lasting(c, limit)?;
        let mut once = vec![1.0; lasting + more];
        divide(c, &mut once);
        let mut twice = once.clone();
        divide(c, &mut twice);
        let end = 1.0 / c.iter().sum::<f64>();
        Some(Self { answers: [once, twice], ends: [end, end * end], lasting })
    }
}

/// Samples after which 1/C² has forgotten a pulse, where those are at most `limit`.
fn lasting(c: &[f64], limit: usize) -> Option<usize> {
    let mut length = SHORTEST;
    loop {
        let mut pulse = vec![0.0; length];
        pulse[0] = 1.0;
        divide(c, &mut pulse);
        divide(c, &mut pulse);
        let largest = pulse.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let last = pulse.iter().rposition(|x| x.abs() > FORGOTTEN * largest)?;
        if 2 * last < length {
            return (last < limit).then_some(last + 1);
        }
        if length > 2 * limit {
            return None;
        }
        length *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_move_until_they_are_at_their_ends() {
        let steady = Steady::of(&[1.0, -0.5], 200, 3).unwrap();
        assert_eq!(steady.answers[0][..3], [1.0, 1.5, 1.75]);
        assert_eq!(steady.answers[1][..3], [1.0, 2.0, 2.75]);
        assert_eq!(steady.ends, [2.0, 4.0]);
        for (answer, end) in steady.answers.iter().zip(steady.ends) {
            assert_eq!(answer.len(), steady.lasting + 3);
            assert!((answer[steady.lasting - 1] / end - 1.0).abs() < 1e-14);
        }
        // (k + 1) 0.5^k falls below 1e-17 after 62 samples.
        assert_eq!(steady.lasting, 63);
        assert!(
            Steady::of(&[1.0, -0.5], 62, 3).is_none() && Steady::of(&[1.0, -1.0], 500, 0).is_none()
        );
    }
}
