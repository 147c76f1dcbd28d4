//! What ends a forward selection. (Python side: models/narx/model.py)

/// What ends the selection. The last four run to the most terms and keep the smallest value, where k
/// is the effective number of parameters: with penalties less than the number of terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The sum of squared errors is at most this.
    SumOfSquares(f64),
    /// The best error-reduction ratio is below this.
    ErrorReduction(f64),
    /// Only the most terms.
    Terms,
    /// Smallest leave-one-out mean square.
    Press,
    /// Smallest n ln(SSE/n) + 2k.
    Akaike,
    /// Akaike's with the small-sample term 2k(k+1)/(n−k−1).
    AkaikeCorrected,
    /// Smallest n ln(SSE/n) + k ln n.
    Bayes,
}

/// The chosen terms and the errors after each.
#[derive(Debug, Default)]
pub(crate) struct Path {
    /// Candidate indices.
    pub terms: Vec<usize>,
    /// Sums of squared errors.
    pub sums: Vec<f64>,
    /// The same without penalties.
    pub unpenalised: Vec<f64>,
    /// Leave-one-out mean squares.
    pub press: Vec<f64>,
    /// Effective number of parameters.
    pub effective: Vec<f64>,
}

impl Stop {
    /// How many of the terms to keep, never fewer than the forced ones.
    pub(crate) fn kept(self, forced: usize, n: usize, path: &Path) -> usize {
        let (mut best, mut least) = (forced, f64::INFINITY);
        for k in forced.max(1)..=path.terms.len() {
            let value = self.value(k, n as f64, path);
            if value < least {
                (best, least) = (k, value);
            }
        }
        best
    }

    fn value(self, k: usize, samples: f64, path: &Path) -> f64 {
        let effective = path.effective[k - 1];
        let fit = samples * (path.sums[k - 1] / samples).ln();
        match self {
            Self::Press => path.press[k - 1],
            Self::Akaike => fit + 2.0 * effective,
            Self::AkaikeCorrected if effective + 1.0 >= samples => f64::INFINITY,
            Self::AkaikeCorrected => fit + 2.0 * effective * samples / (samples - effective - 1.0),
            Self::Bayes => fit + effective * samples.ln(),
            Self::SumOfSquares(_) | Self::ErrorReduction(_) | Self::Terms => -(k as f64),
        }
    }
}
