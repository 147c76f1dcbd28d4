//! Why a text is no table.

use thiserror::Error;

/// Why a text is no table.
#[derive(Debug, Error)]
pub enum DelimitedError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// A row has more or fewer cells than the heading.
    #[error("line {line} has {found} cells where the heading has {needed}")]
    Ragged {
        /// From 1.
        line: usize,
        /// How many, "more" where they were not counted.
        found: String,
        /// Of the heading.
        needed: usize,
    },
    /// A row that is longer than a row can be.
    #[error("line {line} is longer than {most} bytes")]
    LongLine {
        /// From 1.
        line: usize,
        /// The longest that is read.
        most: usize,
    },
    /// A quote is opened and not closed in its line, or followed by more than a delimiter.
    #[error("line {line} has a quote without its end")]
    OpenQuote {
        /// From 1.
        line: usize,
    },
    /// A cell of text is no UTF-8, or the file no UTF-16.
    #[error("line {line} is no text in UTF-8 or UTF-16")]
    NotText {
        /// From 1.
        line: usize,
    },
    /// The columns take more than the budget.
    #[error("the columns take {bytes} bytes and more")]
    TooLarge {
        /// At the row where it was met.
        bytes: usize,
    },
}

/// What is wrong with a line.
pub enum Fault {
    Cells(usize),
    MoreCells,
    OpenQuote,
    NotText,
}

impl Fault {
    /// The error of a line, from 1, where the heading has `needed` cells.
    pub fn at(self, line: usize, needed: usize) -> DelimitedError {
        match self {
            Self::Cells(count) => DelimitedError::Ragged { line, found: count.to_string(), needed },
            Self::MoreCells => DelimitedError::Ragged { line, found: "more".to_owned(), needed },
            Self::OpenQuote => DelimitedError::OpenQuote { line },
            Self::NotText => DelimitedError::NotText { line },
        }
    }
}
