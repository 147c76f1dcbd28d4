//! A whitelisted grammar for formulas in model files: numbers, names, `+ - * / ^`, parentheses and a
//! fixed list of functions. Nothing is ever evaluated as code; length, depth and size are bounded,
//! so a file from a stranger can neither run, hang nor exhaust anything.
//!
//! ```text
//! sum     = product {("+" | "-") product}
//! product = unary {("*" | "/") unary}
//! unary   = ("-" | "+") unary | power
//! power   = atom [("^" | "**") unary]          right-associative, binds tighter than a leading minus
//! atom    = number | name | function "(" test {"," test} ")" | "(" test ")"
//! test    = sum [("<" | "<=" | ">" | ">=") sum]        1 where it holds, else 0
//! ```
//! Functions of one and two arguments are listed below; `where(test, a, b)` (or `if`) chooses, and
//! `clip(x, low, high)`, `saturation(x, limit)`, `deadband(x, half_width)`, `and`, `or` and `not` are
//! written out in those. A table of the model is called by its name with one or two arguments.
//!
//! A name is a letter or underscore, then letters, digits, underscores, then primes (`p'` is a state
//! derivative). `pi` is the number.

use crate::error::CoreError;
use crate::language::parser::parse;

/// Longest text accepted, in bytes.
pub const MAXIMUM_LENGTH: usize = 10_000;
/// Most nodes in one expression.
pub const MAXIMUM_NODES: usize = 4_096;
/// Deepest nesting of parentheses, signs and powers.
pub const MAXIMUM_DEPTH: usize = 64;

/// Functions of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Unary {
    Negate,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Log,
    Sqrt,
    Abs,
    Sign,
}

/// Functions of two arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Atan2,
    Minimum,
    Maximum,
    Less,
    LessEqual,
}

/// One node; children are indices of earlier nodes.
#[derive(Debug, Clone, PartialEq)]
pub enum Node {
    /// A number.
    Number(f64),
    /// A name to be bound when the tape is built.
    Name(String),
    /// A function of one node.
    Unary(Unary, usize),
    /// A function of two nodes.
    Binary(Binary, usize, usize),
    /// The second where the first is not zero, else the third.
    Select(usize, usize, usize),
    /// A table of the model, of one or two nodes.
    Table(String, usize, Option<usize>),
}

impl Node {
    /// Places of its arguments, in order.
    pub fn children(&self) -> Vec<usize> {
        match *self {
            Self::Number(_) | Self::Name(_) => vec![],
            Self::Unary(_, a) | Self::Table(_, a, None) => vec![a],
            Self::Binary(_, a, b) | Self::Table(_, a, Some(b)) => vec![a, b],
            Self::Select(test, a, b) => vec![test, a, b],
        }
    }

    /// The same node with its arguments elsewhere, in the order of `children`.
    pub fn with_children(&self, places: &[usize]) -> Self {
        match (self, places) {
            (Self::Unary(function, _), &[a]) => Self::Unary(*function, a),
            (Self::Binary(function, ..), &[a, b]) => Self::Binary(*function, a, b),
            (Self::Select(..), &[test, a, b]) => Self::Select(test, a, b),
            (Self::Table(name, ..), &[a]) => Self::Table(name.clone(), a, None),
            (Self::Table(name, ..), &[a, b]) => Self::Table(name.clone(), a, Some(b)),
            (leaf, _) => leaf.clone(),
        }
    }
}

/// A parsed expression: nodes with children before parents, and the root.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    /// Nodes, children before parents.
    pub nodes: Vec<Node>,
    /// Index of the node whose value is the expression's.
    pub root: usize,
}

impl Expression {
    /// Parse a text that calls no table.
    ///
    /// # Errors
    /// `CoreError::Expression` with the byte position of the fault.
    pub fn parse(text: &str) -> Result<Self, CoreError> {
        Self::parse_with::<&str>(text, &[])
    }

    /// Parse a text that may call tables of these names.
    ///
    /// # Errors
    /// As `parse`.
    pub fn parse_with<S: AsRef<str>>(text: &str, tables: &[S]) -> Result<Self, CoreError> {
        let tables: Vec<&str> = tables.iter().map(AsRef::as_ref).collect();
        let (nodes, root) = parse(text, tables)?;
        Ok(Self { nodes, root })
    }

    /// Names that occur, in order of first occurrence.
    pub fn names(&self) -> Vec<&str> {
        let mut found: Vec<&str> = Vec::new();
        for node in &self.nodes {
            if let Node::Name(name) = node
                && !found.contains(&name.as_str())
            {
                found.push(name);
            }
        }
        found
    }
}

#[cfg(test)]
#[path = "tests/expression.rs"]
mod tests;
