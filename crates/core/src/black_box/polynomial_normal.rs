//! Normal equations of shifted signals: sums of one shift follow from those of the shift before, so
//! few of them run over the record. (Python side: validation/order_scan/scan_orders.py)
//!
//! Half the digits of an orthogonal triangle: for ranking many structures, not for reporting one.
//!
//! Reference: the covariance method of linear prediction, Makhoul (1975), Proc. IEEE 63, section II.

use crate::black_box::polynomial_predictor::{Column, Derivatives};
use crate::numerics::gram_schmidt::dot;

const CHUNK: usize = 2048;
/// A pivot that lost this much of its column leaves the normal equations without digits.
const SMALLEST_PIVOT: f64 = 1e-11;

/// Add one record's products of [Jacobian | errors], from row `skip` on, to a column-major square.
pub fn add_products(made: &Derivatives, errors: &[f64], skip: usize, products: &mut [f64]) {
    let mut signals: Vec<&[f64]> = made.signals.iter().map(Vec::as_slice).collect();
    signals.push(errors);
    let mut columns = made.columns.clone();
    columns.push(Column { signal: signals.len() - 1, shift: 0, sign: 1.0 });
    let width = columns.len();
    let n = errors.len();
    let mut sums = vec![0.0; width * width];
    let whole = add_whole_sums(&signals, &columns, skip, n, &mut sums);
    for j in 0..width {
        for i in 0..=j {
            let (a, b) = (columns[i], columns[j]);
            if !whole[j * width + i] {
                let (x, y) = (signals[a.signal], signals[b.signal]);
                let gained = before(x, skip, a.shift) * before(y, skip, b.shift);
                let lost = before(x, n, a.shift) * before(y, n, b.shift);
                sums[j * width + i] = sums[(j - 1) * width + i - 1] + gained - lost;
            }
            products[j * width + i] += a.sign * b.sign * sums[j * width + i];
        }
    }
}

/// Take the products of one direction's coordinates off, those of the errors being none.
pub fn remove_square(shares: &[f64], products: &mut [f64]) {
    let width = shares.len() + 1;
    for (j, right) in shares.iter().enumerate() {
        for (i, left) in shares.iter().enumerate().take(j + 1) {
            products[j * width + i] -= left * right;
        }
    }
}

fn before(x: &[f64], t: usize, shift: usize) -> f64 {
    if t >= shift { x[t - shift] } else { 0.0 }
}

/// Sums that no other sum gives: those with the first shift of a signal, and with the errors.
fn add_whole_sums(
    signals: &[&[f64]],
    columns: &[Column],
    skip: usize,
    n: usize,
    sums: &mut [f64],
) -> Vec<bool> {
    let width = columns.len();
    let first = |k: usize| k == 0 || columns[k].signal != columns[k - 1].signal;
    let mut whole = vec![false; width * width];
    for j in 0..width {
        for i in 0..=j {
            whole[j * width + i] = first(i) || first(j);
        }
    }
    let mut from = skip;
    while from < n {
        let to = (from + CHUNK).min(n);
        for j in 0..width {
            for i in (0..=j).filter(|&i| whole[j * width + i]) {
                let (a, b) = (columns[i], columns[j]);
                let begin = from.max(a.shift).max(b.shift);
                if begin < to {
                    let x = &signals[a.signal][begin - a.shift..to - a.shift];
                    let y = &signals[b.signal][begin - b.shift..to - b.shift];
                    sums[j * width + i] += dot(x, y);
                }
            }
        }
        from = to;
    }
    whole
}

/// Upper triangle R of RᵀR from the upper half of a column-major square; `None` where too few digits
/// are left. The last column may end in zero.
pub fn factorise(products: &[f64], width: usize) -> Option<Vec<f64>> {
    let mut r = vec![0.0; width * width];
    for j in 0..width {
        for i in 0..=j {
            let above = dot(&r[i * width..i * width + i], &r[j * width..j * width + i]);
            let left = products[j * width + i] - above;
            if i < j {
                r[j * width + i] = left / r[i * width + i];
            } else if j + 1 == width {
                r[j * width + j] = left.max(0.0).sqrt();
            } else if left > SMALLEST_PIVOT * products[j * width + j] {
                r[j * width + j] = left.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(r)
}
