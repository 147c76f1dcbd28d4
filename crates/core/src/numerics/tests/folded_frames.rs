use super::folded_frames;
use crate::error::CoreError;
use crate::numerics::folded_rows::{Frames, Ladder, Piece};
use crate::numerics::half_band::HalfBand;

/// Rows of all windows of a piece.
fn folded(
    piece: Piece<'_>,
    frames: Frames,
    ladder: Ladder<'_>,
) -> Result<Vec<[Vec<f64>; 2]>, CoreError> {
    let rows = piece.count * piece.samples.len() / piece.n.max(1);
    let room = |width: &usize| [vec![f64::NAN; rows * width], vec![f64::NAN; rows * width]];
    let mut found: Vec<_> = ladder.widths(frames.length).iter().map(room).collect();
    let mut rows: Vec<_> = found.iter_mut().map(|[a, b]| [&mut a[..], &mut b[..]]).collect();
    folded_frames(&[piece], frames, ladder, &mut rows)?;
    Ok(found)
}

/// Samples that nothing repeats.
fn samples(count: u32) -> Vec<f64> {
    (0..count).map(|k| f64::from((k * k + 7 * k) % 97) - 48.0).collect()
}

#[test]
fn parts_are_sums_and_differences_about_the_middle() {
    let x = samples(26);
    // Two channels of 13 samples: windows of 6 at 0, 2, 4 and 6.
    let step = HalfBand::new(&[0.5]);
    let piece = Piece { samples: &x, n: 13, halves: [&[]; 2], first: 0, count: 4 };
    let ladder = Ladder { begun: None, step: &step, levels: 1 };
    let frames = Frames { length: 6, hop: 2 };
    let [[even, odd]] = &folded(piece, frames, ladder).unwrap()[..] else { panic!() };
    assert_eq!((even.len(), odd.len()), (4 * 2 * 4, 4 * 2 * 4));
    for window in 0..4 {
        for channel in 0..2 {
            let frame = &x[13 * channel + 2 * window..];
            let at = 4 * (2 * window + channel);
            let sum = [2.0 * frame[3], frame[4] + frame[2], frame[5] + frame[1], frame[0]];
            let difference = [0.0, frame[2] - frame[4], frame[1] - frame[5], frame[0]];
            assert_eq!(even[at..at + 4], sum);
            assert_eq!(odd[at..at + 4], difference);
        }
    }
}

/// A frame, zeros around it, at places `step` apart about its middle, by definition.
fn by_definition(frame: &[f64], taps: &[&[f64]], reach: i64) -> Vec<(f64, f64)> {
    let middle = frame.len() as i64 / 2;
    let at = |d: i64| frame.get(usize::try_from(d + middle).unwrap_or(usize::MAX)).copied();
    let mut row: Vec<f64> = (-reach..=reach).map(|d| at(d).unwrap_or(0.0)).collect();
    for &taps in taps {
        let centre = row.len() as i64 / 2;
        let value =
            |d: i64| usize::try_from(d + centre).ok().and_then(|at| row.get(at)).unwrap_or(&0.0);
        let found = (-centre..=centre).filter(|d| d % 2 == 0).map(|d| {
            let sides = taps.iter().zip((1..).step_by(2));
            value(d) + sides.map(|(tap, k)| tap * (value(d + k) + value(d - k))).sum::<f64>()
        });
        row = found.collect();
    }
    let centre = row.len() / 2;
    (0..=centre)
        .map(|d| (row[centre + d] + row[centre - d], row[centre - d] - row[centre + d]))
        .collect()
}

#[test]
fn halved_rows_are_those_of_the_window_alone() {
    let (wide, narrow) = ([0.6, -0.2, 0.1, -0.04, 0.02], [0.57, -0.1, 0.03]);
    let (begun, step) = (HalfBand::new(&wide), HalfBand::new(&narrow));
    let x = samples(2 * 83);
    // Even and odd halves of windows, and hops of both kinds.
    for (length, hop) in [(20, 10), (22, 11), (26, 13), (24, 7), (30, 6)] {
        for halved in [false, true] {
            let halves: Vec<Vec<f64>> = (0..2)
                .map(|parity| x.chunks(83).flat_map(|row| begun.halved(row, parity)).collect())
                .collect();
            let count = (83 - length) / hop;
            let piece =
                Piece { samples: &x, n: 83, halves: [&halves[0], &halves[1]], first: 1, count };
            let ladder = Ladder { begun: halved.then_some(&begun), step: &step, levels: 3 };
            let found = folded(piece, Frames { length, hop }, ladder).unwrap();
            let widths = ladder.widths(length);
            let all: [&[f64]; 3] = [&wide, &narrow, &narrow];
            for (level, [even, odd]) in found.iter().enumerate() {
                let taps = if halved { &all[..=level] } else { &all[1..=level] };
                for row in 0..2 * count {
                    let frame = &x[83 * (row % 2) + (1 + row / 2) * hop..][..length];
                    let known = by_definition(frame, taps, 128);
                    let width = widths[level];
                    let pairs = even[row * width..].iter().zip(&odd[row * width..]);
                    for (d, (e, o)) in pairs.take(width).enumerate() {
                        assert!((e - known[d].0).abs() < 1e-12, "{length} {hop} {level} {d}");
                        assert!((o - known[d].1).abs() < 1e-12, "{length} {hop} {level} {d}");
                    }
                    assert!(known[width..].iter().all(|each| *each == (0.0, 0.0)));
                }
            }
        }
    }
}

#[test]
fn what_is_no_window_is_refused() {
    let (begun, step) = (HalfBand::new(&[0.5, 0.1]), HalfBand::new(&[0.5]));
    let asked = |n, length, hop, count, levels, halved: bool| {
        let piece = Piece { samples: &[1.0; 8], n, halves: [&[]; 2], first: 0, count };
        let ladder = Ladder { begun: halved.then_some(&begun), step: &step, levels };
        folded(piece, Frames { length, hop }, ladder)
    };
    assert!(asked(3, 2, 1, 1, 1, false).is_err());
    assert!(asked(0, 2, 1, 1, 1, false).is_err());
    assert!(asked(4, 3, 1, 1, 1, false).is_err());
    assert!(asked(4, 0, 1, 1, 1, false).is_err());
    assert!(asked(4, 2, 0, 1, 1, false).is_err());
    assert!(asked(4, 4, 1, 2, 1, false).is_err());
    assert!(asked(4, 4, 1, 1, 0, false).is_err());
    assert!(asked(4, 4, 1, 1, 1, true).is_err());
    assert!(asked(8, 6, 1, 1, 1, true).is_err());
    assert_eq!(asked(4, 6, 1, 0, 1, false), Ok(vec![[vec![], vec![]]]));
    let piece = Piece { samples: &[1.0; 8], n: 8, halves: [&[]; 2], first: 0, count: 2 };
    let ladder = Ladder { begun: None, step: &step, levels: 1 };
    let (mut few, mut many) = ([0.0; 5], [0.0; 6]);
    let mut rows = [[&mut many[..], &mut few[..]]];
    assert!(folded_frames(&[piece], Frames { length: 4, hop: 4 }, ladder, &mut rows).is_err());
    assert!(folded_frames(&[piece], Frames { length: 4, hop: 4 }, ladder, &mut []).is_err());
}
