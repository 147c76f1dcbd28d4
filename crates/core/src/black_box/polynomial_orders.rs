//! Orders of A y = Σ (Bᵢ/Fᵢ) uᵢ + (C/D) e, with an F for each input or one for all.
//! (Python side: models/polynomial/structure.py)

/// How many coefficients each polynomial has, and the delay of each input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Orders {
    /// Degree of A.
    pub a: usize,
    /// Coefficients of each B, from the delay on.
    pub b: Vec<usize>,
    /// Degree of C.
    pub c: usize,
    /// Degree of D.
    pub d: usize,
    /// Degree of each F: of every input, or of one that all inputs share.
    pub f: Vec<usize>,
    /// Samples until each input acts.
    pub delays: Vec<usize>,
}

impl Orders {
    /// Number of coefficients.
    pub fn n_parameters(&self) -> usize {
        self.a + self.c + self.d + self.b.iter().chain(&self.f).sum::<usize>()
    }

    /// Samples of the past that enter the predictor through input `i` before its denominator.
    pub fn span(&self, i: usize) -> usize {
        if self.b[i] == 0 { 0 } else { self.b[i] + self.delays[i] - 1 }
    }

    /// Which F stands under input `i`.
    pub fn denominator(&self, i: usize) -> usize {
        if self.f.len() == self.b.len() { i } else { 0 }
    }

    /// Inputs over one F.
    pub fn over(&self, denominator: usize) -> impl Iterator<Item = usize> {
        (0..self.b.len()).filter(move |&i| self.denominator(i) == denominator)
    }

    /// Unknown values that stand for the past: one run for each F, then one for the noise.
    pub fn memory(&self) -> (Vec<usize>, usize) {
        let longest = |j: usize| self.over(j).map(|i| self.span(i)).max().unwrap_or(0);
        let through_f = |(j, &f): (usize, &usize)| if f > 0 { f.max(longest(j)) } else { 0 };
        let filtered: Vec<usize> = self.f.iter().enumerate().map(through_f).collect();
        let direct = (0..self.f.len()).filter(|&j| self.f[j] == 0).map(longest);
        let past = direct.chain([self.a]).max().unwrap_or(0);
        let through_d = if past > 0 || self.d > 0 { past + self.d } else { 0 };
        (filtered, self.c.max(through_d))
    }
}
