//! What is left of a candidate term beside the terms already chosen.
//! (Python side: identification/narx/fit.py)

/// What is left of a candidate beside the chosen terms.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Remainder {
    /// Squared length a.
    pub length: f64,
    /// Product b with the target.
    pub product: f64,
    /// Squared length of the whole candidate.
    pub full: f64,
    /// Squared length when it was last computed from the vector itself.
    pub exact: f64,
    /// Penalty λ of its squared coefficient.
    pub penalty: f64,
    /// Whether it can be chosen.
    pub open: bool,
}

impl Remainder {
    /// How much choosing it lowers the (penalised) sum of squares.
    pub fn reduction(&self) -> f64 {
        self.product * self.product / (self.length + self.penalty)
    }
}
