//! Collects an expression as a polynomial in one variable (the Laplace variable of a factor), with
//! coefficients that are expressions of the other names.

use crate::error::CoreError;
use crate::language::expression::Expression;
use crate::language::syntax::{Binary, Node, Unary};

/// Highest power accepted.
pub const MAXIMUM_DEGREE: usize = 20;
const MAXIMUM_NODES: usize = 20_000;

type Coefficients = Vec<Option<usize>>;

/// Coefficients in ascending powers of `variable`; a missing power is the number zero.
///
/// # Errors
/// `Expression` where the variable stands inside a function, a divisor or a power that is not a small
/// whole number, or where the expansion would be too large.
pub fn coefficients(expression: &Expression, variable: &str) -> Result<Vec<Expression>, CoreError> {
    let mut builder = Builder { nodes: Vec::new() };
    let mut collected: Vec<Coefficients> = Vec::with_capacity(expression.nodes.len());
    for node in &expression.nodes {
        let next = match node {
            Node::Number(value) => vec![Some(builder.push(Node::Number(*value))?)],
            Node::Name(name) if name == variable => {
                vec![None, Some(builder.push(Node::Number(1.0))?)]
            }
            Node::Name(name) => vec![Some(builder.push(Node::Name(name.clone()))?)],
            Node::Unary(function, a) => builder.unary(*function, &collected[*a], variable)?,
            Node::Binary(Binary::Power, a, b) => {
                let exponent = match &expression.nodes[*b] {
                    Node::Number(value) => Some(*value),
                    _ => None,
                };
                builder.power(&collected[*a], &collected[*b], exponent, variable)?
            }
            Node::Binary(function, a, b) => {
                builder.binary(*function, &collected[*a], &collected[*b], variable)?
            }
            piecewise => {
                let mut places = Vec::new();
                for child in piecewise.children() {
                    places.push(builder.plain(&collected[child], "a choice or table", variable)?);
                }
                vec![Some(builder.push(piecewise.with_children(&places))?)]
            }
        };
        if next.len() > MAXIMUM_DEGREE + 1 {
            return fault(format!("power of {variable} above {MAXIMUM_DEGREE}"));
        }
        collected.push(next);
    }
    let zero = builder.push(Node::Number(0.0))?;
    let nodes = builder.nodes;
    let found = collected.get(expression.root).cloned().unwrap_or_default();
    Ok(found
        .into_iter()
        .map(|root| Expression { nodes: nodes.clone(), root: root.unwrap_or(zero) })
        .collect())
}

fn fault<T>(problem: String) -> Result<T, CoreError> {
    Err(CoreError::Expression { position: 0, problem })
}

struct Builder {
    nodes: Vec<Node>,
}

impl Builder {
    fn push(&mut self, node: Node) -> Result<usize, CoreError> {
        if self.nodes.len() >= MAXIMUM_NODES {
            return fault("the expanded factor is too large".to_string());
        }
        self.nodes.push(node);
        Ok(self.nodes.len() - 1)
    }

    fn plain(&mut self, a: &Coefficients, what: &str, variable: &str) -> Result<usize, CoreError> {
        match a.as_slice() {
            [] | [None] => self.push(Node::Number(0.0)),
            [Some(only)] => Ok(*only),
            _ => fault(format!("{variable} may not stand inside {what}")),
        }
    }

    fn unary(
        &mut self,
        function: Unary,
        a: &Coefficients,
        variable: &str,
    ) -> Result<Coefficients, CoreError> {
        if function == Unary::Negate {
            return a
                .iter()
                .map(|entry| entry.map(|n| self.push(Node::Unary(function, n))).transpose())
                .collect();
        }
        let inner = self.plain(a, "a function", variable)?;
        Ok(vec![Some(self.push(Node::Unary(function, inner))?)])
    }

    fn binary(
        &mut self,
        function: Binary,
        a: &Coefficients,
        b: &Coefficients,
        variable: &str,
    ) -> Result<Coefficients, CoreError> {
        match function {
            Binary::Add | Binary::Subtract => self.sum(function, a, b),
            Binary::Multiply => self.product(a, b),
            Binary::Divide => {
                let divisor = self.plain(b, "a divisor", variable)?;
                a.iter()
                    .map(|entry| {
                        entry.map(|n| self.push(Node::Binary(function, n, divisor))).transpose()
                    })
                    .collect()
            }
            _ => {
                let first = self.plain(a, "a function", variable)?;
                let second = self.plain(b, "a function", variable)?;
                Ok(vec![Some(self.push(Node::Binary(function, first, second))?)])
            }
        }
    }

    fn sum(
        &mut self,
        function: Binary,
        a: &Coefficients,
        b: &Coefficients,
    ) -> Result<Coefficients, CoreError> {
        (0..a.len().max(b.len()))
            .map(|k| {
                let left = a.get(k).copied().flatten();
                let right = b.get(k).copied().flatten();
                match (left, right) {
                    (Some(x), Some(y)) => self.push(Node::Binary(function, x, y)).map(Some),
                    (None, Some(y)) if function == Binary::Subtract => {
                        self.push(Node::Unary(Unary::Negate, y)).map(Some)
                    }
                    (left, right) => Ok(left.or(right)),
                }
            })
            .collect()
    }

    fn product(&mut self, a: &Coefficients, b: &Coefficients) -> Result<Coefficients, CoreError> {
        let mut result: Coefficients = vec![None; (a.len() + b.len()).saturating_sub(1)];
        for (i, left) in a.iter().enumerate() {
            for (k, right) in b.iter().enumerate() {
                let (Some(x), Some(y)) = (left, right) else { continue };
                let term = self.times(*x, *y)?;
                result[i + k] = Some(match result[i + k] {
                    Some(sum) => self.push(Node::Binary(Binary::Add, sum, term))?,
                    None => term,
                });
            }
        }
        Ok(result)
    }

    fn times(&mut self, x: usize, y: usize) -> Result<usize, CoreError> {
        if self.nodes[x] == Node::Number(1.0) {
            return Ok(y);
        }
        if self.nodes[y] == Node::Number(1.0) {
            return Ok(x);
        }
        self.push(Node::Binary(Binary::Multiply, x, y))
    }

    fn power(
        &mut self,
        a: &Coefficients,
        b: &Coefficients,
        exponent: Option<f64>,
        variable: &str,
    ) -> Result<Coefficients, CoreError> {
        if a.len() == 1 {
            let base = self.plain(a, "a power", variable)?;
            let exponent = self.plain(b, "an exponent", variable)?;
            return Ok(vec![Some(self.push(Node::Binary(Binary::Power, base, exponent))?)]);
        }
        let allowed = 0.0..=MAXIMUM_DEGREE as f64;
        let Some(count) = exponent.filter(|n| n.fract() == 0.0 && allowed.contains(n)) else {
            return fault(format!(
                "a power of {variable} must be a whole number up to {MAXIMUM_DEGREE}"
            ));
        };
        let mut result = vec![Some(self.push(Node::Number(1.0))?)];
        for _ in 0..count as usize {
            result = self.product(&result, a)?;
            if result.len() > MAXIMUM_DEGREE + 1 {
                return fault(format!("power of {variable} above {MAXIMUM_DEGREE}"));
            }
        }
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::expression_tape::{Registers, Tape};
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn values(text: &str) -> Result<Vec<f64>, CoreError> {
        let found = coefficients(&Expression::parse(text)?, "s")?;
        let names = vec!["a".to_string(), "b".to_string()];
        let tape = Tape::compile(&found, &names, &BTreeMap::new())?;
        let mut out = vec![0.0; found.len()];
        tape.evaluate(&[2.0, 3.0], &mut Registers::default(), &mut out)?;
        Ok(out)
    }

    #[test]
    fn collects_powers() {
        assert_eq!(values("s^2 + 2*a*b*s + b^2").unwrap(), [9.0, 12.0, 1.0]);
        assert_eq!(values("(a*s + 1)*(s - b)").unwrap(), [-3.0, -5.0, 2.0]);
        assert_eq!(values("-(s/a + 1)^3").unwrap(), [-1.0, -1.5, -0.75, -0.125]);
        assert_eq!(values("a - s + exp(0)").unwrap(), [3.0, -1.0]);
        assert_eq!(values("sin(0)*s").unwrap(), [0.0, 0.0]);
    }

    #[test]
    fn what_is_no_polynomial_is_refused() {
        for text in ["exp(s)", "1/s", "s^a", "s^0.5", "s^21", "(s+1)^20*s", "2^s", "min(s, 1)"] {
            assert!(matches!(values(text), Err(CoreError::Expression { .. })), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_formula_is_collected_or_refused(text in "[-+*/^()0-9sa ]{0,60}") {
            if let Ok(expression) = Expression::parse(&text) {
                let _ = coefficients(&expression, "s");
            }
        }
    }
}
