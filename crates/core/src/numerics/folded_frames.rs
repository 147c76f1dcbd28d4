//! Overlapped frames of channels, folded about their middles.
//! (Python side: `responses/windows/transform.py`)

use super::widest::widest;
use crate::error::CoreError;

/// Windows of a record.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Samples in a window, an even number.
    pub length: usize,
    /// Samples from the start of one window to that of the next.
    pub hop: usize,
    /// Numbers in a folded row: length / 2 + 1 at least, zeros behind them.
    pub width: usize,
}

/// Even and odd parts of the windows of channels of `n` samples each, by distance from the middle:
/// windows slowest and channels within each. Odd parts have the sign of `exp(−jωd)`.
///
/// # Errors
/// `CoreError::Shape` where channels are no whole number of `n` samples, a window has no middle or
/// a row no room for it.
pub fn folded_frames(
    samples: &[f64],
    n: usize,
    frames: Frames,
) -> Result<[Vec<f64>; 2], CoreError> {
    let Frames { length, hop, width } = frames;
    let (half, found) = (length / 2, samples.len());
    if n == 0 || !found.is_multiple_of(n) {
        return Err(CoreError::Shape { what: "samples of channels", found, needed: n });
    }
    if half == 0 || length != 2 * half || hop == 0 {
        return Err(CoreError::Shape {
            what: "samples of a window",
            found: length,
            needed: 2 * half,
        });
    }
    if width <= half {
        return Err(CoreError::Shape { what: "a folded row", found: width, needed: half + 1 });
    }
    let windows = if n < length { 0 } else { (n - length) / hop + 1 };
    let many = windows * (found / n) * width;
    let (mut even, mut odd) = (Vec::with_capacity(many), Vec::with_capacity(many));
    let (mut sums, mut differences) = (vec![0.0; width], vec![0.0; width]);
    for window in 0..windows {
        for channel in samples.chunks_exact(n) {
            let frame = &channel[window * hop..window * hop + length];
            widest(
                #[inline(always)]
                || fold(frame, &mut sums, &mut differences),
            );
            even.extend_from_slice(&sums);
            odd.extend_from_slice(&differences);
        }
    }
    Ok([even, odd])
}

/// Even part of a frame by distance from its middle, and its odd part turned round.
#[inline(always)]
fn fold(frame: &[f64], even: &mut [f64], odd: &mut [f64]) {
    let half = frame.len() / 2;
    let (left, right) = frame.split_at(half);
    // The window's first sample stands alone: its mirror image is the next window's first.
    (even[0], odd[0]) = (right[0], 0.0);
    (even[half], odd[half]) = (left[0], left[0]);
    let sides = left[1..].iter().rev().zip(&right[1..]);
    for ((e, o), (l, r)) in even[1..half].iter_mut().zip(&mut odd[1..half]).zip(sides) {
        (*e, *o) = (r + l, l - r);
    }
}

#[cfg(test)]
mod tests {
    use super::{Frames, folded_frames};

    #[test]
    fn parts_are_sums_and_differences_about_the_middle() {
        let x: Vec<f64> = (0..26).map(|k| f64::from((k * k + 7 * k) % 97)).collect();
        // Two channels of 13 samples: windows of 6 at 0, 2, 4 and 6.
        let frames = Frames { length: 6, hop: 2, width: 5 };
        let [even, odd] = folded_frames(&x, 13, frames).unwrap();
        assert_eq!((even.len(), odd.len()), (4 * 2 * 5, 4 * 2 * 5));
        for window in 0..4 {
            for channel in 0..2 {
                let frame = &x[13 * channel + 2 * window..];
                let at = 5 * (2 * window + channel);
                let sum = [frame[3], frame[4] + frame[2], frame[5] + frame[1], frame[0], 0.0];
                let difference = [0.0, frame[2] - frame[4], frame[1] - frame[5], frame[0], 0.0];
                assert_eq!(even[at..at + 5], sum);
                assert_eq!(odd[at..at + 5], difference);
            }
        }
    }

    #[test]
    fn what_is_no_window_is_refused() {
        let asked =
            |n, length, hop, width| folded_frames(&[1.0; 8], n, Frames { length, hop, width });
        assert!(asked(3, 2, 1, 2).is_err());
        assert!(asked(0, 2, 1, 2).is_err());
        assert!(asked(4, 3, 1, 2).is_err());
        assert!(asked(4, 0, 1, 2).is_err());
        assert!(asked(4, 2, 0, 2).is_err());
        assert!(asked(4, 4, 1, 2).is_err());
        assert_eq!(asked(4, 6, 1, 4), Ok([vec![], vec![]]));
    }
}
