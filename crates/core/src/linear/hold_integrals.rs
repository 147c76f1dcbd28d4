//! e^{Ah} and its integrals over a hold, with exact derivatives. (Python side: simulation/simulate.py)
//!
//! E(h) = e^{Ah}, Γ₁(h) = ∫₀ʰ e^{As} ds answers a constant input and Γ₂(h) = ∫₀ʰ Γ₁(s) ds a ramp.
//! Power series on h/2ˢ, then doubling: E(2h) = E², Γ₁(2h) = Γ₁ + E Γ₁, Γ₂(2h) = Γ₂ + hΓ₁ + E Γ₂.
//! The derivatives by directions dA go through the same steps by the product rule.
//!
//! Reference: Van Loan (1978), IEEE Trans. Automatic Control 23, eq. 1.2; Al-Mohy & Higham (2009),
//! SIAM J. Matrix Analysis 30, §3 (derivatives by scaling and squaring).

use crate::error::CoreError;

const LARGEST: f64 = 0.5;
/// 0.5¹⁷/17! is below a hundredth of the rounding of one.
const TERMS: usize = 17;
const MAXIMUM_DOUBLINGS: f64 = 60.0;

/// A square matrix and its derivatives by some directions, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Jet {
    /// The matrix, n × n.
    pub value: Vec<f64>,
    /// Its derivatives, n × n each.
    pub slopes: Vec<Vec<f64>>,
}

/// result += factor · a · b for n × n matrices.
pub fn add_product(result: &mut [f64], factor: f64, a: &[f64], b: &[f64], n: usize) {
    for i in 0..n {
        for k in 0..n {
            let weight = factor * a[i * n + k];
            if weight != 0.0 {
                for (entry, value) in
                    result[i * n..(i + 1) * n].iter_mut().zip(&b[k * n..(k + 1) * n])
                {
                    *entry += weight * value;
                }
            }
        }
    }
}

impl Jet {
    fn zero(n: usize, directions: usize) -> Self {
        Self { value: vec![0.0; n * n], slopes: vec![vec![0.0; n * n]; directions] }
    }

    fn identity(n: usize, directions: usize) -> Self {
        let mut result = Self::zero(n, directions);
        (0..n).for_each(|i| result.value[i * (n + 1)] = 1.0);
        result
    }

    /// factor · self · other.
    pub fn product(&self, factor: f64, other: &Self, n: usize) -> Self {
        let mut result = Self::zero(n, self.slopes.len());
        add_product(&mut result.value, factor, &self.value, &other.value, n);
        for (k, slope) in result.slopes.iter_mut().enumerate() {
            add_product(slope, factor, &self.slopes[k], &other.value, n);
            add_product(slope, factor, &self.value, &other.slopes[k], n);
        }
        result
    }

    /// self + factor · other, in place.
    pub fn add(&mut self, factor: f64, other: &Self) {
        for (entry, value) in self.value.iter_mut().zip(&other.value) {
            *entry += factor * value;
        }
        for (mine, others) in self.slopes.iter_mut().zip(&other.slopes) {
            for (entry, value) in mine.iter_mut().zip(others) {
                *entry += factor * value;
            }
        }
    }

    fn is_finite(&self) -> bool {
        self.slopes.iter().chain([&self.value]).all(|each| each.iter().all(|v| v.is_finite()))
    }
}

/// E, Γ₁ and Γ₂ over one duration.
#[derive(Debug, Clone)]
pub struct HoldIntegrals {
    /// e^{Ah}.
    pub transition: Jet,
    /// Γ₁.
    pub constant: Jet,
    /// Γ₂.
    pub ramp: Jet,
}

impl HoldIntegrals {
    /// For the n × n matrix `a` with its derivatives, over a duration in seconds.
    ///
    /// # Errors
    /// `NotFinite` where an entry, or a result, is NaN or infinite.
    pub fn new(a: &Jet, n: usize, duration: f64) -> Result<Self, CoreError> {
        if !a.is_finite() {
            return Err(CoreError::NotFinite { what: "matrix exponent", index: 0 });
        }
        let size = (0..n)
            .map(|j| (0..n).map(|i| a.value[i * n + j].abs()).sum::<f64>())
            .fold(0.0, f64::max)
            * duration;
        let doublings = if size > LARGEST { (size / LARGEST).log2().ceil() } else { 0.0 };
        if doublings > MAXIMUM_DOUBLINGS {
            return Err(CoreError::NotFinite { what: "matrix exponential", index: 0 });
        }
        let mut step = duration * 0.5_f64.powi(doublings as i32);
        let mut found = Self::series(a, n, step);
        for _ in 0..doublings as usize {
            found = found.doubled(step, n);
            step *= 2.0;
        }
        if [&found.transition, &found.constant, &found.ramp].iter().all(|jet| jet.is_finite()) {
            Ok(found)
        } else {
            Err(CoreError::NotFinite { what: "matrix exponential", index: 0 })
        }
    }

    fn series(a: &Jet, n: usize, h: f64) -> Self {
        let directions = a.slopes.len();
        let mut term = Jet::identity(n, directions);
        let zero = Jet::zero(n, directions);
        let (mut transition, mut constant, mut ramp) = (term.clone(), zero.clone(), zero);
        constant.add(h, &term);
        ramp.add(0.5 * h * h, &term);
        for k in 1..=TERMS {
            let order = k as f64;
            term = a.product(h / order, &term, n);
            transition.add(1.0, &term);
            constant.add(h / (order + 1.0), &term);
            ramp.add(h * h / ((order + 1.0) * (order + 2.0)), &term);
        }
        Self { transition, constant, ramp }
    }

    fn doubled(&self, h: f64, n: usize) -> Self {
        let e = &self.transition;
        let mut constant = e.product(1.0, &self.constant, n);
        constant.add(1.0, &self.constant);
        let mut ramp = e.product(1.0, &self.ramp, n);
        ramp.add(1.0, &self.ramp);
        ramp.add(h, &self.constant);
        Self { transition: e.product(1.0, e, n), constant, ramp }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::matrix_exponential::exponential;

    const A: [f64; 4] = [-0.4, 3.0, -2.0, -1.1];

    fn jet(a: &[f64]) -> Jet {
        Jet { value: a.to_vec(), slopes: vec![vec![0.3, -1.0, 0.2, 0.7]] }
    }

    #[test]
    fn agrees_with_the_augmented_exponential() {
        for h in [0.0, 0.01, 0.7, 9.0] {
            let found = HoldIntegrals::new(&jet(&A), 2, h).unwrap();
            // [A I 0; 0 0 I; 0 0 0] h.
            let mut augmented = vec![0.0; 36];
            for i in 0..2 {
                for j in 0..2 {
                    augmented[i * 6 + j] = A[i * 2 + j] * h;
                }
                augmented[i * 6 + 2 + i] = h;
                augmented[(2 + i) * 6 + 4 + i] = h;
            }
            let e = exponential(&augmented, 6).unwrap();
            for i in 0..2 {
                for j in 0..2 {
                    let near = |x: f64, y: f64| (x - y).abs() < 1e-12 * (1.0 + y.abs());
                    assert!(near(found.transition.value[i * 2 + j], e[i * 6 + j]));
                    assert!(near(found.constant.value[i * 2 + j], e[i * 6 + 2 + j]));
                    assert!(near(found.ramp.value[i * 2 + j], e[i * 6 + 4 + j]));
                }
            }
        }
    }

    #[test]
    fn slopes_match_differences() {
        let step = 1e-6;
        for h in [0.01, 0.7, 9.0] {
            let at = |sign: f64| {
                let moved = jet(&A);
                let a: Vec<f64> =
                    A.iter().zip(&moved.slopes[0]).map(|(v, d)| v + sign * step * d).collect();
                HoldIntegrals::new(&jet(&a), 2, h).unwrap()
            };
            let (up, down, here) = (at(1.0), at(-1.0), at(0.0));
            let pick: [fn(&HoldIntegrals) -> &Jet; 3] =
                [|x| &x.transition, |x| &x.constant, |x| &x.ramp];
            for part in pick {
                for k in 0..4 {
                    let central = (part(&up).value[k] - part(&down).value[k]) / (2.0 * step);
                    let error = (part(&here).slopes[0][k] - central).abs();
                    assert!(error < 1e-7 * (1.0 + central.abs()), "{h} {k}: {error}");
                }
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        assert!(HoldIntegrals::new(&jet(&[f64::NAN; 4]), 2, 1.0).is_err());
        assert!(HoldIntegrals::new(&jet(&[1e3, 0.0, 0.0, 1e3]), 2, 1.0).is_err());
        assert!(HoldIntegrals::new(&jet(&[1e30, 0.0, 0.0, 1e30]), 2, 1.0).is_err());
    }
}
