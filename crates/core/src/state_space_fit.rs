//! Frequency responses of a state-space model with exact derivatives of log H, for the fit.
//! (Python side: models/statespace.py)
//!
//! H(jω) = {[H₀ + jω H₁] [jωM − F]⁻¹ G + D} e^{−jωτ}. With X = [jωM − F]⁻¹ G and the adjoint
//! Λ = [jωM − F]⁻ᵀ [H₀ + jω H₁]ᵀ the derivative of each pair is a sum over those few entries of the
//! matrices that depend on a parameter: one factorisation for each frequency serves all pairs.

use num_complex::Complex64;

use crate::complex_lu::ComplexLu;
use crate::error::CoreError;
use crate::frequency_fit::ResponseModel;
use crate::model_tape::{Linearisation, ModelTape, Sensitivity};

/// States and adjoints at one frequency.
#[derive(Debug, Clone)]
struct Solved {
    /// X, n_inputs × n_states.
    states: Vec<Complex64>,
    /// Λ, n_outputs × n_states.
    adjoints: Vec<Complex64>,
}

/// A state-space model seen by a fit: some parameters vary, the others stay.
#[derive(Debug, Clone)]
pub struct FreeStateSpace<'a> {
    tape: &'a ModelTape,
    /// Output and input of each response.
    pairs: &'a [(usize, usize)],
    point: &'a [f64],
    values: Vec<f64>,
    free: Vec<usize>,
    /// Frequencies to be solved in advance, ascending.
    omega: Vec<f64>,
    linear: Linearisation,
    sensitivities: Vec<Sensitivity>,
    delay_slopes: Vec<f64>,
    solved: Vec<Solved>,
}

impl<'a> FreeStateSpace<'a> {
    /// Take the values of all parameters, the indices of those that vary, and the frequencies at
    /// which responses will be asked for (others are solved when asked).
    ///
    /// # Errors
    /// `Shape` for what does not fit, `NotFinite` where the model has no linearisation.
    pub fn new(
        tape: &'a ModelTape,
        pairs: &'a [(usize, usize)],
        point: &'a [f64],
        values: &[f64],
        free: &[usize],
        omega: impl IntoIterator<Item = f64>,
    ) -> Result<Self, CoreError> {
        for &(output, input) in pairs {
            let bounds = [(output, tape.n_outputs()), (input, tape.n_inputs())];
            if let Some(&(found, needed)) = bounds.iter().find(|(index, count)| index >= count) {
                return Err(CoreError::Shape { what: "channel of a response", found, needed });
            }
        }
        if let Some(&found) = free.iter().find(|&&index| index >= tape.n_parameters()) {
            let needed = tape.n_parameters();
            return Err(CoreError::Shape { what: "index of a free parameter", found, needed });
        }
        let mut omega: Vec<f64> = omega.into_iter().collect();
        omega.sort_by(f64::total_cmp);
        omega.dedup();
        Ok(Self {
            tape,
            pairs,
            point,
            values: values.to_vec(),
            free: free.to_vec(),
            omega,
            linear: tape.linearise(point, values)?,
            sensitivities: Vec::new(),
            delay_slopes: Vec::new(),
            solved: Vec::new(),
        })
    }

    /// Entry of ∂(r, y)/∂z, derivative and state together: jω ∂/∂ẋ + ∂/∂x.
    fn dynamic(&self, row: usize, state: usize, s: Complex64) -> Complex64 {
        let start = row * self.tape.width() + state;
        s * self.linear.slopes[start] + self.linear.slopes[start + self.tape.n_states()]
    }

    fn solve(&self, omega: f64) -> Result<Solved, CoreError> {
        let (n, m, p) = (self.tape.n_states(), self.tape.n_inputs(), self.tape.n_outputs());
        let s = Complex64::new(0.0, omega);
        let matrix = (0..n * n).map(|place| self.dynamic(place / n, place % n, s)).collect();
        let factors = ComplexLu::new(matrix, n)?;
        let slopes = &self.linear.slopes;
        // The rows hold left − right: ∂r/∂u is −G.
        let input = |place: usize| -slopes[(place % n) * self.tape.width() + 2 * n + place / n];
        let mut states: Vec<_> = (0..m * n).map(|k| Complex64::new(input(k), 0.0)).collect();
        let mut adjoints: Vec<_> = (0..p * n).map(|k| self.dynamic(n + k / n, k % n, s)).collect();
        states.chunks_exact_mut(n).for_each(|column| factors.solve(column));
        adjoints.chunks_exact_mut(n).for_each(|row| factors.solve_transposed(row));
        Ok(Solved { states, adjoints })
    }

    /// H without delay, and its derivatives added to `gradient`.
    fn undelayed(
        &self,
        pair: (usize, usize),
        s: Complex64,
        solved: &Solved,
        gradient: Option<&mut [Complex64]>,
    ) -> Complex64 {
        let (output, input) = pair;
        let (n, width) = (self.tape.n_states(), self.tape.width());
        let states = &solved.states[input * n..(input + 1) * n];
        let adjoint = &solved.adjoints[output * n..(output + 1) * n];
        let row = n + output;
        let through = self.linear.slopes[row * width + 2 * n + input];
        let value = (0..n).map(|k| self.dynamic(row, k, s) * states[k]).sum::<Complex64>();
        if let Some(gradient) = gradient {
            for each in &self.sensitivities {
                let outer = if each.row < n {
                    -adjoint[each.row]
                } else if each.row == row {
                    Complex64::new(1.0, 0.0)
                } else {
                    continue;
                };
                let inner = match each.column {
                    column if column < n => s * states[column],
                    column if column < 2 * n => states[column - n],
                    column if column == 2 * n + input => Complex64::new(1.0, 0.0),
                    _ => continue,
                };
                gradient[each.parameter] += outer * inner * each.value;
            }
        }
        value + through
    }
}

impl ResponseModel for FreeStateSpace<'_> {
    fn n_responses(&self) -> usize {
        self.pairs.len()
    }

    fn n_free(&self) -> usize {
        self.free.len()
    }

    fn prepare(&mut self, free: &[f64], with_gradient: bool) -> Result<(), CoreError> {
        for (&place, &value) in self.free.iter().zip(free) {
            self.values[place] = value;
        }
        self.linear = self.tape.linearise(self.point, &self.values)?;
        if with_gradient {
            let (point, values) = (self.point, &self.values);
            self.sensitivities = self.tape.sensitivities(point, values, &self.free)?;
            self.delay_slopes = self.tape.delay_slopes(point, values, &self.free)?;
        }
        let solved = self.omega.iter().map(|&omega| self.solve(omega)).collect::<Result<_, _>>()?;
        self.solved = solved;
        Ok(())
    }

    fn response(
        &self,
        response: usize,
        omega: f64,
        mut gradient: Option<&mut [Complex64]>,
    ) -> Complex64 {
        let pair = self.pairs[response];
        let s = Complex64::new(0.0, omega);
        if let Some(gradient) = gradient.as_deref_mut() {
            gradient.fill(Complex64::default());
        }
        let known = self.omega.binary_search_by(|each| each.total_cmp(&omega)).ok();
        let value = match known.and_then(|place| self.solved.get(place)) {
            Some(solved) => self.undelayed(pair, s, solved, gradient.as_deref_mut()),
            None => match self.solve(omega) {
                Ok(solved) => self.undelayed(pair, s, &solved, gradient.as_deref_mut()),
                Err(_) => return Complex64::new(f64::NAN, f64::NAN),
            },
        };
        let n_free = self.free.len();
        if let Some(gradient) = gradient {
            let delays = &self.delay_slopes[pair.1 * n_free..(pair.1 + 1) * n_free];
            for (entry, delay) in gradient.iter_mut().zip(delays) {
                *entry = *entry / value - s * delay;
            }
        }
        let delay = self.linear.values[self.tape.height() + pair.1];
        value * Complex64::cis(-omega * delay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_tape::tests::text;

    const VALUES: [f64; 4] = [2.0, 0.3, 5.0, 0.01];
    const PAIRS: [(usize, usize); 2] = [(0, 0), (1, 0)];

    fn example() -> ModelTape {
        let equations = [("x'", "v"), ("m*v' + c*x'", "-k*x - twice*v + f/m")];
        ModelTape::new(&text(&equations, &["v' - k*x", "x + c*f"])).unwrap()
    }

    #[test]
    fn value_is_the_formula() {
        let tape = example();
        let mut model = FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &VALUES, &[], [7.0]).unwrap();
        model.prepare(&[], false).unwrap();
        for omega in [7.0, 3.0] {
            let s = Complex64::new(0.0, omega);
            let x = 0.5 / (2.0 * s * s + (0.3 + 1.2) * s + 5.0);
            let late = Complex64::cis(-0.02 * omega);
            let expected = [(s * s - 5.0) * x * late, (x + 0.3) * late];
            for (place, wanted) in expected.into_iter().enumerate() {
                assert!((model.response(place, omega, None) - wanted).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn gradient_of_log_matches_differences() {
        let tape = example();
        let free = [3, 0, 1, 2];
        let make = || FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &VALUES, &free, [7.0]).unwrap();
        let start = free.map(|place| VALUES[place]);
        let mut model = make();
        model.prepare(&start, true).unwrap();
        for (response, omega) in [(0, 7.0), (1, 7.0), (1, 2.0)] {
            let mut gradient = [Complex64::default(); 4];
            model.response(response, omega, Some(&mut gradient));
            for k in 0..4 {
                let h = 1e-6 * start[k];
                let at = |change: f64| {
                    let (mut model, mut values) = (make(), start);
                    values[k] += change;
                    model.prepare(&values, false).unwrap();
                    model.response(response, omega, None).ln()
                };
                let central = (at(h) - at(-h)) / (2.0 * h);
                let error = (gradient[k] - central).norm();
                assert!(error < 1e-8 * central.norm().max(1.0), "{response} {k}: {error}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let tape = example();
        let point = [0.0; 5];
        let outside = [(2, 0)];
        let no_output = FreeStateSpace::new(&tape, &outside, &point, &VALUES, &[], []);
        assert!(matches!(no_output, Err(CoreError::Shape { .. })));
        let no_parameter = FreeStateSpace::new(&tape, &PAIRS, &point, &VALUES, &[4], []);
        assert!(matches!(no_parameter, Err(CoreError::Shape { .. })));
    }

    #[test]
    fn a_pole_on_the_axis_is_an_error() {
        let tape = example();
        // No damping: the pole lies at sqrt(k/m).
        let values = [2.0, 0.0, 8.0, 0.0];
        let mut model = FreeStateSpace::new(&tape, &PAIRS, &[0.0; 5], &values, &[], [2.0]).unwrap();
        assert!(matches!(model.prepare(&[], false), Err(CoreError::Singular { .. })));
    }
}
