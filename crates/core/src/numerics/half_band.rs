//! Half as many samples of sinusoids slow enough for them, by a half-band kernel.
//! (Python side: `responses/windows/halving.py`)

use super::widest::widest;

/// Places that are summed side by side.
const LANES: usize = 32;
/// Sums across an edge that are summed side by side.
const FEW: usize = 16;

/// A kernel by which sinusoids at odd places follow from those at even ones: weight k is that of the
/// neighbours at a distance of 2k + 1 on both sides. Weighing samples at odd places onto even ones
/// with it leaves the products of a row with such sinusoids as they were.
#[derive(Clone, Debug)]
pub struct HalfBand {
    /// Weights, zeros behind them.
    padded: Vec<f64>,
    count: usize,
}

impl HalfBand {
    /// The kernel of some weights, nearest neighbours first.
    #[must_use]
    pub fn new(weights: &[f64]) -> Self {
        let mut padded = weights.to_vec();
        padded.resize(weights.len() + FEW + 1, 0.0);
        Self { padded, count: weights.len() }
    }

    /// Samples from a place to the farthest that reaches it.
    #[must_use]
    pub fn reach(&self) -> usize {
        (2 * self.count).saturating_sub(1)
    }

    /// Samples at places of one parity, those between weighed onto them; zeros beyond both ends.
    #[must_use]
    pub fn halved(&self, samples: &[f64], parity: usize) -> Vec<f64> {
        let mut scratch = Scratch::default();
        let count = (samples.len() + 1).saturating_sub(parity) / 2;
        let mut found = vec![0.0; count];
        widest(
            #[inline(always)]
            || {
                scratch.clear_from(0, count, self.count);
                let own = samples.get(parity..).unwrap_or_default().chunks(2);
                scratch.own.iter_mut().zip(own).for_each(|(to, pair)| *to = pair[0]);
                // The first place between lies behind the first of an even parity, ahead of an odd.
                let between = samples.get(1 - parity..).unwrap_or_default().chunks(2);
                let to = scratch.between.iter_mut().skip(self.count - parity);
                to.zip(between).for_each(|(to, pair)| *to = pair[0]);
                self.weigh(&scratch, &mut found);
            },
        );
        found
    }

    /// Places of a row of so many that is halved.
    #[must_use]
    pub fn halved_width(&self, width: usize) -> usize {
        (width - 1 + self.reach()) / 2 + 1
    }

    /// A row that is even (`sign` 1) or odd (−1) about its first place, at every second place.
    #[inline(always)]
    pub(crate) fn halve_row(
        &self,
        row: &[f64],
        sign: f64,
        scratch: &mut Scratch,
        found: &mut [f64],
    ) {
        let (pairs, rest) = row.as_chunks::<2>();
        scratch.clear_from(pairs.len(), found.len(), self.count);
        let (before, after) = scratch.between.split_at_mut(self.count);
        for ((pair, own), between) in pairs.iter().zip(&mut scratch.own).zip(after) {
            (*own, *between) = (pair[0], pair[1]);
        }
        if let (Some(last), Some(own)) = (rest.first(), scratch.own.get_mut(pairs.len())) {
            *own = *last;
        }
        for (between, k) in before.iter_mut().rev().zip(0..) {
            *between = pairs.get(k).map_or(0.0, |pair| sign * pair[1]);
        }
        self.weigh(scratch, found);
    }

    /// Places between weighed onto their neighbours.
    #[inline(always)]
    fn weigh(&self, scratch: &Scratch, found: &mut [f64]) {
        let (blocks, rest) = found.as_chunks_mut::<LANES>();
        let count = blocks.len();
        for (block, found) in blocks.iter_mut().enumerate() {
            *found = self.weigh_block(scratch, block);
        }
        // Sums that are cut to size would be kept in memory, so the last ones stand apart.
        if !rest.is_empty() {
            rest.copy_from_slice(&self.weigh_block(scratch, count)[..rest.len()]);
        }
    }

    /// A block of them.
    #[inline(always)]
    fn weigh_block(&self, scratch: &Scratch, block: usize) -> [f64; LANES] {
        let near = &scratch.between[block * LANES..][..LANES + 2 * self.count - 1];
        let mut sums = [0.0; LANES];
        sums.copy_from_slice(&scratch.own[block * LANES..][..LANES]);
        for (k, &weight) in self.padded[..self.count].iter().enumerate() {
            let (after, before) = (&near[self.count + k..], &near[self.count - 1 - k..]);
            let sides = after[..LANES].iter().zip(&before[..LANES]);
            for (sum, (a, b)) in sums.iter_mut().zip(sides) {
                *sum += weight * (a + b);
            }
        }
        sums
    }

    /// What samples on one side of an edge add to places on the other: the sum over j of the weight
    /// `i + j + skip` times `near[j]`, for all i.
    #[inline(always)]
    pub(crate) fn across(&self, near: &[f64], skip: usize, found: &mut [f64]) {
        for (block, found) in found.chunks_exact_mut(FEW).enumerate() {
            let mut sums = [0.0; FEW];
            let weights = self.padded.get(block * FEW + skip..).unwrap_or_default();
            for (weights, value) in weights.windows(FEW).zip(near) {
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += weight * value;
                }
            }
            found.copy_from_slice(&sums);
        }
    }

    /// Room for what `across` finds.
    #[must_use]
    pub(crate) fn across_width(&self) -> usize {
        self.count.next_multiple_of(FEW)
    }
}

/// Rows taken apart: whole blocks, zeros behind.
#[derive(Default)]
pub(crate) struct Scratch {
    own: Vec<f64>,
    between: Vec<f64>,
}

impl Scratch {
    /// Room for a row of so many places, zeros but for those that are about to be written.
    #[inline(always)]
    fn clear_from(&mut self, written: usize, width: usize, weights: usize) {
        let room = width.next_multiple_of(LANES);
        self.own.resize(room, 0.0);
        self.own[written.min(room)..].fill(0.0);
        self.between.resize(room + 2 * weights, 0.0);
        self.between[(weights + written).min(room + 2 * weights)..].fill(0.0);
    }
}
