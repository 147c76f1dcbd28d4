//! Linear recursions through a block of samples, several columns at once: what drives them, and the
//! recursion itself with coefficients and state in registers. (Python side: none)

use crate::numerics::died_away::leave_out;

/// Samples of a block.
pub const BLOCK: usize = 64;

/// Some columns at each sample of a block.
pub type Line<const L: usize> = [[f64; L]; BLOCK];

/// The sources that act on one row, with their weights for each column.
#[derive(Debug, Clone, Default)]
pub struct Acting<const L: usize> {
    sources: Vec<usize>,
    weights: Vec<[f64; L]>,
}

impl<const L: usize> Acting<L> {
    /// Those whose weights are not all zero.
    pub fn of(all: impl Iterator<Item = (usize, [f64; L])>) -> Self {
        let (sources, weights) =
            all.filter(|(_, weights)| weights.iter().any(|&each| each != 0.0)).unzip();
        Self { sources, weights }
    }

    /// Whether none acts.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Add weights · sources to a line; the first of `lines` is source number `first`.
    #[inline(always)]
    pub fn drive(&self, into: &mut Line<L>, lines: &[Line<1>], first: usize) {
        let (mut sources, mut weights) = (&self.sources[..], &self.weights[..]);
        while let (&[a, b, c, d, ref later @ ..], &[s, t, u, v, ref others @ ..]) =
            (sources, weights)
        {
            add(into, [s, t, u, v], [a, b, c, d].map(|source| &lines[source - first]));
            (sources, weights) = (later, others);
        }
        match (sources, weights) {
            (&[a, b, c], &[s, t, u]) => add(into, [s, t, u], [a, b, c].map(|k| &lines[k - first])),
            (&[a, b], &[s, t]) => add(into, [s, t], [a, b].map(|source| &lines[source - first])),
            (&[a], &[s]) => add(into, [s], [&lines[a - first]]),
            _ => {}
        }
    }
}

/// Several sources at once, so that sums stay in registers.
#[inline(always)]
fn add<const L: usize, const G: usize>(
    into: &mut Line<L>,
    weights: [[f64; L]; G],
    lines: [&Line<1>; G],
) {
    for k in 0..BLOCK {
        let mut sum = into[k];
        for (weights, line) in weights.iter().zip(lines) {
            add_scaled(&mut sum, line[k][0], weights);
        }
        into[k] = sum;
    }
}

#[inline(always)]
fn add_scaled<const L: usize>(sum: &mut [f64; L], factor: f64, values: &[f64; L]) {
    for (entry, value) in sum.iter_mut().zip(values) {
        *entry += factor * value;
    }
}

/// Carry states s⁺ = Φ s + drive through a block: each drive gives way to the s before it. `states`
/// and `lines` are by group of columns, then by state; Φ is row-major.
#[inline(always)]
pub fn carry<const L: usize>(transition: &[f64], states: &mut [[f64; L]], lines: &mut [Line<L>]) {
    match transition.len().isqrt() {
        0 => {}
        1 => carry_few::<1, L>(transition, states, lines),
        2 => carry_few::<2, L>(transition, states, lines),
        3 => carry_few::<3, L>(transition, states, lines),
        4 => carry_few::<4, L>(transition, states, lines),
        5 => carry_few::<5, L>(transition, states, lines),
        6 => carry_few::<6, L>(transition, states, lines),
        7 => carry_few::<7, L>(transition, states, lines),
        8 => carry_few::<8, L>(transition, states, lines),
        9 => carry_few::<9, L>(transition, states, lines),
        10 => carry_few::<10, L>(transition, states, lines),
        11 => carry_few::<11, L>(transition, states, lines),
        12 => carry_few::<12, L>(transition, states, lines),
        n => {
            for (state, lines) in states.chunks_exact_mut(n).zip(lines.chunks_exact_mut(n)) {
                carry_many(transition, state, lines);
            }
        }
    }
    leave_out(states.as_flattened_mut());
}

/// Two groups of columns at a time: one waits less for its sums while the other adds.
#[inline(always)]
fn carry_few<const N: usize, const L: usize>(
    transition: &[f64],
    states: &mut [[f64; L]],
    lines: &mut [Line<L>],
) {
    let Some(transition) = transition.as_chunks::<N>().0.first_chunk::<N>() else { return };
    let states = states.as_chunks_mut::<N>().0.chunks_mut(2);
    for (states, lines) in states.zip(lines.as_chunks_mut::<N>().0.chunks_mut(2)) {
        match (states, lines) {
            ([one, two], [first, second]) => pass(transition, [one, two], [first, second]),
            ([one], [first]) => pass(transition, [one], [first]),
            _ => {}
        }
    }
}

#[inline(always)]
fn pass<const N: usize, const C: usize, const L: usize>(
    transition: &[[f64; N]; N],
    states: [&mut [[f64; L]; N]; C],
    mut lines: [&mut [Line<L>; N]; C],
) {
    let mut now = [[[0.0; L]; N]; C];
    for (now, state) in now.iter_mut().zip(&states) {
        *now = **state;
    }
    for k in 0..BLOCK {
        for (now, lines) in now.iter_mut().zip(&mut lines) {
            let mut next = lines.each_ref().map(|line| line[k]);
            for (sum, factors) in next.iter_mut().zip(transition) {
                for (factor, values) in factors.iter().zip(now.iter()) {
                    add_scaled(sum, *factor, values);
                }
            }
            lines.iter_mut().zip(now.iter()).for_each(|(line, values)| line[k] = *values);
            *now = next;
        }
    }
    for (now, state) in now.iter().zip(states) {
        *state = *now;
    }
}

/// As `pass` for many states, over the factors that are not zero.
#[inline(always)]
fn carry_many<const L: usize>(transition: &[f64], state: &mut [[f64; L]], lines: &mut [Line<L>]) {
    let coupled: Vec<Vec<(usize, f64)>> = transition
        .chunks_exact(state.len())
        .map(|row| row.iter().copied().enumerate().filter(|&(_, each)| each != 0.0).collect())
        .collect();
    let mut next = state.to_vec();
    for k in 0..BLOCK {
        for ((into, line), coupled) in next.iter_mut().zip(lines.iter_mut()).zip(&coupled) {
            *into = line[k];
            for &(column, factor) in coupled {
                add_scaled(into, factor, &state[column]);
            }
        }
        for ((now, line), next) in state.iter_mut().zip(lines.iter_mut()).zip(&next) {
            line[k] = std::mem::replace(now, *next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line<const L: usize>(seed: usize) -> Line<L> {
        std::array::from_fn(|k| {
            std::array::from_fn(|l| ((seed * 131 + k * 7 + l * 29) as f64).sin())
        })
    }

    #[test]
    fn sources_add_up_whatever_their_number() {
        let lines: Vec<Line<1>> = (0..11).map(line).collect();
        for count in 0..=11 {
            let weights = |source: usize| [source as f64 - 4.0, 0.5, 0.0];
            let acting = Acting::of((0..count).map(|at| (at + 5, weights(at))));
            let mut found: Line<3> = line(40);
            acting.drive(&mut found, &lines, 5);
            for (k, values) in found.iter().enumerate() {
                for (l, value) in values.iter().enumerate() {
                    let start = line::<3>(40)[k][l];
                    let wanted =
                        (0..count).fold(start, |sum, at| sum + weights(at)[l] * lines[at][k][0]);
                    assert!((value - wanted).abs() < 1e-13, "{count} sources: {value} {wanted}");
                }
            }
        }
    }

    #[test]
    fn a_block_is_its_samples_one_by_one() {
        for n in 1..=14 {
            for groups in 1..=3 {
                // A factor in four is zero; the others keep the states from growing.
                let phi: Vec<f64> = (0..n * n)
                    .map(|k| if k % 4 == 3 { 0.0 } else { (k as f64).cos() / n as f64 })
                    .collect();
                let drive: Vec<Line<2>> = (0..groups * n).map(line).collect();
                let start: Vec<[f64; 2]> = (0..groups * n).map(|k| [k as f64, -1.0]).collect();
                let (mut state, mut lines) = (start.clone(), drive.clone());
                carry(&phi, &mut state, &mut lines);
                let mut now = start;
                for k in 0..BLOCK {
                    let old = now.clone();
                    for (at, values) in now.iter_mut().enumerate() {
                        let (group, row) = (at / n * n, at % n);
                        for (l, value) in values.iter_mut().enumerate() {
                            assert!((lines[at][k][l] - old[at][l]).abs() < 1e-12, "{n} states");
                            let sum = |j: usize| phi[row * n + j] * old[group + j][l];
                            *value = drive[at][k][l] + (0..n).map(sum).sum::<f64>();
                        }
                    }
                }
                let pairs = state.as_flattened().iter().zip(now.as_flattened());
                assert!(pairs.clone().all(|(x, y)| (x - y).abs() < 1e-12), "{n} states");
            }
        }
    }

    #[test]
    fn what_has_died_away_is_left_out() {
        let mut state = [[1.0, 1e-100], [0.0, 1.0]];
        for _ in 0..10 {
            let mut lines = [[[0.0; 2]; BLOCK]; 2];
            carry(&[0.5, 0.0, 0.0, 1.0], &mut state, &mut lines);
        }
        // 2e-193 and 2e-293.
        assert_eq!(state, [[0.0, 0.0], [0.0, 1.0]]);
    }
}
