//! Roots of real polynomials, and polynomials moved into the unit circle. (Python side:
//! identification/prediction_error/fit.py)

use num_complex::Complex64;

/// Roots stay inside this radius after a reflection.
pub const LARGEST_RADIUS: f64 = 1.0 - 1e-6;
const SWEEPS: usize = 500;

/// Whether all roots z of 1 + p₁z⁻¹ + … + pₙz⁻ⁿ lie inside a circle, by the Schur–Cohn recursion.
///
/// Reference: Åström, *Introduction to Stochastic Control Theory* (1970), chapter 5, theorem 2.1.
pub fn is_inside(polynomial: &[f64], radius: f64) -> bool {
    let mut p: Vec<f64> = polynomial
        .iter()
        .enumerate()
        .map(|(k, value)| value / radius.powi(i32::try_from(k).unwrap_or(i32::MAX)))
        .collect();
    while p.len() > 1 {
        let last = p[p.len() - 1] / p[0];
        if last.is_nan() || last.abs() >= 1.0 {
            return false;
        }
        let n = p.len();
        let lower: Vec<f64> = (0..n - 1).map(|k| p[k] - last * p[n - 1 - k]).collect();
        p = lower;
    }
    true
}

/// Roots z of p₀zⁿ + p₁zⁿ⁻¹ + … + pₙ with p₀ not zero, by simultaneous iteration.
///
/// Reference: Aberth (1973), Iteration methods for finding all zeros of a polynomial simultaneously,
/// Math. Comp. 27.
pub fn roots(polynomial: &[f64]) -> Vec<Complex64> {
    let n = polynomial.len().saturating_sub(1);
    if n == 0 {
        return Vec::new();
    }
    let lead = polynomial[0];
    let bound = 1.0 + polynomial[1..].iter().fold(0.0_f64, |most, x| most.max((x / lead).abs()));
    let radius = bound.min(2.0) * 0.7;
    // Not symmetric about the real axis, where pairs of starts would stay pairs for ever.
    let mut z: Vec<Complex64> = (0..n)
        .map(|k| Complex64::from_polar(radius, 0.4 + std::f64::consts::TAU * k as f64 / n as f64))
        .collect();
    for _ in 0..SWEEPS {
        let mut largest = 0.0_f64;
        for k in 0..n {
            let newton = newton_step(polynomial, z[k]);
            let repulsion: Complex64 =
                (0..n).filter(|&j| j != k).map(|j| (z[k] - z[j]).finv()).sum();
            let step = newton / (1.0 - newton * repulsion);
            if step.is_finite() {
                z[k] -= step;
                largest = largest.max(step.norm() / z[k].norm().max(1e-300));
            }
        }
        if largest < 1e-15 {
            break;
        }
    }
    z
}

fn newton_step(polynomial: &[f64], z: Complex64) -> Complex64 {
    let (mut value, mut slope) = (Complex64::default(), Complex64::default());
    for &coefficient in polynomial {
        slope = slope * z + value;
        value = value * z + coefficient;
    }
    if value.norm() == 0.0 { Complex64::default() } else { value / slope }
}

/// The monic polynomial with every root outside `LARGEST_RADIUS` reflected into the circle (the
/// spectrum keeps its shape) or, right at the circle, pulled inside; `None` where none is outside.
pub fn reflected(polynomial: &[f64]) -> Option<Vec<f64>> {
    if is_inside(polynomial, LARGEST_RADIUS) {
        return None;
    }
    let mut product = vec![Complex64::new(1.0, 0.0)];
    for root in roots(polynomial) {
        let size = root.norm();
        let inside = if size > 1.0 { root / (size * size) } else { root };
        let kept = inside * (LARGEST_RADIUS / inside.norm()).min(1.0);
        let mut next = product.clone();
        next.push(Complex64::default());
        for (k, coefficient) in product.iter().enumerate() {
            next[k + 1] -= kept * coefficient;
        }
        product = next;
    }
    Some(product.into_iter().map(|value| value.re).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_simple_double_and_complex_roots() {
        // (z - 2)(z + 0.5)²(z² + 0.81)
        let p = [1.0, -1.0, -0.94, -1.31, -1.4175, -0.405];
        let mut found = roots(&p);
        found.sort_by(|a, b| a.re.total_cmp(&b.re));
        for (root, size) in found.iter().zip([0.5, 0.5, 0.9, 0.9, 2.0]) {
            assert!((root.norm() - size).abs() < 1e-6, "{root}");
        }
    }

    #[test]
    fn knows_the_circle() {
        assert!(is_inside(&[1.0, -0.5], 1.0) && !is_inside(&[1.0, -0.5], 0.4));
        assert!(!is_inside(&[1.0, 0.0, 1.0], 1.0) && is_inside(&[1.0], 1.0));
        assert!(!is_inside(&[1.0, f64::NAN], 1.0));
    }

    #[test]
    fn reflects_what_is_outside_and_nothing_else() {
        assert!(reflected(&[1.0, -0.5]).is_none());
        // (1 - 2z⁻¹)(1 - 0.5z⁻¹) becomes (1 - 0.5z⁻¹)².
        let found = reflected(&[1.0, -2.5, 1.0]).unwrap();
        for (value, wanted) in found.iter().zip([1.0, -1.0, 0.25]) {
            assert!((value - wanted).abs() < 1e-7, "{found:?}");
        }
        let edge = reflected(&[1.0, -1.0]).unwrap();
        assert!((edge[1] + LARGEST_RADIUS).abs() < 1e-12);
    }
}
