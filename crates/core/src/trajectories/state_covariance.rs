//! The covariance of a filtered state: corrected by a measurement, moved by a transition, on any scalar.
//! (Python side: none)

use crate::error::CoreError;
use crate::numerics::dual::Scalar;
use crate::trajectories::scalar_equations::{Factor, dot};

/// Take a measurement into state and covariance; gives the triangle of the innovations' covariance and
/// the whitened innovation.
pub(crate) fn correct<S: Scalar>(
    state: &mut [S],
    covariance: &mut [S],
    observed: &[Factor<S>],
    innovation: &[S],
    noise: &[S],
) -> Result<(Vec<S>, Vec<S>), CoreError> {
    let (size, p) = (state.len(), innovation.len());
    let zero = S::constant(0.0);
    // P Cᵀ by output, then its whitened form L⁻¹ C P, whose square is what the covariance loses.
    let mut gain = vec![zero; p * size];
    for each in observed {
        let (to, from) = (&mut gain[each.row * size..][..size], &covariance[each.column * size..]);
        for (to, &from) in to.iter_mut().zip(from) {
            *to = *to + each.value * from;
        }
    }
    let mut triangle = vec![zero; p * p];
    for each in observed {
        for j in 0..=each.row {
            let place = each.row * p + j;
            triangle[place] = triangle[place] + each.value * gain[j * size + each.column];
        }
    }
    (0..p).for_each(|k| triangle[k * p + k] = triangle[k * p + k] + noise[k]);
    cholesky(&mut triangle, p)?;
    let mut white = innovation.to_vec();
    for i in 0..p {
        let inverse = S::constant(1.0) / triangle[i * p + i];
        for j in 0..i {
            let factor = triangle[i * p + j];
            white[i] = white[i] - factor * white[j];
            let (done, rest) = gain.split_at_mut(i * size);
            for (to, &from) in rest[..size].iter_mut().zip(&done[j * size..][..size]) {
                *to = *to - factor * from;
            }
        }
        white[i] = white[i] * inverse;
        gain[i * size..][..size].iter_mut().for_each(|entry| *entry = *entry * inverse);
    }
    for (k, &white) in white.iter().enumerate() {
        let gain = &gain[k * size..][..size];
        for i in 0..size {
            state[i] = state[i] + gain[i] * white;
            for j in 0..=i {
                let place = i * size + j;
                covariance[place] = covariance[place] - gain[i] * gain[j];
            }
        }
    }
    mirror(covariance, size);
    Ok((triangle, white))
}

/// P ← Φ P Φᵀ + Q, where Φ (n × inner) moves the first n of the state and all others stand still.
pub(crate) fn spread<S: Scalar>(
    covariance: &mut [S],
    transition: &[S],
    process: &[S],
    step: f64,
    size: usize,
) {
    let n = process.len();
    let inner = transition.len() / n;
    let zero = S::constant(0.0);
    let phi = |i: usize| &transition[i * inner..][..inner];
    let mut half = vec![zero; n * size];
    for i in 0..n {
        let to = &mut half[i * size..][..size];
        for (k, &factor) in phi(i).iter().enumerate() {
            for (to, &from) in to.iter_mut().zip(&covariance[k * size..][..size]) {
                *to = *to + factor * from;
            }
        }
    }
    for i in 0..n {
        let weighed: Vec<S> = phi(i).iter().zip(process).map(|(&phi, &w)| phi * w).collect();
        for j in 0..=i {
            let through = dot(&weighed, &phi(j)[..n]);
            let once = weighed[j] + process[i] * phi(j)[i];
            let own = if i == j { process[i] } else { zero };
            let added = S::constant(2.0) * (own + through) + once;
            covariance[i * size + j] =
                dot(&half[i * size..][..inner], phi(j)) + S::constant(step / 6.0) * added;
        }
        for j in n..size {
            covariance[j * size + i] = half[i * size + j];
        }
    }
    mirror(covariance, size);
}

/// The upper triangle from the lower one.
fn mirror<S: Scalar>(matrix: &mut [S], size: usize) {
    for i in 0..size {
        (0..i).for_each(|j| matrix[j * size + i] = matrix[i * size + j]);
    }
}

/// Lower triangle in place of a matrix that is positive definite.
fn cholesky<S: Scalar>(matrix: &mut [S], n: usize) -> Result<(), CoreError> {
    for j in 0..n {
        let (above, below) = matrix.split_at_mut((j + 1) * n);
        let row = &mut above[j * n..];
        let own = row[j] - dot(&row[..j], &row[..j]);
        // Not "at most zero": NaN is not above either.
        if !(own.real() > 0.0 && own.real().is_finite()) {
            return Err(CoreError::Singular { what: "the covariance of the innovations" });
        }
        row[j] = own.sqrt();
        let inverse = S::constant(1.0) / row[j];
        for other in below.chunks_exact_mut(n) {
            other[j] = (other[j] - dot(&other[..j], &row[..j])) * inverse;
        }
        row[j + 1..].fill(S::constant(0.0));
    }
    Ok(())
}
