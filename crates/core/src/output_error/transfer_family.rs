//! Transfer functions as linear systems with derivatives by their parameters.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::frequency_domain::transfer::TransferFunctions;
use crate::frequency_domain::transfer_polynomials::Rational;
use crate::output_error::linear_family::{LinearFamily, LinearPoint, Values};

/// Transfer functions, each with states of its own in controllable form and a delay of its own.
#[derive(Debug, Clone)]
pub struct TransferFamily<'a> {
    functions: &'a TransferFunctions,
    /// Output and input of each response.
    pairs: &'a [(usize, usize)],
    values: Values,
    columns: Vec<Option<usize>>,
    orders: Vec<usize>,
}

impl<'a> TransferFamily<'a> {
    /// Take the pair of each response, the values of all parameters and the indices of those that
    /// vary.
    ///
    /// # Errors
    /// `Shape` for what does not fit, `Range` for more zeros than poles.
    pub fn new(
        functions: &'a TransferFunctions,
        pairs: &'a [(usize, usize)],
        values: &[f64],
        free: &[usize],
    ) -> Result<Self, CoreError> {
        let (found, needed) = (pairs.len(), functions.n_responses());
        if found != needed {
            return Err(CoreError::Shape { what: "pairs of the responses", found, needed });
        }
        let values = Values::new(values, free, functions.n_parameters())?;
        let orders = functions
            .rationals(&values.all, &[])?
            .iter()
            .map(Rational::order)
            .collect::<Result<_, _>>()?;
        let columns = pairs.iter().map(|&(_, input)| Some(input)).collect();
        Ok(Self { functions, pairs, values, columns, orders })
    }
}

impl LinearFamily for TransferFamily<'_> {
    fn n_states(&self) -> usize {
        self.orders.iter().sum()
    }

    fn n_outputs(&self) -> usize {
        self.pairs.iter().map(|&(output, _)| output + 1).max().unwrap_or(0)
    }

    fn n_inputs(&self) -> usize {
        self.pairs.iter().map(|&(_, input)| input + 1).max().unwrap_or(0)
    }

    fn n_parameters(&self) -> usize {
        self.values.free.len()
    }

    fn columns(&self) -> &[Option<usize>] {
        &self.columns
    }

    fn at(&self, theta: &[f64], with_slopes: bool) -> Result<LinearPoint, CoreError> {
        let free: &[usize] = if with_slopes { &self.values.free } else { &[] };
        let rationals = self.functions.rationals(&self.values.at(theta), free)?;
        let (n, p, m) = (self.n_states(), self.n_outputs(), self.pairs.len());
        let empty = || LinearPoint {
            a: vec![0.0; n * n],
            b: vec![0.0; n * m],
            c: vec![0.0; p * n],
            d: vec![0.0; p * m],
            delays_s: vec![0.0; m],
            slopes: Vec::new(),
        };
        let (mut found, mut slopes) = (empty(), vec![empty(); free.len()]);
        let mut start = 0;
        for (column, (rational, &order)) in rationals.iter().zip(&self.orders).enumerate() {
            let output = self.pairs[column].0;
            let place = |into: &mut LinearPoint, form: &Form, delay: f64| {
                for k in 0..order {
                    into.a[start * n + start + k] = form.feedback[k];
                    into.c[output * n + start + k] = form.output[k];
                }
                into.d[output * m + column] = form.through;
                into.delays_s[column] = delay;
            };
            let form = Form::new(rational, order)?;
            place(&mut found, &form, rational.delay);
            for k in 1..order {
                found.a[(start + k) * n + start + k - 1] = 1.0;
            }
            if order > 0 {
                found.b[start * m + column] = 1.0;
            }
            for (j, into) in slopes.iter_mut().enumerate() {
                place(into, &form.slope(rational, j), rational.delay_slopes[j]);
            }
            start += order;
        }
        found.slopes = slopes;
        Ok(found)
    }
}

/// First row of A, row of C and feedthrough of one response in controllable form.
struct Form {
    feedback: Vec<f64>,
    output: Vec<f64>,
    through: f64,
    order: usize,
}

impl Form {
    fn new(rational: &Rational, order: usize) -> Result<Self, CoreError> {
        let (above, below) = (&rational.numerator, &rational.denominator);
        let lead = below[order];
        if lead == 0.0 || !lead.is_finite() {
            return Err(CoreError::Singular { what: "the leading coefficient of a denominator" });
        }
        let at = |k: usize| above.get(k).copied().unwrap_or(0.0) / lead;
        let through = at(order);
        // Highest power first, as the rows of the controllable form go.
        let feedback: Vec<f64> = (0..order).rev().map(|k| -below[k] / lead).collect();
        let output =
            (0..order).rev().zip(&feedback).map(|(k, row)| at(k) + through * row).collect();
        Ok(Self { feedback, output, through, order })
    }

    fn slope(&self, rational: &Rational, direction: usize) -> Self {
        let order = self.order;
        let lead = rational.denominator[order];
        let at = |from: &[f64], k: usize| from.get(k).copied().unwrap_or(0.0);
        let (above, below) =
            (&rational.numerator_slopes[direction], &rational.denominator_slopes[direction]);
        let d_lead = at(below, order);
        let quotient = |value: f64, slope: f64| (slope - value / lead * d_lead) / lead;
        let by = |k: usize| quotient(at(&rational.numerator, k), at(above, k));
        let through = by(order);
        let feedback: Vec<f64> = (0..order)
            .rev()
            .map(|k| -quotient(at(&rational.denominator, k), at(below, k)))
            .collect();
        let output = (0..order)
            .rev()
            .enumerate()
            .map(|(row, k)| by(k) + through * self.feedback[row] + self.through * feedback[row])
            .collect();
        Self { feedback, output, through, order }
    }
}
