//! The one error type of the numerics crate. Each variant carries the values that disagree.

use thiserror::Error;

/// What a numeric kernel refuses, with what was found and what was needed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CoreError {
    /// Two lengths or shapes that must agree do not.
    #[error("{what}: found {found}, needed {needed}")]
    Shape {
        /// The quantity whose shape is wrong.
        what: &'static str,
        /// The shape that was given.
        found: usize,
        /// The shape that is needed.
        needed: usize,
    },
    /// A number lies outside the range that has a meaning.
    #[error("{what}: found {found}, needed {needed}")]
    Range {
        /// The quantity that is out of range.
        what: &'static str,
        /// The value that was given.
        found: f64,
        /// The range that is needed, in words.
        needed: &'static str,
    },
    /// NaN or infinity in an input.
    #[error("{what} holds a value that is not finite at index {index}")]
    NotFinite {
        /// The array that holds it.
        what: &'static str,
        /// Its first place.
        index: usize,
    },
    /// A linear system could not be solved.
    #[error("{what} is singular to working precision")]
    Singular {
        /// The matrix.
        what: &'static str,
    },
    /// A run that grows beyond all bounds.
    #[error("the run diverges at sample {sample}")]
    Diverged {
        /// First sample without a meaningful state or output.
        sample: usize,
    },
    /// A formula that is outside the grammar or too large.
    #[error("at character {position}: {problem}")]
    Expression {
        /// Byte position in the text.
        position: usize,
        /// What was found and needed.
        problem: String,
    },
    /// A name in a formula that nothing defines.
    #[error("{name:?} is not defined here")]
    UnknownName {
        /// The name.
        name: String,
    },
    /// Definitions that need one another.
    #[error("definitions form a circle: {names}")]
    Circular {
        /// The chain of names.
        names: String,
    },
}
