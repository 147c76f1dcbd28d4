//! State-space models as linear systems with derivatives by their parameters.
//! (Python side: identification/output_error/fit.py)

use crate::error::CoreError;
use crate::output_error::linear_family::{LinearFamily, LinearPoint, Values};
use crate::state_space::model_tape::ModelTape;

/// A state-space model linearised at its point; what its equations hold beside the linear terms
/// (constants, the trim) drives it as a constant input.
#[derive(Debug, Clone)]
pub struct StateSpaceFamily<'a> {
    tape: &'a ModelTape,
    point: &'a [f64],
    values: Values,
    columns: Vec<Option<usize>>,
}

impl<'a> StateSpaceFamily<'a> {
    /// Take the values of all parameters and the indices of those that vary.
    ///
    /// # Errors
    /// `Shape` for what does not fit, `NotFinite` where the model has no linearisation.
    pub fn new(
        tape: &'a ModelTape,
        point: &'a [f64],
        values: &[f64],
        free: &[usize],
    ) -> Result<Self, CoreError> {
        let values = Values::new(values, free, tape.n_parameters())?;
        let mut columns: Vec<_> = (0..tape.n_inputs()).map(Some).collect();
        columns.push(None);
        let mut family = Self { tape, point, values, columns };
        let theta: Vec<f64> = free.iter().map(|&place| family.values.all[place]).collect();
        let first = family.at(&theta, true)?;
        // Most models have no constant terms: their constant input is left out.
        let m = family.columns.len();
        let acts = |each: &LinearPoint| {
            let last = |matrix: &[f64]| matrix.chunks_exact(m).any(|row| row[m - 1] != 0.0);
            last(&each.b) || last(&each.d)
        };
        if !acts(&first) && !first.slopes.iter().any(acts) {
            family.columns.pop();
        }
        Ok(family)
    }

    /// Constant terms of equations and outputs, from slopes and values at the point.
    fn constants(&self, slopes: &[f64], values: &[f64]) -> Vec<f64> {
        slopes
            .chunks_exact(self.tape.width())
            .zip(values)
            .map(|(row, value)| row.iter().zip(self.point).map(|(s, z)| s * z).sum::<f64>() - value)
            .collect()
    }
}

/// [F G k] and [H₁ H₀ D k] from slopes of residuals and outputs and their constants.
struct Parts {
    mass: Vec<f64>,
    right: Vec<f64>,
    rate: Vec<f64>,
    state: Vec<f64>,
    through: Vec<f64>,
}

impl Parts {
    fn new(tape: &ModelTape, slopes: &[f64], constants: &[f64], m: usize) -> Self {
        let (n, width, inputs) = (tape.n_states(), tape.width(), tape.n_inputs());
        let mut parts = Self {
            mass: Vec::new(),
            right: Vec::new(),
            rate: Vec::new(),
            state: Vec::new(),
            through: Vec::new(),
        };
        for (k, row) in slopes.chunks_exact(width).enumerate() {
            let extra = if m > inputs { Some(constants[k]) } else { None };
            if k < n {
                parts.mass.extend(&row[..n]);
                parts.right.extend(row[n..].iter().map(|value| -value).chain(extra));
            } else {
                parts.rate.extend(&row[..n]);
                parts.state.extend(&row[n..2 * n]);
                parts.through.extend(row[2 * n..].iter().copied().chain(extra.map(|c| -c)));
            }
        }
        parts
    }
}

/// result += a (rows × inner) · b (inner × columns).
fn add_matrices(result: &mut [f64], a: &[f64], b: &[f64], inner: usize, columns: usize) {
    if columns == 0 || inner == 0 {
        return;
    }
    for (line, row) in result.chunks_exact_mut(columns).zip(a.chunks_exact(inner)) {
        for (&factor, other) in row.iter().zip(b.chunks_exact(columns)) {
            line.iter_mut().zip(other).for_each(|(entry, value)| *entry += factor * value);
        }
    }
}

fn split(joined: &[f64], n: usize, m: usize) -> (Vec<f64>, Vec<f64>) {
    let rows = joined.chunks_exact((n + m).max(1));
    (
        rows.clone().flat_map(|row| &row[..n]).copied().collect(),
        rows.flat_map(|row| &row[n..]).copied().collect(),
    )
}

impl LinearFamily for StateSpaceFamily<'_> {
    fn n_states(&self) -> usize {
        self.tape.n_states()
    }

    fn n_outputs(&self) -> usize {
        self.tape.n_outputs()
    }

    fn n_inputs(&self) -> usize {
        self.tape.n_inputs()
    }

    fn n_parameters(&self) -> usize {
        self.values.free.len()
    }

    fn columns(&self) -> &[Option<usize>] {
        &self.columns
    }

    fn at(&self, theta: &[f64], with_slopes: bool) -> Result<LinearPoint, CoreError> {
        let (tape, values) = (self.tape, self.values.at(theta));
        let (n, p, m) = (tape.n_states(), tape.n_outputs(), self.columns.len());
        let linear = tape.linearise(self.point, &values)?;
        let parts =
            Parts::new(tape, &linear.slopes, &self.constants(&linear.slopes, &linear.values), m);
        let inverse = inverted(&parts.mass, n)?;
        let mut joined = vec![0.0; n * (n + m)];
        add_matrices(&mut joined, &inverse, &parts.right, n, n + m);
        let (a, b) = split(&joined, n, m);
        let (mut c, mut d) = (parts.state.clone(), parts.through.clone());
        add_matrices(&mut c, &parts.rate, &a, n, n);
        add_matrices(&mut d, &parts.rate, &b, n, m);
        let late = |values: &[f64]| {
            let mut delays = values.to_vec();
            delays.resize(m, 0.0);
            delays
        };
        let delays_s = late(&linear.values[tape.height()..]);
        let mut found = LinearPoint { a, b, c, d, delays_s, slopes: Vec::new() };
        if !with_slopes {
            return Ok(found);
        }
        let free = &self.values.free;
        let sensitivities = tape.sensitivities(self.point, &values, free)?;
        let moved = tape.value_slopes(self.point, &values, free)?;
        let (size, count) = (tape.height() * tape.width(), free.len());
        let mut dense = vec![0.0; count * size];
        for each in sensitivities {
            dense[each.parameter * size + each.row * tape.width() + each.column] = each.value;
        }
        for (j, slopes) in dense.chunks_exact(size.max(1)).enumerate() {
            let change: Vec<f64> = moved.iter().skip(j).step_by(count).copied().collect();
            let each = Parts::new(tape, slopes, &self.constants(slopes, &change), m);
            // M dA = dF − dM A, and so for B.
            let mut right = each.right.clone();
            let negative: Vec<f64> = each.mass.iter().map(|value| -value).collect();
            add_matrices(&mut right, &negative, &joined, n, n + m);
            let mut both = vec![0.0; n * (n + m)];
            add_matrices(&mut both, &inverse, &right, n, n + m);
            let (a, b) = split(&both, n, m);
            let (mut c, mut d) = (each.state.clone(), each.through.clone());
            for (rate, a, b) in [(&parts.rate, &a, &b), (&each.rate, &found.a, &found.b)] {
                add_matrices(&mut c, rate, a, n, n);
                add_matrices(&mut d, rate, b, n, m);
            }
            let delays_s = late(&change[tape.height()..]);
            found.slopes.push(LinearPoint { a, b, c, d, delays_s, slopes: Vec::new() });
        }
        debug_assert_eq!(found.c.len(), p * n);
        Ok(found)
    }
}

/// Inverse of the factors of the state derivatives, most often the identity.
fn inverted(mass: &[f64], n: usize) -> Result<Vec<f64>, CoreError> {
    let singular = CoreError::Singular { what: "the matrix of factors of the state derivatives" };
    let mut work = mass.to_vec();
    let mut inverse = vec![0.0; n * n];
    (0..n).for_each(|i| inverse[i * (n + 1)] = 1.0);
    for k in 0..n {
        let pivot =
            (k..n).fold(
                k,
                |best, i| if work[i * n + k].abs() > work[best * n + k].abs() { i } else { best },
            );
        let largest = (0..n).map(|j| work[pivot * n + j].abs()).fold(0.0, f64::max);
        if work[pivot * n + k].abs() <= 1e-14 * largest {
            return Err(singular);
        }
        for j in 0..n {
            work.swap(k * n + j, pivot * n + j);
            inverse.swap(k * n + j, pivot * n + j);
        }
        let scale = 1.0 / work[k * n + k];
        for j in 0..n {
            work[k * n + j] *= scale;
            inverse[k * n + j] *= scale;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = work[i * n + k];
            if factor != 0.0 {
                for j in 0..n {
                    work[i * n + j] -= factor * work[k * n + j];
                    inverse[i * n + j] -= factor * inverse[k * n + j];
                }
            }
        }
    }
    Ok(inverse)
}
