//! What a formula is made of: functions, nodes, and the bounds that keep a stranger's text small.
//! (Python side: formula.py)

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
