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
use crate::language::syntax::Node;

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
