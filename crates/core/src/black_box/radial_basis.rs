//! Radial basis functions of the distance to a centre. (Python side: models/narx/model.py)
//!
//! Reference: Chen, Cowan & Grant, "Orthogonal least squares learning algorithm for radial basis
//! function networks", IEEE Trans. Neural Networks 2 (1991), section II.

use crate::error::CoreError;
use crate::numerics::decay::decay;
use crate::numerics::widest::widest;

/// Samples whose distances are found before their functions.
const BLOCK: usize = 64;
/// Partial sums of a squared distance.
const LANES: usize = 4;

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
        let mut value = [squared];
        self.replace(&mut value, beta);
        value[0]
    }

    /// Values in place of squared distances.
    #[inline(always)]
    fn replace(self, squared: &mut [f64], beta: f64) {
        let power = beta * beta;
        match self {
            Self::Gaussian => squared.iter_mut().for_each(|each| *each = decay(*each / power)),
            Self::Multiquadric => {
                squared.iter_mut().for_each(|each| *each = (*each + power).sqrt())
            }
            Self::InverseMultiquadric => {
                squared.iter_mut().for_each(|each| *each = 1.0 / (*each + power).sqrt());
            }
            Self::ThinPlate => squared.iter_mut().filter(|each| **each > 0.0).for_each(|each| {
                *each *= 0.5 * each.ln();
            }),
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

    /// `sum` and the weighted functions at `x`, added one after the other.
    pub fn add_weighted(&self, mut sum: f64, weights: &[f64], x: &[f64]) -> f64 {
        let mut values = [0.0; BLOCK];
        let centres = self.centres.chunks(BLOCK * self.dimension);
        for (centres, weights) in centres.zip(weights.chunks(BLOCK)) {
            let values = &mut values[..weights.len()];
            widest(
                #[inline(always)]
                || {
                    squared_distances(centres, x, values);
                    self.kernel.replace(values, self.beta);
                },
            );
            for (weight, value) in weights.iter().zip(values) {
                sum += weight * *value;
            }
        }
        sum
    }

    /// Function `index` at every row of the regressors.
    pub(crate) fn fill(&self, index: usize, regressors: &[f64], values: &mut [f64]) {
        let centre = &self.centres[index * self.dimension..(index + 1) * self.dimension];
        let rows = regressors.chunks(BLOCK * self.dimension);
        for (values, rows) in values.chunks_mut(BLOCK).zip(rows) {
            widest(
                #[inline(always)]
                || {
                    squared_distances(rows, centre, values);
                    self.kernel.replace(values, self.beta);
                },
            );
        }
    }
}

/// ‖a − b‖².
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    total(partial_sums(a, b), a, b)
}

/// ‖x − centre‖² of up to `BLOCK` rows x.
#[inline(always)]
fn squared_distances(rows: &[f64], centre: &[f64], found: &mut [f64]) {
    let mut sums = [[0.0; LANES]; BLOCK];
    let sums = &mut sums[..found.len()];
    for (sums, x) in sums.iter_mut().zip(rows.chunks_exact(centre.len())) {
        *sums = partial_sums(x, centre);
    }
    if centre.len().is_multiple_of(LANES) {
        found.iter_mut().zip(sums).for_each(|(each, sums)| *each = total(*sums, &[], &[]));
        return;
    }
    let rows = rows.chunks_exact(centre.len());
    for ((each, sums), x) in found.iter_mut().zip(sums).zip(rows) {
        *each = total(*sums, x, centre);
    }
}

/// Squared differences in four sums, so that the compiler can use vector registers.
#[inline(always)]
fn partial_sums(a: &[f64], b: &[f64]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (x, c) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let difference = x[lane] - c[lane];
            sums[lane] += difference * difference;
        }
    }
    sums
}

/// The sums with what does not fill four.
#[inline(always)]
fn total(sums: [f64; LANES], a: &[f64], b: &[f64]) -> f64 {
    let (rest, other) = (a.chunks_exact(LANES).remainder(), b.chunks_exact(LANES).remainder());
    let tail: f64 = rest.iter().zip(other).map(|(x, c)| (x - c).powi(2)).sum();
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
    fn columns_are_the_values_one_by_one() {
        for (n, dimension) in [(1, 1), (63, 3), (130, 4), (70, 9)] {
            let x: Vec<f64> = (0..n * dimension).map(|i| (1.0 + i as f64).sin()).collect();
            for name in ["gaussian", "multiquadric", "inverse_multiquadric", "thin_plate"] {
                let kernel = Kernel::from_name(name).unwrap();
                let radial = Radial::new(kernel, 1.5, &x, dimension).unwrap();
                let mut values = vec![0.0; n];
                radial.fill(n / 2, &x, &mut values);
                for (value, row) in values.iter().zip(x.chunks(dimension)) {
                    assert_eq!(*value, radial.value(n / 2, row));
                }
                let (weights, at) = (&x[..n], &x[..dimension]);
                let sum = (0..n).fold(2.0, |sum, k| sum + weights[k] * radial.value(k, at));
                assert_eq!(radial.add_weighted(2.0, weights, at), sum);
            }
        }
    }

    #[test]
    fn refuses_what_has_no_meaning() {
        assert!(Radial::new(Kernel::Gaussian, 0.0, &[0.0], 1).is_err());
        assert!(Radial::new(Kernel::Gaussian, 1.0, &[0.0; 3], 2).is_err());
        assert!(Radial::new(Kernel::Gaussian, 1.0, &[f64::NAN], 1).is_err());
        assert!(Kernel::from_name("cubic").is_err());
    }
}
