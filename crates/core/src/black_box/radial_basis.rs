//! Radial basis functions of the distance to a centre. (Python side: models/narx/model.py)
//!
//! Reference: Chen, Cowan & Grant, "Orthogonal least squares learning algorithm for radial basis
//! function networks", IEEE Trans. Neural Networks 2 (1991), section II.

use rayon::prelude::*;

use crate::error::CoreError;

/// Shape of a radial function of distance d and width β.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// exp(−d²/β²).
    Gaussian,
    /// √(d² + β²).
    Multiquadric,
    /// 1/√(d² + β²).
    InverseMultiquadric,
    /// d² ln d, without width.
    ThinPlate,
}

impl Kernel {
    /// The kernel of a stable name.
    ///
    /// # Errors
    /// A name that is none of the four.
    pub fn from_name(name: &str) -> Result<Self, CoreError> {
        match name {
            "gaussian" => Ok(Self::Gaussian),
            "multiquadric" => Ok(Self::Multiquadric),
            "inverse_multiquadric" => Ok(Self::InverseMultiquadric),
            "thin_plate" => Ok(Self::ThinPlate),
            _ => Err(CoreError::UnknownName { name: name.to_owned() }),
        }
    }

    /// Value at a squared distance.
    pub fn value(self, squared: f64, beta: f64) -> f64 {
        match self {
            Self::Gaussian => (-squared / (beta * beta)).exp(),
            Self::Multiquadric => (squared + beta * beta).sqrt(),
            Self::InverseMultiquadric => 1.0 / (squared + beta * beta).sqrt(),
            Self::ThinPlate if squared > 0.0 => 0.5 * squared * squared.ln(),
            Self::ThinPlate => 0.0,
        }
    }
}

/// Functions of one kernel and width at several centres.
#[derive(Debug, Clone, Copy)]
pub struct Radial<'a> {
    /// Shape.
    pub kernel: Kernel,
    /// Width β, in the unit of the regressors.
    pub beta: f64,
    /// Centres, (n_centres × dimension), row-major.
    pub centres: &'a [f64],
    /// Length of a regressor vector.
    pub dimension: usize,
}

impl<'a> Radial<'a> {
    /// Check the parts.
    ///
    /// # Errors
    /// A width that is not positive; centres that do not fill rows or are not finite.
    pub fn new(
        kernel: Kernel,
        beta: f64,
        centres: &'a [f64],
        dimension: usize,
    ) -> Result<Self, CoreError> {
        if !(beta.is_finite() && beta > 0.0) {
            let needed = "a positive, finite width";
            return Err(CoreError::Range { what: "the radial width", found: beta, needed });
        }
        if dimension == 0 || !centres.len().is_multiple_of(dimension) {
            let (found, needed) = (centres.len(), dimension);
            return Err(CoreError::Shape { what: "values of the centres", found, needed });
        }
        require_finite("the centres", centres)?;
        Ok(Self { kernel, beta, centres, dimension })
    }

    /// Number of centres.
    pub fn len(&self) -> usize {
        self.centres.len() / self.dimension
    }

    /// Whether there is no centre.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }

    /// Value of function `index` at `x`.
    pub fn value(&self, index: usize, x: &[f64]) -> f64 {
        let centre = &self.centres[index * self.dimension..(index + 1) * self.dimension];
        self.kernel.value(squared_distance(x, centre), self.beta)
    }

    /// Function `index` at every row of the regressors.
    pub(crate) fn fill(&self, index: usize, regressors: &[f64], values: &mut [f64]) {
        let rows = regressors.chunks_exact(self.dimension);
        values.iter_mut().zip(rows).for_each(|(value, x)| *value = self.value(index, x));
    }

    /// All functions at every row of the regressors, one function after the other.
    pub fn columns(&self, regressors: &[f64]) -> Vec<f64> {
        let n = regressors.len() / self.dimension;
        let mut values = vec![0.0; n * self.len()];
        let columns = values.par_chunks_exact_mut(n.max(1)).enumerate();
        columns.for_each(|(index, column)| self.fill(index, regressors, column));
        values
    }
}

/// ‖a − b‖², in four partial sums so that the compiler can use vector registers.
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(x, c)| (x - c).powi(2)).sum();
    for (x, c) in a4.zip(b4) {
        for lane in 0..4 {
            let difference = x[lane] - c[lane];
            sums[lane] += difference * difference;
        }
    }
    sums[0] + sums[1] + sums[2] + sums[3] + tail
}

/// Refuse NaN and infinity.
///
/// # Errors
/// With the first place that holds one.
pub fn require_finite(what: &'static str, values: &[f64]) -> Result<(), CoreError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(CoreError::NotFinite { what, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_by_hand() {
        let x = [1.0, 2.0, 2.0, 0.0, 0.0];
        let centres = [0.0; 5];
        let at = |kernel| Radial::new(kernel, 2.0, &centres, 5).unwrap().value(0, &x);
        assert!((at(Kernel::Gaussian) - (-9.0_f64 / 4.0).exp()).abs() < 1e-16);
        assert!((at(Kernel::Multiquadric) - 13.0_f64.sqrt()).abs() < 1e-15);
        assert!((at(Kernel::InverseMultiquadric) - 1.0 / 13.0_f64.sqrt()).abs() < 1e-16);
        assert!((at(Kernel::ThinPlate) - 9.0 * 3.0_f64.ln()).abs() < 1e-14);
        assert_eq!(Kernel::ThinPlate.value(0.0, 1.0), 0.0);
    }

    #[test]
    fn refuses_what_has_no_meaning() {
        assert!(Radial::new(Kernel::Gaussian, 0.0, &[0.0], 1).is_err());
        assert!(Radial::new(Kernel::Gaussian, 1.0, &[0.0; 3], 2).is_err());
        assert!(Radial::new(Kernel::Gaussian, 1.0, &[f64::NAN], 1).is_err());
        assert!(Kernel::from_name("cubic").is_err());
    }
}
