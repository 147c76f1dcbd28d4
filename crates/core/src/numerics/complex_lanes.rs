//! Eight complex numbers side by side, for arithmetic that is the same at many frequencies.
//! (Python side: none)

use num_complex::Complex64;

/// Numbers in one set of lanes.
pub const LANES: usize = 8;

/// Complex numbers, real and imaginary parts apart, so that each operation is eight of its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lanes {
    /// Real parts.
    pub re: [f64; LANES],
    /// Imaginary parts.
    pub im: [f64; LANES],
}

impl Lanes {
    /// Zero in each lane.
    pub const ZERO: Self = Self { re: [0.0; LANES], im: [0.0; LANES] };

    /// The same real number in each lane.
    pub fn real(value: f64) -> Self {
        Self { re: [value; LANES], im: [0.0; LANES] }
    }

    /// One lane.
    pub fn get(&self, lane: usize) -> Complex64 {
        Complex64::new(self.re[lane], self.im[lane])
    }

    /// Set one lane.
    pub fn set(&mut self, lane: usize, value: Complex64) {
        (self.re[lane], self.im[lane]) = (value.re, value.im);
    }

    /// a · b.
    #[inline(always)]
    pub fn times(&self, b: &Self) -> Self {
        let mut result = Self::ZERO;
        for k in 0..LANES {
            result.re[k] = self.re[k] * b.re[k] - self.im[k] * b.im[k];
            result.im[k] = self.re[k] * b.im[k] + self.im[k] * b.re[k];
        }
        result
    }

    /// a + jωb with real a and b.
    #[inline(always)]
    pub fn along(a: f64, b: f64, omega: &[f64; LANES]) -> Self {
        Self { re: [a; LANES], im: omega.map(|each| b * each) }
    }

    /// Add a · b.
    #[inline(always)]
    pub fn add_product(&mut self, a: &Self, b: &Self) {
        for k in 0..LANES {
            self.re[k] += a.re[k] * b.re[k] - a.im[k] * b.im[k];
            self.im[k] += a.re[k] * b.im[k] + a.im[k] * b.re[k];
        }
    }

    /// Subtract a · b.
    #[inline(always)]
    pub fn subtract_product(&mut self, a: &Self, b: &Self) {
        for k in 0..LANES {
            self.re[k] -= a.re[k] * b.re[k] - a.im[k] * b.im[k];
            self.im[k] -= a.re[k] * b.im[k] + a.im[k] * b.re[k];
        }
    }

    /// Add a real multiple.
    #[inline(always)]
    pub fn add_scaled(&mut self, factor: f64, a: &Self) {
        for k in 0..LANES {
            self.re[k] += factor * a.re[k];
            self.im[k] += factor * a.im[k];
        }
    }

    /// 1/a; not finite where a is zero.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let mut result = Self::ZERO;
        for k in 0..LANES {
            let scale = 1.0 / (self.re[k] * self.re[k] + self.im[k] * self.im[k]);
            result.re[k] = self.re[k] * scale;
            result.im[k] = -self.im[k] * scale;
        }
        result
    }

    /// Largest sum of sizes of both parts over the lanes; infinite where one is not a number.
    pub fn size(&self) -> f64 {
        let mut most = 0.0_f64;
        for k in 0..LANES {
            let size = self.re[k].abs() + self.im[k].abs();
            most = if size.is_nan() { f64::INFINITY } else { most.max(size) };
        }
        most
    }
}
