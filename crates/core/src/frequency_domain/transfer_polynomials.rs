//! Transfer functions multiplied out, for their realisation. (Python side:
//! identification/output_error/fit.py)

use std::ops::Range;

use crate::error::CoreError;
use crate::frequency_domain::transfer::TransferFunctions;
use crate::tape::expression_tape::Registers;

/// One response multiplied out, ascending powers of s, with derivatives by some parameters.
#[derive(Debug, Clone)]
pub struct Rational {
    /// Numerator with the gain.
    pub numerator: Vec<f64>,
    /// Denominator.
    pub denominator: Vec<f64>,
    /// Delay, s.
    pub delay: f64,
    /// By each parameter.
    pub numerator_slopes: Vec<Vec<f64>>,
    /// By each parameter.
    pub denominator_slopes: Vec<Vec<f64>>,
    /// By each parameter.
    pub delay_slopes: Vec<f64>,
}

impl Rational {
    /// Number of states of a realisation.
    ///
    /// # Errors
    /// `Range` for more zeros than poles.
    pub fn order(&self) -> Result<usize, CoreError> {
        let degree = |of: &[f64]| of.iter().rposition(|&value| value != 0.0).unwrap_or(0);
        let (above, below) = (degree(&self.numerator), degree(&self.denominator));
        if above > below {
            let (found, needed) = (above as f64, "at most the number of poles");
            return Err(CoreError::Range { what: "number of zeros of a response", found, needed });
        }
        Ok(below)
    }
}

impl TransferFunctions {
    /// Every response multiplied out, with derivatives by some of the parameters.
    ///
    /// # Errors
    /// As `factored`.
    pub fn rationals(&self, values: &[f64], free: &[usize]) -> Result<Vec<Rational>, CoreError> {
        let n = free.len();
        let mut numbers = vec![0.0; self.tape.n_outputs()];
        let mut slopes = vec![0.0; numbers.len() * n];
        let registers = &mut Registers::default();
        self.tape.jacobian(values, free, registers, &mut numbers, &mut slopes)?;
        let product = |ranges: &[Range<usize>], gain: Option<usize>| {
            let single = gain.map(|place| place..place + 1);
            let all: Vec<_> = ranges.iter().cloned().chain(single).collect();
            let of = |moved: Option<(usize, usize)>| {
                all.iter().enumerate().fold(vec![1.0], |sum, (k, range)| match moved {
                    Some((which, j)) if which == k => {
                        let slope: Vec<f64> =
                            range.clone().map(|place| slopes[place * n + j]).collect();
                        multiplied(&sum, &slope)
                    }
                    _ => multiplied(&sum, &numbers[range.clone()]),
                })
            };
            let by = |j: usize| {
                let mut sum = of(None).iter().map(|_| 0.0).collect::<Vec<f64>>();
                for k in 0..all.len() {
                    sum.iter_mut().zip(of(Some((k, j)))).for_each(|(into, part)| *into += part);
                }
                sum
            };
            (of(None), (0..n).map(by).collect::<Vec<_>>())
        };
        let all = self.layouts.iter().map(|layout| {
            let (numerator, numerator_slopes) = product(&layout.numerator, Some(layout.gain));
            let (denominator, denominator_slopes) = product(&layout.denominator, None);
            Rational {
                numerator,
                denominator,
                delay: numbers[layout.delay],
                numerator_slopes,
                denominator_slopes,
                delay_slopes: slopes[layout.delay * n..(layout.delay + 1) * n].to_vec(),
            }
        });
        Ok(all.collect())
    }
}

fn multiplied(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            result[i + j] += x * y;
        }
    }
    result
}
