//! One frame at a time, folded about its middle and halved again and again. (Python side: none)

use super::half_band::{HalfBand, Scratch};

/// Windows of a record.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Samples in a window, an even number.
    pub length: usize,
    /// Samples from the start of one window to that of the next.
    pub hop: usize,
}

/// Consecutive windows of one record.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Channels of `n` samples each.
    pub samples: &'a [f64],
    /// Samples of a channel.
    pub n: usize,
    /// Channels at samples of even and of odd number, halved: those that middles of windows have.
    pub halves: [&'a [f64]; 2],
    /// Number of the first window.
    pub first: usize,
    /// Windows.
    pub count: usize,
}

/// Which samples rows hold.
#[derive(Clone, Copy, Debug)]
pub struct Ladder<'a> {
    /// By what records were halved whose rows begin with every second sample.
    pub begun: Option<&'a HalfBand>,
    /// By what each further row is halved.
    pub step: &'a HalfBand,
    /// Rows of a frame, each of half as many samples as the one before.
    pub levels: usize,
}

impl Ladder<'_> {
    /// Numbers in each row of frames with so many samples.
    #[must_use]
    pub fn widths(&self, length: usize) -> Vec<usize> {
        let half = length / 2;
        let mut width = half + 1;
        if let Some(band) = self.begun {
            width = (half + band.reach()) / 2 + 1;
        }
        let further = |width: &usize| Some(self.step.halved_width(*width));
        std::iter::successors(Some(width), further).take(self.levels).collect()
    }
}

/// What one frame after another is made in.
pub(crate) struct RowMaker<'a> {
    frames: Frames,
    ladder: Ladder<'a>,
    widths: Vec<usize>,
    /// A frame at every second sample, with what it sends beyond its ends.
    whole: Vec<f64>,
    edge: Edge,
    scratch: Scratch,
}

impl<'a> RowMaker<'a> {
    pub(crate) fn new(frames: Frames, ladder: Ladder<'a>) -> Self {
        let widths = ladder.widths(frames.length);
        Self {
            frames,
            ladder,
            whole: vec![0.0; 2 * widths[0] - 1],
            widths,
            edge: Edge::of(ladder.begun),
            scratch: Scratch::default(),
        }
    }

    /// Write the rows of one window of one channel in their places, by level.
    #[inline(always)]
    pub(crate) fn push(
        &mut self,
        piece: &Piece<'_>,
        [channel, window, row]: [usize; 3],
        found: &mut [[&mut [f64]; 2]],
    ) {
        let samples = &piece.samples[channel * piece.n..][..piece.n];
        let start = window * self.frames.hop;
        let mut width = self.widths[0];
        let span = row * width..(row + 1) * width;
        let Some(([even, odd], _)) = found.split_first_mut() else { return };
        let sides = [&mut even[span.clone()], &mut odd[span]];
        match self.ladder.begun {
            None => fold(&samples[start..start + self.frames.length], sides),
            Some(band) => {
                let parity = (start + self.frames.length / 2) % 2;
                let places = (piece.n + 1 - parity) / 2;
                let half = &piece.halves[parity][channel * places..][..places];
                self.gather(samples, half, start, band);
                fold_whole(&self.whole, sides);
            }
        }
        for level in 1..found.len() {
            let (before, after) = found.split_at_mut(level);
            let next = self.widths[level];
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let from = &before[level - 1][side][row * width..][..width];
                let to = &mut after[0][side][row * next..][..next];
                self.ladder.step.halve_row(from, sign, &mut self.scratch, to);
            }
            width = next;
        }
    }

    /// A window at every second sample: the record's, less what samples outside the window sent
    /// inside, and beyond both ends what those inside send there.
    #[inline(always)]
    fn gather(&mut self, samples: &[f64], half: &[f64], start: usize, band: &HalfBand) {
        let (length, parity) = (self.frames.length, self.frames.length / 2 % 2);
        let (whole, edge) = (&mut self.whole, &mut self.edge);
        let (count, first) = (whole.len(), start + parity);
        // Places inside: `start` + parity and every second one from there.
        let inside = (length - parity).div_ceil(2);
        let head = count / 2 - (length / 2 - parity) / 2;
        let tail = head + inside;
        whole[head..tail].copy_from_slice(&half[first / 2..first / 2 + inside]);
        edge.sums(samples, start, parity, band);
        whole[..head].fill(0.0);
        let beyond = whole[..head].iter_mut().rev();
        beyond.zip(&edge.right).for_each(|(to, from)| *to = *from);
        whole[head..tail].iter_mut().zip(&edge.left).for_each(|(to, from)| *to -= from);
        edge.sums(samples, start + length, parity, band);
        whole[tail..].fill(0.0);
        whole[tail..].iter_mut().zip(&edge.left).for_each(|(to, from)| *to = *from);
        let within = whole[head..tail].iter_mut().rev();
        within.zip(&edge.right).for_each(|(to, from)| *to -= from);
    }
}

/// What samples on both sides of an edge send across it.
struct Edge {
    near: Vec<f64>,
    /// From the left onto places from the edge on.
    left: Vec<f64>,
    /// From the right onto places before the edge, the nearest first.
    right: Vec<f64>,
}

impl Edge {
    fn of(band: Option<&HalfBand>) -> Self {
        let room = vec![0.0; band.map_or(0, HalfBand::across_width)];
        Self { near: room.clone(), left: room.clone(), right: room }
    }

    /// Of an edge before sample `at`, onto places at an even or odd distance from it.
    #[inline(always)]
    fn sums(&mut self, samples: &[f64], at: usize, parity: usize, band: &HalfBand) {
        self.near.fill(0.0);
        let before = samples[..at.saturating_sub(parity)].rchunks(2);
        for (to, pair) in self.near.iter_mut().zip(before) {
            *to = pair[pair.len() - 1];
        }
        band.across(&self.near, parity, &mut self.left);
        self.near.fill(0.0);
        let after = samples[samples.len().min(at + 1 - parity)..].chunks(2);
        for (to, pair) in self.near.iter_mut().zip(after) {
            *to = pair[0];
        }
        band.across(&self.near, 1 - parity, &mut self.right);
    }
}

/// Even and odd part of a frame about its middle.
#[inline(always)]
fn fold(frame: &[f64], [even, odd]: [&mut [f64]; 2]) {
    let half = frame.len() / 2;
    let (left, right) = frame.split_at(half);
    // The window's first sample stands alone: its mirror image is the next window's first.
    (even[0], odd[0]) = (2.0 * right[0], 0.0);
    (even[half], odd[half]) = (left[0], left[0]);
    meet(&left[1..], &right[1..], [&mut even[1..half], &mut odd[1..half]]);
}

/// The same of an odd number of places.
#[inline(always)]
fn fold_whole(whole: &[f64], [even, odd]: [&mut [f64]; 2]) {
    let middle = whole.len() / 2;
    (even[0], odd[0]) = (2.0 * whole[middle], 0.0);
    meet(&whole[..middle], &whole[middle + 1..], [&mut even[1..], &mut odd[1..]]);
}

/// Sums and differences of what lies left and right of a middle.
#[inline(always)]
fn meet(left: &[f64], right: &[f64], [even, odd]: [&mut [f64]; 2]) {
    for ((e, o), (l, r)) in even.iter_mut().zip(odd).zip(left.iter().rev().zip(right)) {
        (*e, *o) = (r + l, l - r);
    }
}
