//! Rows of samples through a recursive filter.
//! (Python side: `recursive_filter.py`)

use std::ops::Range;

use crate::error::CoreError;

/// Rows side by side: each has its own chain of dependent products, so that several fill the wait.
const LANES: usize = 4;
/// Samples after which a filter without input is asked whether it still moves.
const SPAN: usize = 256;
/// A state below this is at rest: what it would still bring is lost beside any sample, and processors
/// take a hundred times as long over numbers that are smaller than their format's exponents reach.
const AT_REST: f64 = 1e-290;

/// Rows (`n` samples each) of `x` through b(z)/a(z), transposed direct form II, from the states
/// `state` (one row of order each), which are left as they are after the last sample.
///
/// `b` and `a` have one length, the order and one, and `a` begins with one. The order of the
/// products and sums is that of Oppenheim & Schafer, Discrete-Time Signal Processing, 3rd ed.,
/// §6.3.4, figure 6.26, whatever the number of rows.
///
/// # Errors
/// Shapes that do not belong together.
pub fn filter_rows(
    b: &[f64],
    a: &[f64],
    x: &[f64],
    n: usize,
    state: &mut [f64],
) -> Result<Vec<f64>, CoreError> {
    let order = b.len().saturating_sub(1);
    let rows = x.len().checked_div(n).unwrap_or(0);
    if b.is_empty() || a.len() != b.len() {
        let (found, needed) = (a.len(), b.len().max(1));
        return Err(CoreError::Shape { what: "denominator of a filter", found, needed });
    }
    if n > 0 && state.len() != rows * order {
        let (found, needed) = (state.len(), rows * order);
        return Err(CoreError::Shape { what: "states of a filter", found, needed });
    }
    let mut made = vec![0.0; x.len()];
    let whole = rows - rows % LANES;
    for first in (0..whole).step_by(LANES) {
        let samples = first * n..(first + LANES) * n;
        let states = first * order..(first + LANES) * order;
        filter_lanes(b, a, &x[samples.clone()], n, &mut state[states], &mut made[samples]);
    }
    for row in whole..rows {
        let samples = row * n..(row + 1) * n;
        let z = &mut state[row * order..(row + 1) * order];
        let spans = made[samples.clone()].chunks_mut(SPAN).zip(x[samples].chunks(SPAN));
        for (out, input) in spans {
            if z.iter().all(|state| state.abs() < AT_REST) && input.iter().all(|&x| x == 0.0) {
                z.fill(0.0);
                continue;
            }
            filter_span(b, a, input, z, out);
        }
    }
    Ok(made)
}

/// Samples of one row; the usual orders keep their states in registers.
fn filter_span(b: &[f64], a: &[f64], x: &[f64], z: &mut [f64], out: &mut [f64]) {
    match z.len() {
        1 => of_order::<1>(b, a, x, z, out),
        2 => of_order::<2>(b, a, x, z, out),
        3 => of_order::<3>(b, a, x, z, out),
        4 => of_order::<4>(b, a, x, z, out),
        5 => of_order::<5>(b, a, x, z, out),
        6 => of_order::<6>(b, a, x, z, out),
        7 => of_order::<7>(b, a, x, z, out),
        8 => of_order::<8>(b, a, x, z, out),
        _ => out.iter_mut().zip(x).for_each(|(out, &value)| *out = advance(b, a, value, z)),
    }
}

fn of_order<const K: usize>(b: &[f64], a: &[f64], x: &[f64], z: &mut [f64], out: &mut [f64]) {
    let (first, mut above, mut below, mut held) = (b[0], [0.0; K], [0.0; K], [0.0; K]);
    above.copy_from_slice(&b[1..=K]);
    below.copy_from_slice(&a[1..=K]);
    held.copy_from_slice(z);
    for (out, &x) in out.iter_mut().zip(x) {
        let y = held[0] + first * x;
        for k in 0..K - 1 {
            held[k] = held[k + 1] + x * above[k] - y * below[k];
        }
        held[K - 1] = x * above[K - 1] - y * below[K - 1];
        *out = y;
    }
    z.copy_from_slice(&held);
}

/// One sample of one row.
#[inline]
fn advance(b: &[f64], a: &[f64], x: f64, z: &mut [f64]) -> f64 {
    let order = z.len();
    if order == 0 {
        return x * b[0];
    }
    let y = z[0] + b[0] * x;
    for k in 0..order - 1 {
        z[k] = z[k + 1] + x * b[k + 1] - y * a[k + 1];
    }
    z[order - 1] = x * b[order] - y * a[order];
    y
}

/// All samples of `LANES` rows, states interleaved.
fn filter_lanes(b: &[f64], a: &[f64], x: &[f64], n: usize, state: &mut [f64], made: &mut [f64]) {
    let order = b.len() - 1;
    let mut z = vec![[0.0; LANES]; order + 1];
    for lane in 0..LANES {
        for k in 0..order {
            z[k][lane] = state[lane * order + k];
        }
    }
    for first in (0..n).step_by(SPAN) {
        let span = first..n.min(first + SPAN);
        let driven = (0..LANES)
            .any(|lane| x[lane * n + span.start..lane * n + span.end].iter().any(|&x| x != 0.0));
        if !driven && z.as_flattened().iter().all(|state| state.abs() < AT_REST) {
            z.fill([0.0; LANES]);
            continue;
        }
        advance_lanes(b, a, x, span, &mut z, made);
    }
    for lane in 0..LANES {
        for k in 0..order {
            state[lane * order + k] = z[k][lane];
        }
    }
}

/// Some samples of `LANES` rows.
fn advance_lanes(
    b: &[f64],
    a: &[f64],
    x: &[f64],
    span: Range<usize>,
    z: &mut [[f64; LANES]],
    made: &mut [f64],
) {
    let (n, order) = (x.len() / LANES, b.len() - 1);
    for at in span {
        let mut input = [0.0; LANES];
        let mut y = [0.0; LANES];
        for lane in 0..LANES {
            input[lane] = x[lane * n + at];
            y[lane] = if order > 0 { z[0][lane] + b[0] * input[lane] } else { input[lane] * b[0] };
            made[lane * n + at] = y[lane];
        }
        for k in 0..order {
            let last = k + 1 == order;
            for lane in 0..LANES {
                let from = input[lane] * b[k + 1];
                let from = if last { from } else { z[k + 1][lane] + from };
                z[k][lane] = from - y[lane] * a[k + 1];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_through_one_pole_decays_by_it_in_every_row() -> Result<(), CoreError> {
        let n = 6;
        let mut x = vec![0.0; 6 * n];
        (0..6).for_each(|row| x[row * n] = 1.0 + row as f64);
        let mut state = vec![0.0; 6];
        let made = filter_rows(&[1.0, 0.0], &[1.0, -0.5], &x, n, &mut state)?;
        for row in 0..6 {
            for at in 0..n {
                assert_eq!(made[row * n + at], (1.0 + row as f64) * 0.5_f64.powi(at as i32));
            }
        }
        Ok(())
    }

    #[test]
    fn every_order_has_the_bits_of_the_plain_recursion_until_it_is_at_rest() -> Result<(), CoreError>
    {
        for order in 0..10 {
            let b: Vec<f64> = (0..=order).map(|k| 1.0 / (k + 1) as f64).collect();
            let a: Vec<f64> = (0..=order).map(|k| (-0.4_f64).powi(k as i32)).collect();
            let mut x: Vec<f64> = (0..700).map(|t| f64::from(t * t % 7) - 2.0).collect();
            x.resize(4096, 0.0);
            let (mut state, mut plain) = (vec![0.5; order], vec![0.5; order]);
            let made = filter_rows(&b, &a, &x, x.len(), &mut state)?;
            for (t, (found, &value)) in made.iter().zip(&x).enumerate() {
                let wanted = advance(&b, &a, value, &mut plain);
                assert!(*found == wanted || (t > 700 && wanted.abs() < AT_REST), "{order} {t}");
            }
            assert!(state.iter().all(|z| *z == 0.0), "{order}: nothing moves for ever");
            let mut states = vec![0.5; 5 * order];
            let rows = filter_rows(&b, &a, &x.repeat(5), x.len(), &mut states)?;
            assert!(rows.chunks(x.len()).all(|row| row == made) && states == vec![0.0; 5 * order]);
        }
        Ok(())
    }

    #[test]
    fn states_that_do_not_fit_are_refused() {
        assert!(filter_rows(&[1.0, 0.0], &[1.0, -0.5], &[1.0; 4], 2, &mut [0.0]).is_err());
    }
}
