//! C (sI − A)⁻¹ B + D at many points, an input that does not reach an output exactly zero.
//! (Python side: models/linear/linear_system.py)

use num_complex::Complex64;

use crate::error::CoreError;
use crate::linear::discretisation::StateSpace;
use crate::numerics::complex_lu::ComplexLu;

/// Responses at the points, (`n_outputs`, `n_inputs`, `n_points`); the delays take no part.
///
/// # Errors
/// `Singular` where a point is an eigenvalue of A.
pub fn responses(
    system: &StateSpace<'_>,
    n_inputs: usize,
    points: &[Complex64],
) -> Result<Vec<Complex64>, CoreError> {
    let n = system.a.len().isqrt();
    let mut found = vec![Complex64::default(); system.n_outputs * n_inputs * points.len()];
    let mut x = vec![Complex64::default(); n];
    for (place, &s) in points.iter().enumerate() {
        let mut pencil: Vec<_> = system.a.iter().map(|a| Complex64::from(-a)).collect();
        (0..n).for_each(|k| pencil[k * n + k] += s);
        let factors = ComplexLu::new(pencil, n)?;
        for input in 0..n_inputs {
            let column = system.b.iter().skip(input).step_by(n_inputs);
            x.iter_mut().zip(column).for_each(|(entry, b)| *entry = Complex64::from(*b));
            factors.solve(&mut x);
            for output in 0..system.n_outputs {
                let pair = output * n_inputs + input;
                let row = &system.c[output * n..(output + 1) * n];
                let seen: Complex64 = row.iter().zip(&x).map(|(c, x)| x * *c).sum();
                found[pair * points.len() + place] = seen + system.d[pair];
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three lags of 1, 2 and 3 rad/s in parallel, their states mixed.
    #[test]
    fn a_sum_of_lags_is_found_behind_a_change_of_states() {
        // T diag(−1, −2, −3) T⁻¹ with T = [1 1 0; 0 1 1; 0 0 1].
        let a = [-1.0, -1.0, 1.0, 0.0, -2.0, -1.0, 0.0, 0.0, -3.0];
        let (b, c, d) = ([2.0, 2.0, 1.0], [1.0, -1.0, 2.0], [0.5]);
        let system = StateSpace { a: &a, b: &b, c: &c, d: &d, delays_s: &[0.0], n_outputs: 1 };
        let points = [Complex64::new(0.0, 0.7), Complex64::new(0.0, 40.0)];
        let found = responses(&system, 1, &points).unwrap();
        for (s, value) in points.iter().zip(found) {
            // T⁻¹ b = (1, 1, 1), c T = (1, 0, 1).
            let known = (s + 1.0).inv() + (s + 3.0).inv() + 0.5;
            assert!((value - known).norm() < 1e-14, "{value} for {known}");
        }
    }

    #[test]
    fn a_pole_is_refused() {
        let one = [1.0];
        let system =
            StateSpace { a: &one, b: &one, c: &one, d: &one, delays_s: &[0.0], n_outputs: 1 };
        assert!(responses(&system, 1, &[Complex64::new(1.0, 0.0)]).is_err());
    }
}
