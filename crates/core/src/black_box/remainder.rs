//! What is left of a candidate term beside the terms already chosen.
//! (Python side: identification/narx/fit.py)

/// Doubt of a squared length, as a share of it, above which it has lost its digits.
const DOUBTFUL: f64 = 0.25;
/// Below this share of its last exact value a squared length has lost digits to cancellation.
const CANCELLED: f64 = 1e-6;

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
    /// Largest error of a product of the column, as it is read, with a unit vector.
    pub missed: f64,
    /// Largest errors of `length` and of `product`.
    pub length_doubt: f64,
    /// See `length_doubt`.
    pub product_doubt: f64,
}

impl Remainder {
    /// A whole candidate of the given squared length and product with the target.
    pub fn whole(length: f64, product: f64, penalty: f64) -> Self {
        Self {
            length,
            product,
            full: length,
            exact: length,
            penalty,
            open: length > 0.0 && length.is_finite(),
            missed: 0.0,
            length_doubt: 0.0,
            product_doubt: 0.0,
        }
    }

    /// How much choosing it lowers the (penalised) sum of squares.
    pub fn reduction(&self) -> f64 {
        self.product * self.product / (self.length + self.penalty)
    }

    /// The most that `reduction` is without its doubts; infinite where they leave no bound.
    pub fn largest_reduction(&self) -> f64 {
        let (product, length) =
            (self.product.abs() + self.product_doubt, self.length - self.length_doubt);
        if length > 0.0 { product * product / (length + self.penalty) } else { f64::INFINITY }
    }

    /// Whether length and product are those of the vector itself.
    pub fn is_certain(&self) -> bool {
        self.length_doubt == 0.0 && self.product_doubt == 0.0
    }

    /// Take out a direction whose products with the candidate and the target are given; `blurred` is
    /// the length of what that with the candidate misses of the direction.
    pub fn deflate(&mut self, share: f64, gain: f64, blurred: f64) {
        let missed = self.missed + blurred * self.exact.sqrt();
        self.length -= share * share;
        self.product -= share * gain;
        self.length_doubt += missed * (2.0 * share.abs() + missed);
        self.product_doubt += missed * gain.abs();
    }

    /// Whether the squared length has lost digits that only the vector itself brings back.
    pub fn lost(&self) -> bool {
        self.length < CANCELLED * self.exact || self.length_doubt > DOUBTFUL * self.length
    }
}
