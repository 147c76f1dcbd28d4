//! Matrix exponential by scaling, squaring and a Padé approximant of degree 13.
//!
//! Reference: N. J. Higham, "The scaling and squaring method for the matrix exponential revisited",
//! SIAM J. Matrix Anal. Appl. 26 (2005), algorithm 2.3 (degree 13 only: the matrices here are small,
//! and one path is easier to trust than five).

use crate::error::CoreError;

/// Largest 1-norm for which the degree-13 approximant is accurate to double precision.
const THETA_13: f64 = 5.371_920_351_148_152;
const PADE_13: [f64; 14] = [
    64_764_752_532_480_000.0,
    32_382_376_266_240_000.0,
    7_771_770_303_897_600.0,
    1_187_353_796_428_800.0,
    129_060_195_264_000.0,
    10_559_470_521_600.0,
    670_442_572_800.0,
    33_522_128_640.0,
    1_323_241_920.0,
    40_840_800.0,
    960_960.0,
    16_380.0,
    182.0,
    1.0,
];

fn multiply(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let mut product = vec![0.0; n * n];
    for (row, out) in a.chunks_exact(n).zip(product.chunks_exact_mut(n)) {
        for (&factor, line) in row.iter().zip(b.chunks_exact(n)) {
            for (sum, &value) in out.iter_mut().zip(line) {
                *sum += factor * value;
            }
        }
    }
    product
}

fn one_norm(a: &[f64], n: usize) -> f64 {
    (0..n).map(|j| a.iter().skip(j).step_by(n).map(|v| v.abs()).sum()).fold(0.0, f64::max)
}

/// Solve `a x = b` for square `x` by elimination with row pivots; both are overwritten.
pub(crate) fn solve(a: &mut [f64], b: &mut [f64], n: usize) -> Result<(), CoreError> {
    for k in 0..n {
        let pivot = (k..n)
            .fold(k, |best, i| if a[i * n + k].abs() > a[best * n + k].abs() { i } else { best });
        if a[pivot * n + k] == 0.0 {
            return Err(CoreError::Singular { what: "a matrix to be inverted" });
        }
        for j in 0..n {
            a.swap(k * n + j, pivot * n + j);
            b.swap(k * n + j, pivot * n + j);
        }
        for i in 0..n {
            let factor = a[i * n + k] / a[k * n + k];
            if i == k || factor == 0.0 {
                continue;
            }
            for j in 0..n {
                a[i * n + j] -= factor * a[k * n + j];
                b[i * n + j] -= factor * b[k * n + j];
            }
        }
    }
    for i in 0..n {
        let diagonal = a[i * n + i];
        b[i * n..(i + 1) * n].iter_mut().for_each(|v| *v /= diagonal);
    }
    Ok(())
}

/// `exp(a)` for a row-major square matrix with `n` rows.
///
/// # Errors
/// `Shape` where `a` is not `n × n`, `NotFinite` where it or its exponential holds NaN or infinity.
pub fn exponential(a: &[f64], n: usize) -> Result<Vec<f64>, CoreError> {
    if a.len() != n * n {
        return Err(CoreError::Shape { what: "square matrix", found: a.len(), needed: n * n });
    }
    if let Some(index) = a.iter().position(|v| !v.is_finite()) {
        return Err(CoreError::NotFinite { what: "matrix exponent", index });
    }
    if n == 0 {
        return Ok(Vec::new());
    }
    let norm = one_norm(a, n);
    let squarings = if norm > THETA_13 { (norm / THETA_13).log2().ceil() as i32 } else { 0 };
    let scaled: Vec<f64> = a.iter().map(|v| v * 0.5_f64.powi(squarings)).collect();
    let mut result = pade_13(&scaled, n)?;
    for _ in 0..squarings {
        result = multiply(&result, &result, n);
    }
    match result.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what: "matrix exponential", index }),
        None => Ok(result),
    }
}

fn pade_13(a: &[f64], n: usize) -> Result<Vec<f64>, CoreError> {
    let b = &PADE_13;
    let a2 = multiply(a, a, n);
    let a4 = multiply(&a2, &a2, n);
    let a6 = multiply(&a2, &a4, n);
    let combine = |c6: f64, c4: f64, c2: f64, c0: f64| -> Vec<f64> {
        (0..n * n)
            .map(|i| {
                let identity = if i % (n + 1) == 0 { c0 } else { 0.0 };
                c6 * a6[i] + c4 * a4[i] + c2 * a2[i] + identity
            })
            .collect()
    };
    let add = |x: Vec<f64>, y: Vec<f64>| -> Vec<f64> {
        x.into_iter().zip(y).map(|(p, q)| p + q).collect()
    };
    let high_odd = multiply(&a6, &combine(b[13], b[11], b[9], 0.0), n);
    let odd = multiply(a, &add(high_odd, combine(b[7], b[5], b[3], b[1])), n);
    let high_even = multiply(&a6, &combine(b[12], b[10], b[8], 0.0), n);
    let even = add(high_even, combine(b[6], b[4], b[2], b[0]));
    let mut numerator: Vec<f64> = even.iter().zip(&odd).map(|(v, u)| v + u).collect();
    let mut denominator: Vec<f64> = even.iter().zip(&odd).map(|(v, u)| v - u).collect();
    solve(&mut denominator, &mut numerator, n)?;
    Ok(numerator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_and_decay_are_exact() {
        for angle in [0.1_f64, 3.0, 40.0] {
            let found = exponential(&[-0.1, -angle, angle, -0.1], 2).unwrap();
            let decay = (-0.1_f64).exp();
            let exact = [angle.cos(), -angle.sin(), angle.sin(), angle.cos()];
            for (f, e) in found.iter().zip(exact) {
                assert!((f - decay * e).abs() < 1e-13, "{f} {e}");
            }
        }
    }

    #[test]
    fn nilpotent_matrix_ends_after_its_order() {
        let found = exponential(&[0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0], 3).unwrap();
        let exact = [1.0, 2.0, 3.0, 0.0, 1.0, 3.0, 0.0, 0.0, 1.0];
        assert!(found.iter().zip(exact).all(|(f, e)| (f - e).abs() < 1e-14));
    }

    #[test]
    fn refuses_what_has_no_exponential() {
        assert!(exponential(&[1.0, 2.0], 2).is_err());
        assert!(exponential(&[f64::NAN], 1).is_err());
        assert!(exponential(&[1e4], 1).is_err());
    }
}
