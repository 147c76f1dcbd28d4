//! Scalars of the expression tape: plain numbers, and dual numbers that carry exact derivatives.
//!
//! `Dual<T, N>` holds a value and N partial derivatives, each of type `T`. `Dual<Dual<f64, N>, M>`
//! carries second derivatives by the same rules.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What the tape computes with.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A number without derivative.
    fn constant(value: f64) -> Self;
    /// The number alone.
    fn real(self) -> f64;
    /// True where every derivative is zero.
    fn is_constant(self) -> bool;
    /// Sine.
    fn sin(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// Inverse sine.
    fn asin(self) -> Self;
    /// Inverse cosine.
    fn acos(self) -> Self;
    /// Inverse tangent.
    fn atan(self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Power.
    fn power(self, exponent: Self) -> Self;
    /// Power with a whole exponent, by products.
    fn whole_power(self, exponent: i32) -> Self;
    /// Times a number without derivative.
    fn times(self, factor: f64) -> Self;
    /// Angle of the point (x, self).
    fn atan2(self, x: Self) -> Self;

    /// Tangent.
    fn tan(self) -> Self {
        self.sin() / self.cos()
    }
    /// Absolute value; its derivative at zero is taken as zero.
    fn abs(self) -> Self {
        self * self.sign()
    }
    /// −1, 0 or 1, without derivative.
    fn sign(self) -> Self {
        let value = self.real();
        Self::constant(if value == 0.0 { 0.0 } else { value.signum() })
    }
    /// The smaller of two.
    fn minimum(self, other: Self) -> Self {
        if other.real() < self.real() { other } else { self }
    }
    /// The larger of two.
    fn maximum(self, other: Self) -> Self {
        if other.real() > self.real() { other } else { self }
    }
}

macro_rules! plain {
    ($($name:ident),*) => { $(fn $name(self) -> Self { f64::$name(self) })* };
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn real(self) -> f64 {
        self
    }
    fn is_constant(self) -> bool {
        true
    }
    plain!(sin, cos, asin, acos, atan, sinh, cosh, tanh, exp, ln, sqrt, tan, abs);
    fn power(self, exponent: Self) -> Self {
        self.powf(exponent)
    }
    fn whole_power(self, exponent: i32) -> Self {
        self.powi(exponent)
    }
    fn times(self, factor: f64) -> Self {
        self * factor
    }
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
}

/// A value with N partial derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<T, const N: usize> {
    /// The value.
    pub value: T,
    /// Its partial derivatives.
    pub gradient: [T; N],
}

impl<T: Scalar, const N: usize> Dual<T, N> {
    /// The variable whose derivative along `direction` is one.
    pub fn variable(value: T, direction: usize) -> Self {
        let mut gradient = [T::constant(0.0); N];
        if let Some(entry) = gradient.get_mut(direction) {
            *entry = T::constant(1.0);
        }
        Self { value, gradient }
    }

    fn chain(self, value: T, slope: T) -> Self {
        let gradient = self.gradient.map(|entry| entry * slope);
        Self { value, gradient }
    }

    fn chain2(self, other: Self, value: T, slope: T, other_slope: T) -> Self {
        let gradient =
            std::array::from_fn(|i| self.gradient[i] * slope + other.gradient[i] * other_slope);
        Self { value, gradient }
    }
}

fn one<T: Scalar>() -> T {
    T::constant(1.0)
}

impl<T: Scalar, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.chain2(other, self.value + other.value, one(), one())
    }
}

impl<T: Scalar, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.chain2(other, self.value - other.value, one(), -one::<T>())
    }
}

impl<T: Scalar, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.chain2(other, self.value * other.value, other.value, self.value)
    }
}

impl<T: Scalar, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.chain2(other, value, one::<T>() / other.value, -value / other.value)
    }
}

impl<T: Scalar, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -one::<T>())
    }
}

impl<T: Scalar, const N: usize> Scalar for Dual<T, N> {
    fn constant(value: f64) -> Self {
        Self { value: T::constant(value), gradient: [T::constant(0.0); N] }
    }
    fn real(self) -> f64 {
        self.value.real()
    }
    fn is_constant(self) -> bool {
        self.value.is_constant()
            && self.gradient.iter().all(|entry| entry.real() == 0.0 && entry.is_constant())
    }
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
    fn asin(self) -> Self {
        let slope = one::<T>() / (one::<T>() - self.value * self.value).sqrt();
        self.chain(self.value.asin(), slope)
    }
    fn acos(self) -> Self {
        let slope = -one::<T>() / (one::<T>() - self.value * self.value).sqrt();
        self.chain(self.value.acos(), slope)
    }
    fn atan(self) -> Self {
        self.chain(self.value.atan(), one::<T>() / (one::<T>() + self.value * self.value))
    }
    fn sinh(self) -> Self {
        self.chain(self.value.sinh(), self.value.cosh())
    }
    fn cosh(self) -> Self {
        self.chain(self.value.cosh(), self.value.sinh())
    }
    fn tanh(self) -> Self {
        let value = self.value.tanh();
        self.chain(value, one::<T>() - value * value)
    }
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), one::<T>() / self.value)
    }
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        self.chain(value, T::constant(0.5) / value)
    }
    fn power(self, exponent: Self) -> Self {
        let value = self.value.power(exponent.value);
        if exponent.is_constant() {
            // Kept apart so that a negative or zero base with a plain exponent has its derivative.
            let number = exponent.real();
            let slope = if number == 0.0 {
                T::constant(0.0)
            } else {
                T::constant(number) * self.value.power(T::constant(number - 1.0))
            };
            return self.chain(value, slope);
        }
        let slope = exponent.value * self.value.power(exponent.value - one::<T>());
        self.chain2(exponent, value, slope, value * self.value.ln())
    }
    fn whole_power(self, exponent: i32) -> Self {
        if exponent == 0 {
            return Self::constant(1.0);
        }
        let slope = self.value.whole_power(exponent - 1).times(f64::from(exponent));
        self.chain(self.value.whole_power(exponent), slope)
    }
    fn times(self, factor: f64) -> Self {
        Self { value: self.value.times(factor), gradient: self.gradient.map(|e| e.times(factor)) }
    }
    fn atan2(self, x: Self) -> Self {
        let square = x.value * x.value + self.value * self.value;
        self.chain2(x, self.value.atan2(x.value), x.value / square, -self.value / square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_derivatives_by_nesting() {
        // f = x³ y at (2, 5): f_xx = 6 x y = 60, f_xy = 3 x² = 12.
        type Inner = Dual<f64, 2>;
        let x = Dual::<Inner, 2>::variable(Inner::variable(2.0, 0), 0);
        let y = Dual::<Inner, 2>::variable(Inner::variable(5.0, 1), 1);
        let f = x * x * x * y;
        assert_eq!(f.gradient[0].gradient, [60.0, 12.0]);
        let g = x.power(Dual::constant(3.0)) * y;
        assert!((g.gradient[0].gradient[0] - 60.0).abs() < 1e-12);
    }

    #[test]
    fn power_of_zero_has_its_derivative() {
        let x = Dual::<f64, 1>::variable(0.0, 0);
        assert_eq!(x.power(Dual::constant(2.0)).gradient, [0.0]);
        assert_eq!(x.power(Dual::constant(1.0)).gradient, [1.0]);
        assert_eq!(x.power(Dual::constant(0.0)).gradient, [0.0]);
        assert_eq!([2, 1, 0].map(|k| x.whole_power(k).gradient), [[0.0], [1.0], [0.0]]);
    }

    #[test]
    fn whole_powers_and_multiples_are_those_of_constants() {
        type Inner = Dual<f64, 2>;
        let x = Dual::<Inner, 1>::variable(Inner::variable(-1.25, 1), 0);
        for whole in [-3, -1, 0, 1, 2, 3, 6] {
            assert_eq!(x.whole_power(whole), x.power(Dual::constant(f64::from(whole))));
        }
        assert_eq!(x.times(0.5), x * Dual::constant(0.5));
    }
}
