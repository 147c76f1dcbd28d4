//! Products of rows with later rows of another series, summed over a record. (Python side:
//! uncertainty/fitted_directions.py)

use super::widest::widest;
use crate::error::CoreError;

/// Numbers of rows that all lags meet together: they and those behind them stay in the nearest cache.
const SPAN: usize = 1536;
/// Running sums of a product, so that additions need not wait for one another.
const LANES: usize = 8;
/// Lags that one reading of the earlier rows serves.
const TOGETHER: usize = 4;

/// Numbers of a row that are turned together.
const TURNED: usize = 4;
/// Rows that are turned side by side.
const BESIDE: usize = 4;

/// Σ q(t)ᵀ M q(t + k) over a record, for lags k from zero on: rows q stand side by side in `parts`,
/// each with its width, and M is `form`, symmetric.
///
/// # Errors
/// `Shape` where parts are not of one length, or the form not of their width.
pub fn lags_of_form(
    parts: [(&[f64], usize); 2],
    form: &[f64],
    n_lags: usize,
) -> Result<Vec<f64>, CoreError> {
    let width: usize = parts.iter().map(|&(_, width)| width).sum();
    let same = |what, found, needed| {
        if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
    };
    let lengths = parts.iter().filter(|&&(_, width)| width > 0);
    let n = lengths.clone().map(|(rows, width)| rows.len() / width).next().unwrap_or(0);
    for (rows, own) in lengths {
        same("numbers of directions", rows.len(), n * own)?;
    }
    same("numbers of a form", form.len(), width * width)?;
    let mut found = vec![0.0; n_lags];
    if n > 0 {
        let columns = by_columns(form, width);
        let span = SPAN.div_ceil(width);
        let mut turned = vec![0.0; span * width];
        let mut buffer = vec![0.0; (span + n_lags) * width];
        for first in (0..n).step_by(span) {
            let count = span.min(n - first);
            let last = (first + count + n_lags.saturating_sub(1)).min(n);
            let turned = &mut turned[..count * width];
            widest(
                #[inline(always)]
                || {
                    let window = side_by_side(parts, first..last, &mut buffer);
                    turn(&window[..count * width], &columns, turned, width);
                    add_sums(turned, window, width, &mut found);
                },
            );
        }
    }
    Ok(found)
}

/// A form's columns, some side by side: zeros fill the last.
fn by_columns(form: &[f64], width: usize) -> Vec<[f64; TURNED]> {
    let mut found = Vec::with_capacity(width.div_ceil(TURNED) * width);
    for first in (0..width).step_by(TURNED) {
        found.extend(form.chunks_exact(width).map(|row| {
            let mut part = [0.0; TURNED];
            part.iter_mut().zip(&row[first..]).for_each(|(into, value)| *into = *value);
            part
        }));
    }
    found
}

/// Rows of both parts as rows of one, in a buffer where both are there.
#[inline(always)]
fn side_by_side<'a>(
    parts: [(&'a [f64], usize); 2],
    span: std::ops::Range<usize>,
    buffer: &'a mut [f64],
) -> &'a [f64] {
    let [(own, a), (shared, b)] = parts;
    if a == 0 || b == 0 {
        let (rows, width) = if a == 0 { (shared, b) } else { (own, a) };
        return &rows[span.start * width..span.end * width];
    }
    let window = &mut buffer[..span.len() * (a + b)];
    let rows = own[span.start * a..].chunks_exact(a).zip(shared[span.start * b..].chunks_exact(b));
    for (into, (own, shared)) in window.chunks_exact_mut(a + b).zip(rows) {
        // So few numbers that a call that moves memory would cost more than they do.
        into.iter_mut().zip(own.iter().chain(shared)).for_each(|(into, value)| *into = *value);
    }
    window
}

/// Rows by a form, a few at a time so that no sum waits for its last.
#[inline(always)]
fn turn(rows: &[f64], columns: &[[f64; TURNED]], turned: &mut [f64], width: usize) {
    let wide = BESIDE * width;
    for (part, columns) in columns.chunks_exact(width).enumerate() {
        let first = part * TURNED;
        for (rows, into) in rows.chunks_exact(wide).zip(turned.chunks_exact_mut(wide)) {
            turn_few::<BESIDE>(rows, columns, into, first);
        }
        let done = rows.len() / wide * wide;
        let rest = rows[done..].chunks_exact(width);
        for (row, into) in rest.zip(turned[done..].chunks_exact_mut(width)) {
            turn_few::<1>(row, columns, into, first);
        }
    }
}

/// Some rows by some columns of a form.
#[inline(always)]
fn turn_few<const R: usize>(
    rows: &[f64],
    columns: &[[f64; TURNED]],
    into: &mut [f64],
    first: usize,
) {
    let width = columns.len();
    let lines: [&[f64]; R] = std::array::from_fn(|r| &rows[r * width..(r + 1) * width]);
    let mut sums = [[0.0; TURNED]; R];
    for (at, weights) in columns.iter().enumerate() {
        for (sums, line) in sums.iter_mut().zip(lines) {
            let value = line[at];
            sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += value * weight);
        }
    }
    for (into, sums) in into.chunks_exact_mut(width).zip(sums) {
        match into[first..].first_chunk_mut::<TURNED>() {
            Some(into) => *into = sums,
            None => into[first..].iter_mut().zip(sums).for_each(|(into, sum)| *into = sum),
        }
    }
}

/// Sums of products of rows with those `later` by each lag, which begin with them.
#[inline(always)]
fn add_sums(earlier: &[f64], later: &[f64], width: usize, found: &mut [f64]) {
    for (first, sums) in found.chunks_mut(TOGETHER).enumerate() {
        let behind = |lag: usize| later.get((first * TOGETHER + lag) * width..).unwrap_or(&[]);
        match sums {
            [a, b, c, d] if behind(TOGETHER - 1).len() >= earlier.len() => {
                let parts = [behind(0), behind(1), behind(2), behind(3)];
                let [p, q, r, s] = products(earlier, parts);
                (*a, *b, *c, *d) = (*a + p, *b + q, *c + r, *d + s);
            }
            _ => {
                for (lag, sum) in sums.iter_mut().enumerate() {
                    let part = behind(lag);
                    let count = part.len().min(earlier.len());
                    *sum += products(&earlier[..count], [part])[0];
                }
            }
        }
    }
}

/// Inner products of one row with the beginnings of others, at least as long.
#[inline(always)]
pub(crate) fn products<const K: usize>(x: &[f64], others: [&[f64]; K]) -> [f64; K] {
    let others = others.map(|other| &other[..x.len()]);
    let mut sums = [[0.0; LANES]; K];
    let (chunks, rest) = x.as_chunks::<LANES>();
    let mut chunked = others.map(|other| other.as_chunks::<LANES>().0.iter());
    for own in chunks {
        for (sum, other) in sums.iter_mut().zip(&mut chunked) {
            if let Some(other) = other.next() {
                sum.iter_mut().zip(own.iter().zip(other)).for_each(|(s, (a, b))| *s += a * b);
            }
        }
    }
    let mut found = sums.map(|sum| sum.iter().sum::<f64>());
    for (sum, other) in found.iter_mut().zip(others) {
        let tail = &other[chunks.len() * LANES..];
        *sum += rest.iter().zip(tail).map(|(a, b)| a * b).sum::<f64>();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::Random;

    #[test]
    fn sums_are_those_that_they_say() {
        let mut source = Random::new(3);
        let sizes = [(1, 0, 1), (5, 2, 1), (191, 0, 2), (769, 3, 8), (1601, 5, 0), (400, 1, 4)];
        for (n, a, b) in sizes {
            let width = a + b;
            let mut drawn =
                |count: usize| -> Vec<f64> { (0..count).map(|_| source.normal()).collect() };
            let (own, shared, half) = (drawn(n * a), drawn(n * b), drawn(width * width));
            let form: Vec<f64> = (0..width * width)
                .map(|at| half[at] + half[at % width * width + at / width])
                .collect();
            let value = |k: usize, i: usize| {
                if i < a { own[k * a + i] } else { shared[k * b + i - a] }
            };
            let found = lags_of_form([(&own, a), (&shared, b)], &form, 11).unwrap();
            for (lag, found) in found.iter().enumerate() {
                let mut wanted = 0.0;
                for k in lag..n {
                    for (i, row) in form.chunks_exact(width).enumerate() {
                        let met = row.iter().enumerate().map(|(j, m)| m * value(k, j));
                        wanted += value(k - lag, i) * met.sum::<f64>();
                    }
                }
                assert!((found - wanted).abs() < 1e-9, "{n} {a} {b} {lag}: {found} {wanted}");
            }
        }
        assert_eq!(lags_of_form([(&[], 0), (&[], 0)], &[], 2).unwrap(), [0.0; 2]);
        assert!(lags_of_form([(&[1.0; 4], 2), (&[1.0; 3], 1)], &[0.0; 9], 2).is_err());
        assert!(lags_of_form([(&[1.0; 4], 2), (&[], 0)], &[0.0; 3], 2).is_err());
    }
}
