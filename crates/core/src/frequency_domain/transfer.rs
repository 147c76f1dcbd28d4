//! Transfer functions gain · Π numerator factors / Π denominator factors · e^{−τ s} with exact
//! derivatives of log H with respect to the parameters. (Python side: models/transfer/model.py)
//!
//! Several responses share one set of parameters. Factors are polynomials in `s` whose coefficients
//! are expressions; tied parameters are definitions in terms of the others.

use std::collections::BTreeMap;
use std::ops::Range;

use num_complex::Complex64;

use crate::error::CoreError;
use crate::frequency_domain::response_model::ResponseModel;
use crate::language::expression::Expression;
use crate::language::laplace_polynomial;
use crate::tape::expression_tape::{Registers, Tape};

/// Name of the Laplace variable in factors.
pub const LAPLACE: &str = "s";

/// One response as text.
#[derive(Debug, Clone, Default)]
pub struct ResponseText {
    /// Gain expression.
    pub gain: String,
    /// Numerator factors in `s`.
    pub numerator: Vec<String>,
    /// Denominator factors in `s`.
    pub denominator: Vec<String>,
    /// Delay expression, s.
    pub delay: String,
}

/// Places of one response's expressions on the tape.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) gain: usize,
    pub(crate) numerator: Vec<Range<usize>>,
    pub(crate) denominator: Vec<Range<usize>>,
    pub(crate) delay: usize,
}

/// One response with numbers in place of expressions; polynomials in ascending powers of s.
#[derive(Debug, Clone, PartialEq)]
pub struct Factored {
    /// Gain.
    pub gain: f64,
    /// Numerator factors.
    pub numerator: Vec<Vec<f64>>,
    /// Denominator factors.
    pub denominator: Vec<Vec<f64>>,
    /// Delay, s.
    pub delay: f64,
}

/// Several transfer functions of the same parameters.
#[derive(Debug, Clone)]
pub struct TransferFunctions {
    pub(crate) tape: Tape,
    pub(crate) layouts: Vec<Layout>,
}

fn parse(text: &str) -> Result<Expression, CoreError> {
    Expression::parse(text).map_err(|error| within(error, text))
}

fn within(error: CoreError, text: &str) -> CoreError {
    match error {
        CoreError::Expression { position, problem } => {
            let shown: String = text.chars().take(80).collect();
            CoreError::Expression { position, problem: format!("{problem}, in {shown:?}") }
        }
        other => other,
    }
}

impl TransferFunctions {
    /// Parse and compile.
    ///
    /// # Errors
    /// `Expression`, `UnknownName` or `Circular` for texts that are not what they should be.
    pub fn new(
        responses: &[ResponseText],
        parameters: &[String],
        definitions: &BTreeMap<String, String>,
    ) -> Result<Self, CoreError> {
        let mut expressions = Vec::new();
        let mut layouts = Vec::with_capacity(responses.len());
        for text in responses {
            let gain = expressions.len();
            expressions.push(parse(&text.gain)?);
            let delay = expressions.len();
            expressions.push(parse(&text.delay)?);
            let numerator = factors(&text.numerator, &mut expressions)?;
            let denominator = factors(&text.denominator, &mut expressions)?;
            layouts.push(Layout { gain, numerator, denominator, delay });
        }
        let definitions = definitions
            .iter()
            .map(|(name, text)| Ok((name.clone(), parse(text)?)))
            .collect::<Result<_, CoreError>>()?;
        Ok(Self { tape: Tape::compile(&expressions, parameters, &definitions)?, layouts })
    }

    /// Number of responses.
    pub fn n_responses(&self) -> usize {
        self.layouts.len()
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.tape.n_inputs()
    }

    /// Gain, factors and delay of every response for parameter values.
    ///
    /// # Errors
    /// `Shape` or `NotFinite` for values that do not fit or have no meaning.
    pub fn factored(&self, values: &[f64]) -> Result<Vec<Factored>, CoreError> {
        let mut numbers = vec![0.0; self.tape.n_outputs()];
        self.tape.evaluate(values, &mut Registers::default(), &mut numbers)?;
        let polynomials = |ranges: &[Range<usize>]| -> Vec<Vec<f64>> {
            ranges.iter().map(|range| numbers[range.clone()].to_vec()).collect()
        };
        Ok(self
            .layouts
            .iter()
            .map(|layout| Factored {
                gain: numbers[layout.gain],
                numerator: polynomials(&layout.numerator),
                denominator: polynomials(&layout.denominator),
                delay: numbers[layout.delay],
            })
            .collect())
    }
}

fn factors(
    texts: &[String],
    expressions: &mut Vec<Expression>,
) -> Result<Vec<Range<usize>>, CoreError> {
    texts
        .iter()
        .map(|text| {
            let start = expressions.len();
            let found = laplace_polynomial::coefficients(&parse(text)?, LAPLACE);
            expressions.extend(found.map_err(|error| within(error, text))?);
            Ok(start..expressions.len())
        })
        .collect()
}

/// Transfer functions seen by a fit: some parameters vary, the others stay.
#[derive(Debug, Clone)]
pub struct FreeTransfer<'a> {
    functions: &'a TransferFunctions,
    values: Vec<f64>,
    free: Vec<usize>,
    registers: Registers,
    numbers: Vec<f64>,
    /// Derivatives of the tape's outputs, (n_outputs × n_free).
    slopes: Vec<f64>,
}

impl<'a> FreeTransfer<'a> {
    /// Take the values of all parameters and the indices of those that vary.
    ///
    /// # Errors
    /// `Shape` for a wrong number of values or an index that does not exist.
    pub fn new(
        functions: &'a TransferFunctions,
        values: &[f64],
        free: &[usize],
    ) -> Result<Self, CoreError> {
        let needed = functions.n_parameters();
        if values.len() != needed {
            let found = values.len();
            return Err(CoreError::Shape { what: "parameter values", found, needed });
        }
        if let Some(&found) = free.iter().find(|&&index| index >= needed) {
            return Err(CoreError::Shape { what: "index of a free parameter", found, needed });
        }
        let n = functions.tape.n_outputs();
        Ok(Self {
            functions,
            values: values.to_vec(),
            free: free.to_vec(),
            registers: Registers::default(),
            numbers: vec![0.0; n],
            slopes: vec![0.0; n * free.len()],
        })
    }

    fn add_slope(&self, place: usize, weight: Complex64, gradient: &mut [Complex64]) {
        let n = self.free.len();
        for (entry, &slope) in gradient.iter_mut().zip(&self.slopes[place * n..(place + 1) * n]) {
            *entry += weight * slope;
        }
    }

    /// Value of a factor at s; its part of the gradient of log H is added with `sign`.
    fn factor(
        &self,
        range: &Range<usize>,
        s: Complex64,
        sign: f64,
        gradient: Option<&mut [Complex64]>,
    ) -> Complex64 {
        let value = self.numbers[range.clone()]
            .iter()
            .rev()
            .fold(Complex64::default(), |sum, &coefficient| sum * s + coefficient);
        if let Some(gradient) = gradient {
            let mut weight = sign / value;
            for place in range.clone() {
                self.add_slope(place, weight, gradient);
                weight *= s;
            }
        }
        value
    }

    /// H(jω) of one response, and the gradient of its logarithm.
    fn at(&self, response: usize, omega: f64, mut gradient: Option<&mut [Complex64]>) -> Complex64 {
        let layout = &self.functions.layouts[response];
        let s = Complex64::new(0.0, omega);
        let (gain, delay) = (self.numbers[layout.gain], self.numbers[layout.delay]);
        if let Some(gradient) = gradient.as_deref_mut() {
            gradient.fill(Complex64::default());
            self.add_slope(layout.gain, Complex64::new(1.0 / gain, 0.0), gradient);
            self.add_slope(layout.delay, -s, gradient);
        }
        let mut value = gain * Complex64::cis(-omega * delay);
        for range in &layout.numerator {
            value *= self.factor(range, s, 1.0, gradient.as_deref_mut());
        }
        for range in &layout.denominator {
            value /= self.factor(range, s, -1.0, gradient.as_deref_mut());
        }
        value
    }
}

impl ResponseModel for FreeTransfer<'_> {
    fn n_responses(&self) -> usize {
        self.functions.n_responses()
    }

    fn n_free(&self) -> usize {
        self.free.len()
    }

    fn prepare(&mut self, free: &[f64], with_gradient: bool) -> Result<(), CoreError> {
        for (&place, &value) in self.free.iter().zip(free) {
            self.values[place] = value;
        }
        let tape = &self.functions.tape;
        if with_gradient {
            let (values, registers) = (&self.values, &mut self.registers);
            tape.jacobian(values, &self.free, registers, &mut self.numbers, &mut self.slopes)
        } else {
            tape.evaluate(&self.values, &mut self.registers, &mut self.numbers)
        }
    }

    fn responses(
        &self,
        response: usize,
        omega: &[f64],
        values: &mut [Complex64],
        gradients: Option<&mut [Complex64]>,
    ) {
        let mut rows = gradients.map(|all| all.chunks_exact_mut(self.free.len().max(1)));
        for (value, &each) in values.iter_mut().zip(omega) {
            *value = self.at(response, each, rows.as_mut().and_then(Iterator::next));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> TransferFunctions {
        let text = ResponseText {
            gain: "K".into(),
            numerator: vec!["s + z".into()],
            denominator: vec!["s^2 + 2*zeta*w*s + w^2".into(), "T*s + 1".into()],
            delay: "tau".into(),
        };
        let names: Vec<String> = ["K", "zeta", "w", "T", "tau"].map(String::from).to_vec();
        let ties = BTreeMap::from([("z".to_string(), "w/2".to_string())]);
        TransferFunctions::new(&[text], &names, &ties).unwrap()
    }

    const VALUES: [f64; 5] = [3.0, 0.4, 5.0, 0.1, 0.02];

    #[test]
    fn value_is_the_formula() {
        let functions = example();
        let mut model = FreeTransfer::new(&functions, &VALUES, &[]).unwrap();
        model.prepare(&[], false).unwrap();
        let s = Complex64::new(0.0, 7.0);
        let expected = 3.0 * (s + 2.5) / (s * s + 4.0 * s + 25.0) / (0.1 * s + 1.0)
            * Complex64::cis(-7.0 * 0.02);
        assert!((model.response(0, 7.0, None) - expected).norm() < 1e-15);
    }

    #[test]
    fn gradient_of_log_matches_differences() {
        let functions = example();
        let free = [0, 1, 2, 3, 4];
        let mut model = FreeTransfer::new(&functions, &VALUES, &free).unwrap();
        model.prepare(&VALUES, true).unwrap();
        let mut gradient = [Complex64::default(); 5];
        model.response(0, 7.0, Some(&mut gradient));
        for k in 0..5 {
            let h = 1e-6 * VALUES[k];
            let at = |delta: f64| {
                let mut model = FreeTransfer::new(&functions, &VALUES, &free).unwrap();
                let mut values = VALUES;
                values[k] += delta;
                model.prepare(&values, false).unwrap();
                model.response(0, 7.0, None).ln()
            };
            let central = (at(h) - at(-h)) / (2.0 * h);
            assert!((gradient[k] - central).norm() < 1e-8 * central.norm().max(1.0), "{k}");
        }
    }

    #[test]
    fn faults_name_the_text() {
        let text = ResponseText { gain: "K*".into(), delay: "0".into(), ..ResponseText::default() };
        let fault = TransferFunctions::new(&[text], &[], &BTreeMap::new()).unwrap_err();
        assert!(fault.to_string().contains("in \"K*\""), "{fault}");
    }
}
