//! Overlapped frames of channels, folded about their middles, at all samples and at fewer of them.
//! (Python side: `responses/windows/transform.py`)

use super::folded_rows::{Frames, Ladder, Piece, RowMaker};
use super::half_band::HalfBand;
use super::widest::widest;
use crate::error::CoreError;

/// Even and odd parts of windows about their middles by level, x(d) + x(−d) and x(−d) − x(d) at
/// distances d of a level's step, into rows that are there: pieces slowest, then windows, and channels
/// within each. The even part of the middle itself is twice what it holds.
///
/// # Errors
/// `CoreError::Shape` where channels are no whole number of samples, a window has no middle or lies
/// outside its record, halves are not those of the samples, windows too short for them, or rows too few.
pub fn folded_frames(
    pieces: &[Piece<'_>],
    frames: Frames,
    ladder: Ladder<'_>,
    found: &mut [[&mut [f64]; 2]],
) -> Result<(), CoreError> {
    check(frames, ladder)?;
    let mut rows = 0;
    for piece in pieces {
        check_piece(piece, frames, ladder.begun.is_some())?;
        rows += piece.count * (piece.samples.len() / piece.n);
    }
    let widths = ladder.widths(frames.length);
    if found.len() != widths.len() {
        let (found, needed) = (found.len(), widths.len());
        return Err(CoreError::Shape { what: "levels of rows", found, needed });
    }
    for (found, width) in found.iter().zip(widths) {
        let (found, needed) = (found[0].len().min(found[1].len()), rows * width);
        if found < needed {
            return Err(CoreError::Shape { what: "rows of a level", found, needed });
        }
    }
    let mut maker = RowMaker::new(frames, ladder);
    let mut row = 0;
    for piece in pieces {
        for window in piece.first..piece.first + piece.count {
            for channel in 0..piece.samples.len() / piece.n {
                widest(
                    #[inline(always)]
                    || maker.push(piece, [channel, window, row], found),
                );
                row += 1;
            }
        }
    }
    Ok(())
}

fn check(frames: Frames, ladder: Ladder<'_>) -> Result<(), CoreError> {
    let Frames { length, hop } = frames;
    let half = length / 2;
    if half == 0 || length != 2 * half || hop == 0 {
        return Err(CoreError::Shape {
            what: "samples of a window",
            found: length,
            needed: 2 * half,
        });
    }
    let reach = ladder.begun.map_or(0, HalfBand::reach);
    if half < reach {
        return Err(CoreError::Shape { what: "half a window", found: half, needed: reach });
    }
    if ladder.levels == 0 {
        return Err(CoreError::Shape { what: "rows of a frame", found: 0, needed: 1 });
    }
    Ok(())
}

fn check_piece(piece: &Piece<'_>, frames: Frames, halved: bool) -> Result<(), CoreError> {
    let (n, found) = (piece.n, piece.samples.len());
    if n == 0 || !found.is_multiple_of(n) {
        return Err(CoreError::Shape { what: "samples of channels", found, needed: n });
    }
    if piece.count == 0 {
        return Ok(());
    }
    let needed = (piece.first + piece.count - 1) * frames.hop + frames.length;
    if n < needed {
        return Err(CoreError::Shape { what: "samples of windows", found: n, needed });
    }
    for (parity, half) in piece.halves.iter().enumerate() {
        let needed = (n + 1 - parity) / 2 * (found / n);
        let asked = (piece.first..piece.first + piece.count.min(2))
            .any(|window| (window * frames.hop + frames.length / 2) % 2 == parity);
        if halved && asked && half.len() != needed {
            return Err(CoreError::Shape { what: "halved samples", found: half.len(), needed });
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "tests/folded_frames.rs"]
mod tests;
