//! Products of directions with all candidates, found for several terms at one reading.
//! (Python side: identification/narx/fit.py)
//!
//! Reading the candidates from memory costs as much as multiplying them by several vectors. So at each
//! reading the terms that will probably follow are guessed, by greedy selection among the best few, and
//! what is left of them, v, is multiplied too. When one of them is chosen later its direction is
//! q = (v − Σ c_i q_i)/ρ over the directions q_i chosen in between, c_i = q_iᵀv and ρ = qᵀv, so that
//! qᵀp_j = (vᵀp_j − Σ c_i q_iᵀp_j)/ρ without reading any p_j. A guess costs time when it is wrong and
//! never changes a choice.

use std::collections::BTreeMap;

use crate::black_box::candidates::Candidates;
use crate::black_box::remainder::Remainder;
use crate::numerics::gram_schmidt::{AT_ONCE, dot, orthogonalise};

/// Candidates among which the next terms are guessed.
const GUESSED_AMONG: usize = 32;
/// Rounding errors, as a multiple of those of a product that is read, beyond which it is read.
const LARGEST_DOUBT: f64 = 8.0;
/// Readings with guesses before they are judged by what came true.
const TRIALS: usize = 3;
/// Below this share of its length the rest of a candidate is not worth guessing.
const NEARLY_COLLINEAR: f64 = 1e-8;

/// The state of a selection whose newest direction has no products yet.
pub(crate) struct Progress<'a> {
    /// All candidates.
    pub candidates: &'a Candidates<'a>,
    /// What is left of each, without the newest direction.
    pub remainders: &'a [Remainder],
    /// Orthonormal directions of the chosen terms.
    pub directions: &'a [Vec<f64>],
    /// Products with every candidate, of all directions but the newest.
    pub shares: &'a [Vec<f64>],
}

/// A guess: what was left of a candidate, of unit length, and its products with all candidates.
struct Guess {
    vector: Vec<f64>,
    products: Vec<f64>,
    /// Number of directions that `vector` is orthogonal to.
    since: usize,
    /// Squared length at that time.
    length: f64,
}

/// Guesses of one selection.
pub(crate) struct LookAhead {
    forced: usize,
    most: usize,
    guesses: BTreeMap<usize, Guess>,
    /// Rounding errors of each direction's products, as a multiple of those that were read.
    doubts: Vec<f64>,
    /// Readings with guesses, and guesses that came true.
    tries: usize,
    hits: usize,
}

impl LookAhead {
    /// A selection that takes the first `forced` candidates in order and ends at `most` terms.
    pub fn new(forced: usize, most: usize) -> Self {
        Self { forced, most, guesses: BTreeMap::new(), doubts: Vec::new(), tries: 0, hits: 0 }
    }

    /// How often the candidates were read.
    #[cfg(test)]
    pub fn reads(&self) -> usize {
        self.doubts.iter().filter(|doubt| **doubt == 1.0).count()
    }

    /// Products of the newest direction, that of candidate `index`, with every open candidate.
    pub fn share(&mut self, index: usize, progress: &Progress<'_>) -> Vec<f64> {
        self.guessed(index, progress).unwrap_or_else(|| self.read(index, progress))
    }

    fn guessed(&mut self, index: usize, progress: &Progress<'_>) -> Option<Vec<f64>> {
        let guess = self.guesses.remove(&index)?;
        let (newest, earlier) = progress.directions.split_last()?;
        let between = &earlier[guess.since..];
        let rest = dot(newest, &guess.vector);
        let parts: Vec<f64> = between.iter().map(|q| dot(q, &guess.vector)).collect();
        let doubts = parts.iter().zip(&self.doubts[guess.since..]);
        let doubt = (1.0 + doubts.map(|(c, doubt)| c.abs() * doubt).sum::<f64>()) / rest;
        // Not "≤ …": a rest of zero has no doubt that compares.
        if !(doubt <= LARGEST_DOUBT && rest > 0.0) {
            return None;
        }
        let mut products = guess.products;
        for (c, share) in parts.iter().zip(&progress.shares[guess.since..]) {
            products.iter_mut().zip(share).for_each(|(value, r)| *value -= c * r);
        }
        products.iter_mut().for_each(|value| *value /= rest);
        self.doubts.push(doubt);
        self.hits += 1;
        Some(products)
    }

    /// Read all candidates; guess what follows and multiply by that too.
    fn read(&mut self, index: usize, progress: &Progress<'_>) -> Vec<f64> {
        let (candidates, remainders) = (progress.candidates, progress.remainders);
        let least = LARGEST_DOUBT.powi(-2);
        self.guesses.retain(|index, guess| {
            remainders[*index].open && remainders[*index].length > least * guess.length
        });
        let open = |index: usize| remainders[index].open;
        let newest = &progress.directions[progress.directions.len() - 1];
        self.doubts.push(1.0);
        // A reading with guesses takes longer: it is worth while if on average one comes true.
        let worth = self.tries < TRIALS || self.hits >= self.tries;
        let next = if worth { self.next_terms(index, progress) } else { Vec::new() };
        let made: Vec<(usize, Guess)> =
            next.into_iter().filter_map(|next| Some((next, guess(next, progress)?))).collect();
        if made.is_empty() {
            return candidates.map(0.0, open, |_, column| dot(newest, column));
        }
        self.tries += 1;
        let vector = |place: usize| made.get(place).map_or(&newest[..], |(_, guess)| &guess.vector);
        let vectors = [newest, vector(0), vector(1), vector(2)];
        let found = candidates.products(open, vectors);
        for (place, (next, guess)) in made.into_iter().enumerate() {
            let products = found.iter().map(|values| values[place + 1]).collect();
            self.guesses.insert(next, Guess { products, ..guess });
        }
        found.iter().map(|values| values[0]).collect()
    }

    /// Candidates that will probably follow `index`: the forced ones, or by greedy selection.
    fn next_terms(&self, index: usize, progress: &Progress<'_>) -> Vec<usize> {
        let chosen = progress.directions.len();
        let count = (AT_ONCE - 1).min(self.most - chosen);
        if index + 1 < self.forced {
            return (index + 1..self.forced.min(index + 1 + count)).collect();
        }
        let mut best = self.best_few(progress);
        let at = progress.remainders[index];
        let gain = at.product / at.length.sqrt();
        let mut scratch = Vec::new();
        let newest = &progress.directions[chosen - 1];
        let mut taken: Vec<(usize, f64)> = Vec::new();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        let row: Vec<f64> = best
            .iter()
            .map(|(other, _)| dot(newest, progress.candidates.column(*other, &mut scratch)))
            .collect();
        lower(&mut best, &row, gain);
        rows.push(row);
        while taken.len() < count {
            let Some(place) = most_reducing(&best) else { break };
            let (next, rest) = best[place];
            let root = rest.length.sqrt();
            let row = remaining_products(&best, place, &rows, root, progress);
            taken.push((next, root));
            lower(&mut best, &row, rest.product / root);
            best[place].1.open = false;
            rows.push(row);
        }
        taken.into_iter().map(|(next, _)| next).collect()
    }

    /// The open candidates that would lower the error most now and are not guessed yet.
    fn best_few(&self, progress: &Progress<'_>) -> Vec<(usize, Remainder)> {
        let mut order: Vec<(usize, Remainder)> = progress
            .remainders
            .iter()
            .copied()
            .enumerate()
            .filter(|(index, rest)| rest.open && !self.guesses.contains_key(index))
            .collect();
        if order.len() > GUESSED_AMONG {
            order.select_nth_unstable_by(GUESSED_AMONG, |(_, a), (_, b)| {
                b.reduction().total_cmp(&a.reduction())
            });
            order.truncate(GUESSED_AMONG);
        }
        order.sort_unstable_by_key(|(index, _)| *index);
        order
    }
}

/// Products of the rest of `best[place]`, of unit length, with the candidates.
fn remaining_products(
    best: &[(usize, Remainder)],
    place: usize,
    rows: &[Vec<f64>],
    root: f64,
    progress: &Progress<'_>,
) -> Vec<f64> {
    let next = best[place].0;
    let (mut scratch, mut other_scratch) = (Vec::new(), Vec::new());
    let column = progress.candidates.column(next, &mut scratch);
    let product = |(at, (other, _)): (usize, &(usize, Remainder))| {
        let whole = dot(column, progress.candidates.column(*other, &mut other_scratch));
        let before: f64 = progress.shares.iter().map(|share| share[next] * share[*other]).sum();
        let since: f64 = rows.iter().map(|row| row[place] * row[at]).sum();
        (whole - before - since) / root
    };
    best.iter().enumerate().map(product).collect()
}

fn lower(best: &mut [(usize, Remainder)], row: &[f64], gain: f64) {
    for ((_, rest), r) in best.iter_mut().zip(row) {
        rest.length -= r * r;
        rest.product -= r * gain;
    }
}

fn most_reducing(best: &[(usize, Remainder)]) -> Option<usize> {
    let worth = |rest: &Remainder| rest.open && rest.length > NEARLY_COLLINEAR * rest.full;
    let places = (0..best.len()).filter(|place| worth(&best[*place].1));
    places.max_by(|a, b| best[*a].1.reduction().total_cmp(&best[*b].1.reduction()))
}

/// What is left of a candidate, of unit length; None where that is hardly anything.
fn guess(index: usize, progress: &Progress<'_>) -> Option<Guess> {
    let mut scratch = Vec::new();
    let mut vector = progress.candidates.column(index, &mut scratch).to_vec();
    orthogonalise(&mut vector, progress.directions);
    let length = dot(&vector, &vector);
    if length <= NEARLY_COLLINEAR * progress.remainders[index].full {
        return None;
    }
    vector.iter_mut().for_each(|value| *value /= length.sqrt());
    Some(Guess { vector, products: Vec::new(), since: progress.directions.len(), length })
}
