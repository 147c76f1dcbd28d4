//! Inner products and orthogonalisation of long vectors.
//! (Python side: identification/narx/fit.py)

use super::widest::widest;

/// Columns that one reading of the candidates is multiplied by: with four, reading from memory and
/// multiplying take about equally long.
pub const AT_ONCE: usize = 4;

/// Inner product in eight partial sums, so that the compiler can use vector registers.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    widest(
        #[inline(always)]
        || sum_of_products(a, b),
    )
}

#[inline(always)]
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for lane in 0..8 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + tail
}

/// Inner products of `a`, which the nearest cache holds, with several vectors of its length.
pub fn dots(a: &[f64], vectors: [&[f64]; AT_ONCE]) -> [f64; AT_ONCE] {
    vectors.map(|vector| dot(a, vector))
}

/// w − factor · q.
pub fn subtract(w: &mut [f64], factor: f64, q: &[f64]) {
    widest(
        #[inline(always)]
        || w.iter_mut().zip(q).for_each(|(entry, direction)| *entry -= factor * direction),
    );
}

/// Take the directions out of `w`, twice (one pass of Gram–Schmidt loses orthogonality); returns
/// the coefficients.
pub fn orthogonalise(w: &mut [f64], directions: &[Vec<f64>]) -> Vec<f64> {
    let mut coefficients = vec![0.0; directions.len()];
    for _ in 0..2 {
        let found: Vec<f64> = directions.iter().map(|q| dot(q, w)).collect();
        for ((q, value), total) in directions.iter().zip(&found).zip(&mut coefficients) {
            subtract(w, *value, q);
            *total += value;
        }
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_products_of_every_length() {
        for n in 0..23 {
            let a: Vec<f64> = (0..n).map(|i| i as f64 - 3.0).collect();
            let b: Vec<f64> = (0..n).map(|i| 2.0 * i as f64 + 1.0).collect();
            let exact: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
            assert_eq!(dot(&a, &b), exact);
            assert_eq!(dots(&a, [&b, &a, &b, &b])[0], exact);
            assert_eq!(dots(&a, [&b, &b, &b, &a])[3], dot(&a, &a));
        }
    }
}
