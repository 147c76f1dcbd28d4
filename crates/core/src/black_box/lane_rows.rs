//! Pieces of one signal side by side, a piece in each lane: recursions of all pieces run in each other's
//! shadow, and products of shifted signals need no shuffles. (Python side: none)
//!
//! Each row holds one sample of every piece; a piece that goes on from another starts some rows early.

/// Pieces, and numbers of a row: the widest registers hold eight doubles.
pub const LANES: usize = 8;
/// One sample of each piece.
pub type Row = [f64; LANES];

/// Products that one reading of the left rows serves: with their sums they fill the registers.
const TOGETHER: usize = 6;

/// A signal cut into pieces of one length, zeros before its first sample where that does not divide.
#[derive(Debug, Clone)]
pub struct Pieces {
    /// Rows of the pieces.
    pub rows: Vec<Row>,
    /// Zeros before the first sample.
    pub pad: usize,
}

impl Pieces {
    /// Cut a signal.
    pub fn of(signal: &[f64]) -> Self {
        let length = signal.len().div_ceil(LANES);
        let pad = LANES * length - signal.len();
        let mut rows = vec![[0.0; LANES]; length];
        for (place, value) in signal.iter().enumerate() {
            rows[(place + pad) % length][(place + pad) / length] = *value;
        }
        Self { rows, pad }
    }

    /// Copy `target.len()` rows from `ahead` rows before the pieces' starts on; there each lane shows the end of the
    /// piece before it, the first one rest.
    pub fn before(&self, ahead: usize, target: &mut [Row]) {
        let from = self.rows.len() - ahead;
        for (target, row) in target.iter_mut().zip(&self.rows[from..]) {
            target[0] = 0.0;
            target[1..].copy_from_slice(&row[..LANES - 1]);
        }
    }
}

/// Rows from `first` on through 1/p, p = 1 + c₁q⁻¹ + …, in place; those before it are its past.
#[inline(always)]
pub fn divide_rows<const S: usize>(c: &[f64], rows: [&mut [Row]; S], first: usize) {
    match c.len() {
        0 => {}
        1 => recur::<1, S>(c, rows, first),
        2 => recur::<2, S>(c, rows, first),
        3 => recur::<3, S>(c, rows, first),
        4 => recur::<4, S>(c, rows, first),
        5 => recur::<5, S>(c, rows, first),
        6 => recur::<6, S>(c, rows, first),
        _ => rows.into_iter().for_each(|rows| long_recursion(c, rows, first)),
    }
}

/// The last K rows of each signal stay in registers.
#[inline(always)]
fn recur<const K: usize, const S: usize>(c: &[f64], mut rows: [&mut [Row]; S], first: usize) {
    let mut weights = [0.0; K];
    weights.copy_from_slice(c);
    let mut past = [[[0.0; LANES]; K]; S];
    for (past, rows) in past.iter_mut().zip(&rows) {
        past.iter_mut().enumerate().for_each(|(k, row)| *row = rows[first - 1 - k]);
    }
    let last = rows.iter().map(|rows| rows.len()).min().unwrap_or(0);
    for t in first..last {
        for (rows, past) in rows.iter_mut().zip(&mut past) {
            let mut value = rows[t];
            for k in (0..K).rev() {
                for lane in 0..LANES {
                    value[lane] -= weights[k] * past[k][lane];
                }
            }
            for k in (1..K).rev() {
                past[k] = past[k - 1];
            }
            past[0] = value;
            rows[t] = value;
        }
    }
}

#[inline(always)]
fn long_recursion(c: &[f64], rows: &mut [Row], first: usize) {
    for t in first..rows.len() {
        let mut value = rows[t];
        for (k, weight) in c.iter().enumerate().rev() {
            let before = rows[t - 1 - k];
            value.iter_mut().zip(before).for_each(|(v, x)| *v -= weight * x);
        }
        rows[t] = value;
    }
}

/// Add Σ_k p_k x(t − shift − k) to the target rows, x(t) beginning at row `first` of the source.
#[inline(always)]
pub fn add_shifted(p: &[f64], source: &[Row], first: usize, shift: usize, target: &mut [Row]) {
    for (k, weight) in p.iter().enumerate() {
        let behind = &source[first - shift - k..];
        for (target, row) in target.iter_mut().zip(behind) {
            for lane in 0..LANES {
                target[lane] += weight * row[lane];
            }
        }
    }
}

/// Add Σ_t left(t) x(t − shift − k) to the sum of each k, x(t) beginning at row `first` of the source.
#[inline(always)]
pub fn add_products(left: &[Row], source: &[Row], first: usize, shift: usize, sums: &mut [Row]) {
    for (group, sums) in sums.chunks_mut(TOGETHER).enumerate() {
        let newest = first - shift - group * TOGETHER;
        let source = &source[newest + 1 - sums.len()..newest + left.len()];
        match sums.len() {
            1 => lagged::<1>(left, source, sums),
            2 => lagged::<2>(left, source, sums),
            3 => lagged::<3>(left, source, sums),
            4 => lagged::<4>(left, source, sums),
            5 => lagged::<5>(left, source, sums),
            _ => lagged::<TOGETHER>(left, source, sums),
        }
    }
}

/// Products with G rows that follow one another, the newest first.
#[inline(always)]
fn lagged<const G: usize>(left: &[Row], source: &[Row], sums: &mut [Row]) {
    let mut held = [[0.0; LANES]; G];
    held.copy_from_slice(sums);
    for (left, behind) in left.iter().zip(source.windows(G)) {
        for k in 0..G {
            let row = &behind[G - 1 - k];
            for lane in 0..LANES {
                held[k][lane] += left[lane] * row[lane];
            }
        }
    }
    sums.copy_from_slice(&held);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::black_box::digital_filter::divide;

    #[test]
    fn pieces_behind_one_another_are_the_signal() {
        let signal: Vec<f64> = (1..=45).map(f64::from).collect();
        let pieces = Pieces::of(&signal);
        assert_eq!((pieces.rows.len(), pieces.pad), (6, 3));
        let mut before = [[0.0; LANES]; 2];
        pieces.before(2, &mut before);
        assert_eq!((before[0][0], before[1][0]), (0.0, 0.0));
        let lane = |k: usize| before.iter().chain(&pieces.rows).map(move |row| row[k]);
        assert!(lane(0).skip(2).eq([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]));
        for k in 1..LANES {
            let first = 6 * k - 4;
            assert!(lane(k).eq((first..first + 8).map(|t| t as f64)), "{k}");
        }
    }

    #[test]
    fn every_order_of_a_recursion_is_the_plain_one() {
        let x: Vec<f64> = (0..40).map(|t| f64::from(t * t % 7) - 2.0).collect();
        for order in 0..9 {
            let c: Vec<f64> = (1..=order).map(|k| (-0.4_f64).powi(k)).collect();
            let mut rows = vec![[0.0; LANES]; 50];
            for (row, value) in rows[10..].iter_mut().zip(&x) {
                (row[2], row[7]) = (*value, -value);
            }
            let mut other = rows.clone();
            divide_rows(&c, [&mut rows, &mut other], 10);
            let mut plain = x.clone();
            divide(&[&[1.0], &c[..]].concat(), &mut plain);
            for (t, wanted) in plain.iter().enumerate() {
                assert_eq!((rows[10 + t][2], rows[10 + t][7]), (*wanted, -wanted), "{order} {t}");
            }
            assert_eq!(rows, other);
        }
    }

    #[test]
    fn products_of_all_lags_are_those_that_they_say() {
        let source: Vec<Row> = (0..60).map(|t| [f64::from(t * t % 11) - 4.0; LANES]).collect();
        let left: Vec<Row> = (0..30).map(|t| [f64::from(t * 5 % 7) - 2.0; LANES]).collect();
        for count in 0..15 {
            let mut sums = vec![[1.0; LANES]; count];
            add_products(&left, &source, 25, 3, &mut sums);
            for (k, sum) in sums.iter().enumerate() {
                let behind = source[22 - k..].iter();
                let wanted: f64 = left.iter().zip(behind).map(|(a, b)| a[0] * b[0]).sum();
                assert_eq!(*sum, [1.0 + wanted; LANES], "{count} {k}");
            }
        }
    }
}
