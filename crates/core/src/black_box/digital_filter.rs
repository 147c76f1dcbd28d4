//! Polynomials in the delay operator q⁻¹ applied to signals, from rest. (Python side:
//! models/polynomial/model.py)

use crate::numerics::gram_schmidt::subtract;

/// p(q) x delayed by `delay` samples, added to `out` with a factor.
pub fn add_product(factor: f64, polynomial: &[f64], delay: usize, x: &[f64], out: &mut [f64]) {
    for (power, &coefficient) in polynomial.iter().enumerate() {
        let (weight, shift) = (factor * coefficient, delay + power);
        if weight == 0.0 || shift >= out.len() {
            continue;
        }
        subtract(&mut out[shift..], -weight, x);
    }
}

/// x / p(q) in place; the polynomial starts with one.
pub fn divide(polynomial: &[f64], x: &mut [f64]) {
    divide_together(polynomial, [x]);
}

/// Any number of signals by the same polynomial, four at a time.
pub fn divide_all(polynomial: &[f64], mut signals: Vec<&mut Vec<f64>>) {
    for group in signals.chunks_mut(4) {
        match group {
            [x, y, z, w] => divide_together(polynomial, [x, y, z, w]),
            [x, y, z] => divide_together(polynomial, [x, y, z]),
            [x, y] => divide_together(polynomial, [x, y]),
            others => others.iter_mut().for_each(|x| divide(polynomial, x)),
        }
    }
}

/// Several signals by the same polynomial, in one pass: a recursion waits for its own last value, so
/// others run in its shadow.
pub fn divide_together<const M: usize>(polynomial: &[f64], x: [&mut [f64]; M]) {
    let tail = polynomial.get(1..).unwrap_or(&[]);
    match tail.len() {
        0 => {}
        1 => recur::<M, 1>(tail, x),
        2 => recur::<M, 2>(tail, x),
        3 => recur::<M, 3>(tail, x),
        4 => recur::<M, 4>(tail, x),
        5 => recur::<M, 5>(tail, x),
        6 => recur::<M, 6>(tail, x),
        _ => x.into_iter().for_each(|signal| long_recursion(tail, signal)),
    }
}

/// The last K values of each signal stay in registers.
fn recur<const M: usize, const K: usize>(tail: &[f64], mut x: [&mut [f64]; M]) {
    let mut c = [0.0; K];
    c.copy_from_slice(tail);
    let length = x.iter().map(|signal| signal.len()).min().unwrap_or(0);
    let mut past = [[0.0; K]; M];
    for t in 0..length {
        for (signal, past) in x.iter_mut().zip(&mut past) {
            let mut value = signal[t];
            for k in (0..K).rev() {
                value -= c[k] * past[k];
            }
            for k in (1..K).rev() {
                past[k] = past[k - 1];
            }
            past[0] = value;
            signal[t] = value;
        }
    }
}

fn long_recursion(tail: &[f64], x: &mut [f64]) {
    for t in 0..x.len() {
        let mut value = x[t];
        for k in (1..=tail.len().min(t)).rev() {
            value -= tail[k - 1] * x[t - k];
        }
        x[t] = value;
    }
}

/// Product of two polynomials.
pub fn multiply(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_undoes_a_division() {
        for order in 0..9 {
            let p: Vec<f64> = (0..=order).map(|k| 0.5_f64.powi(k)).collect();
            let x: Vec<f64> = (0..50).map(|t| f64::from(t * t % 7) - 2.0).collect();
            let (mut one, mut two) = (x.clone(), x.iter().map(|v| 2.0 * v).collect::<Vec<_>>());
            divide_together(&p, [&mut one, &mut two]);
            let mut back = vec![0.0; 50];
            add_product(1.0, &p, 0, &one, &mut back);
            for t in 0..50 {
                assert!((back[t] - x[t]).abs() < 1e-12 && (two[t] - 2.0 * one[t]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn delays_shift_and_never_wrap() {
        let mut out = vec![0.0; 4];
        add_product(2.0, &[1.0, -1.0], 2, &[1.0, 2.0, 3.0, 4.0], &mut out);
        assert_eq!(out, [0.0, 0.0, 2.0, 2.0]);
        assert_eq!(multiply(&[1.0, 2.0], &[1.0, -3.0]), [1.0, -1.0, -6.0]);
    }
}
