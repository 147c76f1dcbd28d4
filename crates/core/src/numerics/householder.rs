//! Orthogonal triangularisation of small dense least-squares problems, in place, columns contiguous.

use crate::numerics::widest::widest;

/// Reduce the first `n` columns of a column-major (`m` × `n + extra`) matrix to upper triangular form
/// by Householder reflections, applied to the extra columns too.
///
/// Reference: Golub & Van Loan, *Matrix Computations*, 4th ed., algorithms 5.1.1 and 5.2.1.
pub fn triangularise(a: &mut [f64], m: usize, n: usize) {
    if m > 0 {
        widest(
            #[inline(always)]
            || reflect_all(a, m, n),
        );
    }
}

#[inline(always)]
fn reflect_all(a: &mut [f64], m: usize, n: usize) {
    for k in 0..n.min(m.saturating_sub(1)) {
        let (head, rest) = a.split_at_mut((k + 1) * m);
        let column = &mut head[k * m + k..];
        let norm = norm(column);
        if norm == 0.0 {
            continue;
        }
        let alpha = if column[0] > 0.0 { -norm } else { norm };
        column[0] -= alpha;
        // Columns alike leave rests of rests, each by another 1e-16 smaller: their squares would be zero.
        if !(1e-140..1e140).contains(&norm) {
            column.iter_mut().for_each(|x| *x /= norm);
        }
        // vᵀv = 2·norm·(norm + |column[0] before|): never zero here.
        let scale = 2.0 / dot(column, column);
        for other in rest.chunks_exact_mut(m) {
            let tail = &mut other[k..];
            let factor = scale * dot(column, tail);
            for (entry, v) in tail.iter_mut().zip(column.iter()) {
                *entry -= factor * v;
            }
        }
        column[0] = alpha;
        column[1..].fill(0.0);
    }
}

/// Solve R x = b for an upper triangular `n` × `n` block with `m` rows a column; a zero on the
/// diagonal gives zero (the direction has no influence).
pub fn back_substitute(r: &[f64], m: usize, n: usize, b: &[f64], x: &mut [f64]) {
    for row in (0..n).rev() {
        let sum: f64 = (row + 1..n).map(|column| r[column * m + row] * x[column]).sum();
        let diagonal = r[row * m + row];
        x[row] = if diagonal == 0.0 { 0.0 } else { (b[row] - sum) / diagonal };
    }
}

/// Inner product; eight running sums, so that the additions need not wait for one another.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (left, right) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in left.zip(right) {
        for (sum, (p, q)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += p * q;
        }
    }
    sums.iter().sum::<f64>() + rest
}

/// Euclidean norm, safe against overflow of the squares.
pub fn norm(a: &[f64]) -> f64 {
    let largest = a.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    if (1e-140..1e140).contains(&largest) {
        return dot(a, a).sqrt();
    }
    largest * a.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_least_squares_line() {
        // Fit 1 + 2x on four points, columns [1, x | y].
        let mut a = vec![1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 2.0, 3.0, 1.0, 3.0, 5.0, 7.0];
        triangularise(&mut a, 4, 2);
        let mut x = [0.0; 2];
        let rhs = a[8..10].to_vec();
        back_substitute(&a, 4, 2, &rhs, &mut x);
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 2.0).abs() < 1e-14);
        assert!(a[1] == 0.0 && a[10].abs() < 1e-14 && a[11].abs() < 1e-14);
    }

    #[test]
    fn triangle_survives_extremes() {
        for size in [1e-170, 1e-300, 1e160, 1e300] {
            let mut a = vec![3.0 * size, 4.0 * size, 5.0, 10.0];
            triangularise(&mut a, 2, 2);
            assert!((a[0] / size + 5.0).abs() < 1e-14 && a[1] == 0.0);
            assert!((a[2] + 11.0).abs() < 1e-13 && (a[3].abs() - 2.0).abs() < 1e-13, "{a:?}");
        }
    }

    #[test]
    fn norm_survives_extremes() {
        assert!((norm(&[3e200, 4e200]) / 5e200 - 1.0).abs() < 1e-15);
        assert_eq!(norm(&[0.0, 0.0]), 0.0);
    }
}
