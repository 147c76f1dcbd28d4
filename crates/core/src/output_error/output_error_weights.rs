//! How output error weighs residuals: the noise covariance and robust weights.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::output_error::record_data::RecordData;

/// Smallest noise that is believed, as a share of an output's size.
const FLOOR: f64 = 1e-9;

/// What is assumed of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Noise of different outputs may be correlated.
    pub full: bool,
    /// Huber's limit k, in deviations, beyond which residuals count less; infinite for Gauss.
    pub limit: f64,
    /// Variance that is left of Gaussian noise when the limit cuts it: E min(u², k²).
    pub consistency: f64,
}

/// Sums over residuals that were whitened by the present weights.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Moments {
    /// Number of samples.
    pub count: usize,
    /// Σ ψ(u) ψ(u)ᵀ with the limited residuals ψ = w u, p × p.
    pub products: Vec<f64>,
    /// Σ 2ρ(u), the sum of squares without a limit.
    pub cost: f64,
}

impl Moments {
    /// No residuals of `p` outputs yet.
    pub fn new(p: usize) -> Self {
        Self { count: 0, products: vec![0.0; p * p], cost: 0.0 }
    }

    /// Sum in the order given.
    pub fn total(parts: Vec<Self>) -> Self {
        let mut parts = parts.into_iter();
        let mut sum = parts.next().unwrap_or_default();
        for part in parts {
            sum.count += part.count;
            sum.cost += part.cost;
            sum.products.iter_mut().zip(&part.products).for_each(|(into, each)| *into += each);
        }
        sum
    }

    /// Whether every sum is finite.
    pub fn is_finite(&self) -> bool {
        self.cost.is_finite() && self.products.iter().all(|value| value.is_finite())
    }
}

/// Weights at one point of linearisation.
#[derive(Debug, Clone)]
pub struct Weights {
    noise: Noise,
    n_outputs: usize,
    /// L with R = L Lᵀ, and its inverse, lower, row-major.
    factor: Vec<f64>,
    inverse: Vec<f64>,
    floor: Vec<f64>,
}

impl Weights {
    /// Start from the size of each output.
    ///
    /// # Errors
    /// `Range` for a limit without meaning, `NotFinite` for measurements that are not finite.
    pub fn new(noise: &Noise, data: &[RecordData], p: usize) -> Result<Self, CoreError> {
        if !(noise.limit > 0.0 && noise.consistency > 0.0) {
            let (found, needed) = (noise.limit, "a positive number");
            return Err(CoreError::Range { what: "limit of the loss", found, needed });
        }
        let mut size = vec![0.0; p];
        let mut count = 0.0;
        for each in data {
            if let Some(index) = each.measured.iter().position(|value| !value.is_finite()) {
                return Err(CoreError::NotFinite { what: "the measured outputs", index });
            }
            // A constant says nothing of the size: differences from the first sample do.
            for row in each.measured.chunks_exact(p.max(1)) {
                count += 1.0;
                for ((sum, value), first) in size.iter_mut().zip(row).zip(&each.measured) {
                    *sum += (value - first).powi(2);
                }
            }
        }
        let size: Vec<f64> = size
            .iter()
            .map(|sum| (sum / f64::max(count, 1.0)).sqrt())
            .map(|size| if size > 0.0 { size } else { 1.0 })
            .collect();
        let diagonal = |f: &dyn Fn(f64) -> f64| {
            let mut matrix = vec![0.0; p * p];
            size.iter().enumerate().for_each(|(k, &value)| matrix[k * (p + 1)] = f(value));
            matrix
        };
        Ok(Self {
            noise: *noise,
            n_outputs: p,
            factor: diagonal(&|size| size),
            inverse: diagonal(&|size| 1.0 / size),
            floor: size.iter().map(|size| (FLOOR * size).powi(2)).collect(),
        })
    }

    /// L⁻¹, lower, row-major.
    pub fn inverse(&self) -> &[f64] {
        &self.inverse
    }

    /// Weight of a whitened residual.
    pub fn weight(&self, u: f64) -> f64 {
        if u.abs() <= self.noise.limit { 1.0 } else { self.noise.limit / u.abs() }
    }

    /// 2ρ of a whitened residual.
    pub fn twice_loss(&self, u: f64) -> f64 {
        let k = self.noise.limit;
        if u.abs() <= k { u * u } else { k * (2.0 * u.abs() - k) }
    }

    /// Whiten one sample's rows in place.
    pub fn whiten(&self, rows: &mut [f64], stride: usize) {
        let p = self.n_outputs;
        for i in (0..p).rev() {
            let (before, from) = rows.split_at_mut(i * stride);
            let row = &mut from[..stride];
            let own = self.inverse[i * (p + 1)];
            row.iter_mut().for_each(|entry| *entry *= own);
            if self.noise.full {
                for (j, other) in before.chunks_exact(stride).enumerate() {
                    let factor = self.inverse[i * p + j];
                    row.iter_mut().zip(other).for_each(|(entry, value)| *entry += factor * value);
                }
            }
        }
    }

    /// Take R anew from residuals that were whitened by the present one.
    ///
    /// # Errors
    /// `NotFinite` for sums that are not finite, `Singular` where R has no factor.
    pub fn update(&mut self, moments: &Moments) -> Result<(), CoreError> {
        if !moments.is_finite() {
            return Err(CoreError::NotFinite { what: "the residuals", index: 0 });
        }
        let p = self.n_outputs;
        let scale = 1.0 / (self.noise.consistency * (moments.count as f64).max(1.0));
        let mut r = vec![0.0; p * p];
        for i in 0..p {
            for j in 0..=i {
                if i == j || self.noise.full {
                    let mut sum = 0.0;
                    for a in 0..=i {
                        for b in 0..=j {
                            let product = moments.products[a * p + b];
                            sum += self.factor[i * p + a] * product * self.factor[j * p + b];
                        }
                    }
                    (r[i * p + j], r[j * p + i]) = (sum * scale, sum * scale);
                }
            }
            r[i * (p + 1)] = r[i * (p + 1)].max(self.floor[i]);
        }
        self.factor = cholesky(&r, p)?;
        self.inverse = inverse_of(&self.factor, p);
        Ok(())
    }

    /// R.
    pub fn covariance(&self) -> Vec<f64> {
        let (p, l) = (self.n_outputs, &self.factor);
        (0..p * p).map(|k| (0..p).map(|c| l[(k / p) * p + c] * l[(k % p) * p + c]).sum()).collect()
    }

    /// ½ Σ 2ρ(u) + κ (N/2) ln det R.
    pub fn objective(&self, moments: &Moments) -> f64 {
        let p = self.n_outputs;
        let logarithm: f64 = (0..p).map(|k| self.factor[k * (p + 1)].ln()).sum();
        0.5 * moments.cost + self.noise.consistency * moments.count as f64 * logarithm
    }
}

/// Lower factor of a covariance. Outputs whose noise is one and the same get a hair of their own.
fn cholesky(r: &[f64], p: usize) -> Result<Vec<f64>, CoreError> {
    let mut l = vec![0.0; p * p];
    for i in 0..p {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i * p + k] * l[j * p + k]).sum();
            let left = r[i * p + j] - sum;
            if i != j {
                l[i * p + j] = left / l[j * p + j];
                continue;
            }
            let least = 1e-12 * r[i * (p + 1)];
            l[i * (p + 1)] = left.max(least).sqrt();
            if !l[i * (p + 1)].is_normal() {
                return Err(CoreError::Singular { what: "the noise covariance" });
            }
        }
    }
    Ok(l)
}

fn inverse_of(l: &[f64], p: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; p * p];
    for j in 0..p {
        for i in j..p {
            let unit = if i == j { 1.0 } else { 0.0 };
            let sum: f64 = (j..i).map(|k| l[i * p + k] * inverse[k * p + j]).sum();
            inverse[i * p + j] = (unit - sum) / l[i * (p + 1)];
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: Noise = Noise { full: true, limit: f64::INFINITY, consistency: 1.0 };

    fn data() -> Vec<RecordData> {
        vec![RecordData { measured: vec![0.0, 0.0, 2.0, -4.0], ..RecordData::default() }]
    }

    #[test]
    fn the_covariance_is_that_of_the_residuals() {
        let mut weights = Weights::new(&NOISE, &data(), 2).unwrap();
        let residuals = [[1.0, 0.5], [-2.0, 0.3], [0.4, -1.0]];
        for _ in 0..2 {
            let mut moments = Moments { count: 3, ..Moments::new(2) };
            for each in residuals {
                let mut u = each;
                weights.whiten(&mut u, 1);
                for k in 0..4 {
                    moments.products[k] += u[k / 2] * u[k % 2];
                }
            }
            weights.update(&moments).unwrap();
        }
        for (k, found) in weights.covariance().iter().enumerate() {
            let wanted: f64 = residuals.iter().map(|e| e[k / 2] * e[k % 2]).sum::<f64>() / 3.0;
            assert!((found - wanted).abs() < 1e-14, "{found} {wanted}");
        }
    }

    #[test]
    fn beyond_the_limit_the_loss_is_straight() {
        let noise = Noise { limit: 2.0, consistency: 0.95, ..NOISE };
        let weights = Weights::new(&noise, &data(), 2).unwrap();
        assert_eq!(weights.twice_loss(-1.0), 1.0);
        assert_eq!(weights.twice_loss(-3.0), 8.0);
        assert_eq!(weights.weight(4.0), 0.5);
        assert!(Weights::new(&Noise { limit: 0.0, ..NOISE }, &data(), 2).is_err());
    }
}
