//! Least squares of a rational response with transients over the Fourier bins of records.
//! (Python side: responses/errors/pilot_search.py)
//!
//! Columns are powers of numbers of unit modulus times a channel: products of two of them depend on
//! the difference of their powers alone, so that normal equations cost a few sums for each pair of
//! channels. One step of correction gives back the digits that normal equations lose.

use num_complex::Complex64;

use crate::error::CoreError;
use crate::frequency_domain::bin_chunks::{
    ABREAST, CHUNK, Chunk, LANES, Sums, add_products, apart,
};
use crate::frequency_domain::bordered_normal::{BorderedNormal, Record, Unknowns};
use crate::numerics::widest::widest;

/// Share of the unknowns that a correction may move; a larger one finds the equations unsound.
const MOST_MOVED: f64 = 1e-2;
/// Share that a solution may still be off.
const SETTLED: f64 = 1e-10;
const CORRECTIONS: usize = 3;

/// Fourier bins of the inputs of some records, and the turns whose powers make a basis.
#[derive(Debug, Clone)]
pub struct RationalBins {
    inputs: Vec<Complex64>,
    n_inputs: usize,
    turns: Vec<Complex64>,
    lengths: Vec<usize>,
    order: usize,
    n_own: usize,
}

/// What is fitted: an output, squares of weights, and the target pulled back by the weights.
#[derive(Debug, Clone, Copy)]
struct Wanted<'a> {
    output: &'a [Complex64],
    power: &'a [f64],
    pulled: &'a [Complex64],
}

impl RationalBins {
    /// Bins of all inputs (row after row), turns by bin, bins of each record, order, and terms of each
    /// record's transient.
    ///
    /// # Errors
    /// `Shape` where lengths do not fit.
    pub fn new(
        inputs: Vec<Complex64>,
        turns: Vec<Complex64>,
        lengths: Vec<usize>,
        order: usize,
        n_own: usize,
    ) -> Result<Self, CoreError> {
        let n = turns.len();
        let shape = |what, found, needed| Err(CoreError::Shape { what, found, needed });
        if n == 0 || !inputs.len().is_multiple_of(n) {
            return shape("bins of the inputs", inputs.len(), n);
        }
        let whole = lengths.iter().fold(0_usize, |sum, each| sum.saturating_add(*each));
        if whole != n {
            return shape("bins of the records", whole, n);
        }
        if !(order + 1..=n).contains(&n_own) {
            return shape("terms of a transient", n_own, order + 1);
        }
        let n_inputs = inputs.len() / n;
        Ok(Self { inputs, n_inputs, turns, lengths, order, n_own })
    }

    /// Number of bins.
    pub fn size(&self) -> usize {
        self.turns.len()
    }

    fn unknowns(&self) -> Unknowns {
        Unknowns { n_own: self.n_own, order: self.order, n_inputs: self.n_inputs }
    }

    /// Coefficients that come nearest: numerators, denominator but its first (which is one), and the
    /// transient of each record. None where columns are so alike that these equations cannot tell.
    ///
    /// By bin: the output that the denominator multiplies, squared moduli of the weights, and the
    /// target times the conjugate weights.
    ///
    /// # Errors
    /// `Shape` where lengths do not fit.
    ///
    /// Reference: Björck, "Stability analysis of the method of seminormal equations for linear least
    /// squares problems", *Linear Algebra and its Applications* 88/89 (1987): one correction.
    pub fn solve(
        &self,
        output: &[Complex64],
        power: &[f64],
        pulled: &[Complex64],
    ) -> Result<Option<Vec<f64>>, CoreError> {
        let needed = self.size();
        for found in [output.len(), power.len(), pulled.len()] {
            if found != needed {
                return Err(CoreError::Shape { what: "bins of the output", found, needed });
            }
        }
        let wanted = Wanted { output, power, pulled };
        let records = widest(
            #[inline(always)]
            || self.products(wanted),
        );
        let Some(normal) = BorderedNormal::of(self.unknowns(), &records) else { return Ok(None) };
        let right: Vec<&[f64]> = records.iter().map(|each| each.right.as_slice()).collect();
        let (mut solved, mut off) = (normal.solve(&right), 1.0);
        for turn in 0..CORRECTIONS {
            let left = widest(
                #[inline(always)]
                || self.pulled_rest(wanted, &solved),
            );
            let rows: Vec<&[f64]> = left.iter().map(Vec::as_slice).collect();
            let change = normal.solve(&rows);
            let moved = normal.size(&change) / normal.size(&solved).max(f64::MIN_POSITIVE);
            if turn == 0 && !moved.le(&MOST_MOVED) {
                return Ok(None);
            }
            for (value, more) in solved.iter_mut().zip(&change) {
                *value += more;
            }
            // A correction finds how far the one before was off, and leaves that share of it.
            if moved * moved / off < SETTLED {
                break;
            }
            off = moved;
        }
        Ok(Some(solved))
    }

    /// Numerators times inputs, and transients, at each bin: the response's output times its
    /// denominator.
    ///
    /// # Errors
    /// `Shape` where coefficients do not fit.
    pub fn numerator(&self, coefficients: &[f64]) -> Result<Vec<Complex64>, CoreError> {
        let needed = self.unknowns().all(self.lengths.len());
        if coefficients.len() != needed {
            let found = coefficients.len();
            return Err(CoreError::Shape { what: "coefficients", found, needed });
        }
        let nothing = vec![Complex64::default(); self.size()];
        let mut found = nothing.clone();
        widest(
            #[inline(always)]
            || {
                self.each_chunk(
                    &nothing,
                    #[inline(always)]
                    |record, chunk| {
                        let (re, im) = self.values(record, chunk, coefficients);
                        let places = found[chunk.from..chunk.from + chunk.count].iter_mut();
                        for ((place, re), im) in places.zip(re).zip(im) {
                            *place = Complex64::new(re, im);
                        }
                    },
                );
            },
        );
        Ok(found)
    }

    #[inline(always)]
    fn each_chunk(&self, output: &[Complex64], mut work: impl FnMut(usize, &Chunk)) {
        let rows = self.powers_of(0);
        let wide = || [vec![0.0; rows * CHUNK], vec![0.0; rows * CHUNK]];
        let sources = || vec![0.0; (self.n_inputs + 2) * CHUNK];
        let mut chunk =
            Chunk { from: 0, count: 0, powers: wide(), channels: [sources(), sources()] };
        let mut begin = 0;
        for (record, length) in self.lengths.iter().enumerate() {
            let end = begin + length;
            for from in (begin..end).step_by(CHUNK) {
                (chunk.from, chunk.count) = (from, CHUNK.min(end - from));
                self.fill(&mut chunk, output);
                work(record, &chunk);
            }
            begin = end;
        }
    }

    /// Powers of the turns; channels: one for transients, the inputs, the output turned about.
    #[inline(always)]
    fn fill(&self, chunk: &mut Chunk, output: &[Complex64]) {
        let (from, count, n) = (chunk.from, chunk.count, self.size());
        let [re, im] = &mut chunk.powers;
        re[..CHUNK].fill(1.0);
        im[..CHUNK].fill(0.0);
        let mut turns = [[0.0; CHUNK]; 2];
        for (k, turn) in self.turns[from..from + count].iter().enumerate() {
            (turns[0][k], turns[1][k]) = (turn.re, turn.im);
        }
        for row in 1..re.len() / CHUNK {
            let at = row * CHUNK;
            for k in 0..CHUNK {
                let (a, b) = (re[at - CHUNK + k], im[at - CHUNK + k]);
                re[at + k] = a * turns[0][k] - b * turns[1][k];
                im[at + k] = a * turns[1][k] + b * turns[0][k];
            }
        }
        let [re, im] = &mut chunk.channels;
        re.fill(0.0);
        im.fill(0.0);
        re[..count].fill(1.0);
        for channel in 0..self.n_inputs {
            let source = &self.inputs[channel * n + from..][..count];
            for (k, value) in source.iter().enumerate() {
                re[(channel + 1) * CHUNK + k] = value.re;
                im[(channel + 1) * CHUNK + k] = value.im;
            }
        }
        for (k, value) in output[from..from + count].iter().enumerate() {
            re[(self.n_inputs + 1) * CHUNK + k] = -value.re;
            im[(self.n_inputs + 1) * CHUNK + k] = -value.im;
        }
    }

    /// Powers of a channel's columns, and of differences to channels behind it: a transient has more.
    fn powers_of(&self, channel: usize) -> usize {
        let count = if channel == 0 { self.n_own } else { self.order + 1 };
        count.next_multiple_of(ABREAST)
    }

    /// Products of all pairs of columns, and of each with the target, by record.
    #[inline(always)]
    fn products(&self, wanted: Wanted<'_>) -> Vec<Record> {
        let (n_channels, rows) = (self.n_inputs + 2, self.powers_of(0));
        let n_pairs = n_channels * (n_channels + 1) / 2;
        let mut sums = vec![[0.0; LANES]; self.lengths.len() * (2 * n_pairs + n_channels) * rows];
        let size = (2 * n_pairs + n_channels) * rows;
        self.each_chunk(
            wanted.output,
            #[inline(always)]
            |record, chunk| {
                let (pairs, right) =
                    sums[record * size..(record + 1) * size].split_at_mut(2 * n_pairs * rows);
                let mut power = [0.0; CHUNK];
                power[..chunk.count]
                    .copy_from_slice(&wanted.power[chunk.from..chunk.from + chunk.count]);
                let mut places = pairs.chunks_exact_mut(2 * rows);
                for a in 0..n_channels {
                    for b in a..n_channels {
                        let Some(place) = places.next() else { continue };
                        let (re, im) = chunk.weighed_product(a, b, &power);
                        let (first, second) = place.split_at_mut(rows);
                        let apart = self.powers_of(a);
                        add_products(&re, &chunk.powers[0], &mut first[..apart]);
                        if a != b {
                            add_products(&im, &chunk.powers[1], &mut second[..apart]);
                        }
                    }
                }
                let pulled = apart(&wanted.pulled[chunk.from..chunk.from + chunk.count]);
                chunk.pull(&pulled, right, rows, self.powers_of(1));
            },
        );
        let whole =
            |part: &[Sums]| part.iter().map(|lanes| lanes.iter().sum()).collect::<Vec<f64>>();
        sums.chunks_exact(size)
            .map(|each| {
                let (pairs, right) = each.split_at(2 * n_pairs * rows);
                Record { pairs: whole(pairs), right: self.by_column(&whole(right)), rows }
            })
            .collect()
    }

    /// Products of the columns with what coefficients leave of the target, by record.
    #[inline(always)]
    fn pulled_rest(&self, wanted: Wanted<'_>, coefficients: &[f64]) -> Vec<Vec<f64>> {
        let rows = self.powers_of(0);
        let size = (self.n_inputs + 2) * rows;
        let mut sums = vec![[0.0; LANES]; self.lengths.len() * size];
        self.each_chunk(
            wanted.output,
            #[inline(always)]
            |record, chunk| {
                let (mut re, mut im) = self.values(record, chunk, coefficients);
                let span = chunk.from..chunk.from + chunk.count;
                let pulled = &wanted.pulled[span.clone()];
                for (k, (power, pulled)) in wanted.power[span].iter().zip(pulled).enumerate() {
                    re[k] = pulled.re - power * re[k];
                    im[k] = pulled.im - power * im[k];
                }
                re[chunk.count..].fill(0.0);
                im[chunk.count..].fill(0.0);
                let into = &mut sums[record * size..(record + 1) * size];
                chunk.pull(&[re, im], into, rows, self.powers_of(1));
            },
        );
        sums.chunks_exact(size)
            .map(|each| {
                let whole: Vec<f64> = each.iter().map(|lanes| lanes.iter().sum()).collect();
                self.by_column(&whole)
            })
            .collect()
    }

    /// Sums by channel and power as sums by column: of the transient, the inputs, the output.
    fn by_column(&self, sums: &[f64]) -> Vec<f64> {
        let (rows, columns) = (self.powers_of(0), self.unknowns().columns());
        columns.iter().map(|&(channel, power)| sums[channel * rows + power]).collect()
    }

    /// Columns times coefficients at the bins of a chunk.
    #[inline(always)]
    fn values(
        &self,
        record: usize,
        chunk: &Chunk,
        coefficients: &[f64],
    ) -> ([f64; CHUNK], [f64; CHUNK]) {
        let mut found = ([0.0; CHUNK], [0.0; CHUNK]);
        let unknowns = self.unknowns();
        for channel in 0..self.n_inputs + 2 {
            let (first, part) = unknowns.of_channel(channel, record, coefficients);
            let mut made = ([0.0; CHUNK], [0.0; CHUNK]);
            for (power, factor) in part.iter().enumerate() {
                let at = (first + power) * CHUNK;
                for k in 0..CHUNK {
                    made.0[k] += factor * chunk.powers[0][at + k];
                    made.1[k] += factor * chunk.powers[1][at + k];
                }
            }
            let at = channel * CHUNK;
            let (re, im) = (&chunk.channels[0][at..at + CHUNK], &chunk.channels[1][at..at + CHUNK]);
            for k in 0..CHUNK {
                found.0[k] += made.0[k] * re[k] - made.1[k] * im[k];
                found.1[k] += made.0[k] * im[k] + made.1[k] * re[k];
            }
        }
        found
    }
}

#[cfg(test)]
#[path = "tests/rational_bins.rs"]
mod tests;
