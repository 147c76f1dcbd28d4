//! Operations of a tape: what one reads, and what it does to any scalar. (Python side: none)

use crate::language::lookup_table::Part;
use crate::language::syntax::{Binary, Unary};
use crate::numerics::dual::Scalar;

/// Largest exponent whose power is made by products: beyond it they are no faster.
const LARGEST_WHOLE: f64 = 64.0;

/// One entry of a tape; its arguments are the registers of earlier entries.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Operation {
    Constant(f64),
    Input(usize),
    Unary(Unary, usize),
    Binary(Binary, usize, usize),
    /// The second where the first is not zero, else the third.
    Select(usize, usize, usize),
    /// Value or slope of a table, by its place among the tape's tables.
    Table(usize, Part, usize, usize),
}

impl Operation {
    /// Registers that it reads.
    pub(crate) fn arguments(&self) -> impl Iterator<Item = usize> {
        let (a, b, c) = match *self {
            Self::Constant(_) | Self::Input(_) => (None, None, None),
            Self::Unary(_, a) => (Some(a), None, None),
            Self::Binary(_, a, b) | Self::Table(.., a, b) => (Some(a), Some(b), None),
            Self::Select(test, a, b) => (Some(test), Some(a), Some(b)),
        };
        a.into_iter().chain(b).chain(c)
    }

    /// The exponent that it is, where products make the power of it.
    pub(crate) fn whole_exponent(&self) -> Option<i32> {
        match *self {
            Self::Constant(power) if power.fract() == 0.0 && power.abs() <= LARGEST_WHOLE => {
                Some(power as i32)
            }
            _ => None,
        }
    }

    /// The same operation where its arguments have other places.
    pub(crate) fn moved(self, places: &[usize]) -> Self {
        match self {
            Self::Unary(function, a) => Self::Unary(function, places[a]),
            Self::Binary(function, a, b) => Self::Binary(function, places[a], places[b]),
            Self::Select(test, a, b) => Self::Select(places[test], places[a], places[b]),
            Self::Table(table, part, a, b) => Self::Table(table, part, places[a], places[b]),
            leaf => leaf,
        }
    }
}

pub(crate) fn apply_unary<T: Scalar>(function: Unary, a: T) -> T {
    match function {
        Unary::Negate => -a,
        Unary::Sin => a.sin(),
        Unary::Cos => a.cos(),
        Unary::Tan => a.tan(),
        Unary::Asin => a.asin(),
        Unary::Acos => a.acos(),
        Unary::Atan => a.atan(),
        Unary::Sinh => a.sinh(),
        Unary::Cosh => a.cosh(),
        Unary::Tanh => a.tanh(),
        Unary::Exp => a.exp(),
        Unary::Log => a.ln(),
        Unary::Sqrt => a.sqrt(),
        Unary::Abs => a.abs(),
        Unary::Sign => a.sign(),
    }
}

pub(crate) fn apply_binary<T: Scalar>(function: Binary, a: T, b: T) -> T {
    match function {
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        Binary::Divide => a / b,
        Binary::Power => a.power(b),
        Binary::Atan2 => a.atan2(b),
        Binary::Minimum => a.minimum(b),
        Binary::Maximum => a.maximum(b),
        Binary::Less => T::constant(f64::from(a.real() < b.real())),
        Binary::LessEqual => T::constant(f64::from(a.real() <= b.real())),
    }
}
