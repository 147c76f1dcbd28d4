//! The covariance of a filtered state: corrected by a measurement, moved by a transition, on any scalar.
//! (Python side: none)

use crate::error::CoreError;
use crate::numerics::dual::Scalar;
use crate::trajectories::scalar_equations::{Factor, dot};

/// What a measurement does to state and covariance, sample by sample; buffers last.
#[derive(Debug, Clone)]
pub(crate) struct Correction<S> {
    /// Triangle of the innovations' covariance.
    pub(crate) triangle: Vec<S>,
    /// The whitened innovation.
    pub(crate) white: Vec<S>,
    /// P Cᵀ by output, then its whitened form L⁻¹ C P, whose square is what the covariance loses.
    gain: Vec<S>,
    half: Vec<S>,
    weighed: Vec<S>,
}

impl<S: Scalar> Correction<S> {
    pub(crate) fn new() -> Self {
        let none = Vec::new;
        Self { triangle: none(), white: none(), gain: none(), half: none(), weighed: none() }
    }

    /// Weigh a measurement.
    ///
    /// # Errors
    /// `Singular` where innovations have no covariance.
    pub(crate) fn prepare(
        &mut self,
        covariance: &[S],
        observed: &[Factor<S>],
        innovation: &[S],
        noise: &[S],
    ) -> Result<(), CoreError> {
        let p = innovation.len();
        let size = covariance.len().isqrt();
        let Self { triangle, white, gain, .. } = self;
        clear(gain, p * size);
        for each in observed {
            let to = &mut gain[each.row * size..][..size];
            add_product(to, each.value, &covariance[each.column * size..]);
        }
        clear(triangle, p * p);
        for each in observed {
            for j in 0..=each.row {
                let place = each.row * p + j;
                triangle[place] = triangle[place] + each.value * gain[j * size + each.column];
            }
        }
        (0..p).for_each(|k| triangle[k * p + k] = triangle[k * p + k] + noise[k]);
        cholesky(triangle, p)?;
        white.clear();
        white.extend_from_slice(innovation);
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
        Ok(())
    }

    /// Take the measurement into state and covariance.
    pub(crate) fn apply(&self, state: &mut [S], covariance: &mut [S]) {
        let size = state.len();
        for (&white, gain) in self.white.iter().zip(self.gain.chunks_exact(size)) {
            for i in 0..size {
                state[i] = state[i] + gain[i] * white;
                for j in 0..=i {
                    let place = i * size + j;
                    covariance[place] = covariance[place] - gain[i] * gain[j];
                }
            }
        }
        mirror(covariance, size);
    }

    /// P ← Φ P Φᵀ + Q, where Φ (n × inner) moves the first n of the state and all others stand still.
    pub(crate) fn spread(
        &mut self,
        covariance: &mut [S],
        transition: &[S],
        process: &[S],
        step: f64,
        size: usize,
    ) {
        let n = process.len();
        let inner = transition.len() / n;
        let phi = |i: usize| &transition[i * inner..][..inner];
        let Self { half, weighed, .. } = self;
        clear(half, n * size);
        for i in 0..n {
            let to = &mut half[i * size..][..size];
            for (k, &factor) in phi(i).iter().enumerate() {
                add_product(to, factor, &covariance[k * size..]);
            }
        }
        for i in 0..n {
            weighed.clear();
            weighed.extend(phi(i).iter().zip(process).map(|(&phi, &density)| phi * density));
            for j in 0..=i {
                let through = dot(weighed, &phi(j)[..n]);
                let once = weighed[j] + process[i] * phi(j)[i];
                let added = if i == j { process[i] + through } else { through };
                let added = added.times(2.0) + once;
                covariance[i * size + j] =
                    dot(&half[i * size..][..inner], phi(j)) + added.times(step / 6.0);
            }
            for j in n..size {
                covariance[j * size + i] = half[i * size + j];
            }
        }
        mirror(covariance, size);
    }
}

fn clear<S: Scalar>(buffer: &mut Vec<S>, length: usize) {
    buffer.clear();
    buffer.resize(length, S::constant(0.0));
}

/// A row plus a multiple of another, which may be longer.
fn add_product<S: Scalar>(to: &mut [S], factor: S, row: &[S]) {
    for (to, &from) in to.iter_mut().zip(row) {
        *to = *to + factor * from;
    }
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
