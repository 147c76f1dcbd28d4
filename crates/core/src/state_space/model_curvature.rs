//! Second derivatives, by parameters, of the matrices and delays of a model: third derivatives of its
//! tape, from dual numbers of dual numbers of dual numbers. (Python side: models/state_space/model.py)

use crate::error::CoreError;
use crate::numerics::dual::{Dual, Scalar};
use crate::state_space::model_tape::{MAXIMUM_SENSITIVITIES, ModelTape};

const LANES: usize = 4;
type Second = Dual<f64, 1>;
type First = Dual<Second, LANES>;
type Slope = Dual<First, LANES>;

/// Second derivative of one entry of `Linearisation::slopes` by two parameters, first ≤ second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// Row: equation, then output, then delay.
    pub row: usize,
    /// Column in z; zero for a delay.
    pub column: usize,
    /// Place in the list of parameters asked for.
    pub first: usize,
    /// Place of the other one.
    pub second: usize,
    /// Derivative.
    pub value: f64,
}

impl ModelTape {
    /// Second derivatives by some of the parameters of every entry of ∂(r, y)/∂z, and of every delay,
    /// that has one.
    ///
    /// # Errors
    /// As `sensitivities`.
    pub fn curvatures(
        &self,
        point: &[f64],
        parameters: &[f64],
        free: &[usize],
    ) -> Result<Vec<Curvature>, CoreError> {
        let inputs = self.joined(point, parameters)?;
        self.check_free(free)?;
        let mut found = Vec::new();
        let mut registers: Vec<Slope> = Vec::new();
        let mut outputs = vec![Slope::constant(0.0); self.tape().n_outputs()];
        for (second, &parameter) in free.iter().enumerate() {
            for start in (0..=second).step_by(LANES) {
                let lanes = &free[start..(second + 1).min(start + LANES)];
                for first_column in (0..self.width()).step_by(LANES) {
                    let seeded = self.seeded(&inputs, parameter, lanes, first_column);
                    self.tape().run(&seeded, &mut registers, &mut outputs);
                    self.collect(&outputs, (start, lanes.len(), second), first_column, &mut found);
                    if found.len() > MAXIMUM_SENSITIVITIES {
                        let (found, needed) = (found.len(), MAXIMUM_SENSITIVITIES);
                        return Err(CoreError::Shape {
                            what: "second derivatives of a model",
                            found,
                            needed,
                        });
                    }
                }
            }
        }
        match found.iter().position(|each| !each.value.is_finite()) {
            Some(index) => Err(CoreError::NotFinite { what: "third derivative", index }),
            None => Ok(found),
        }
    }

    fn seeded(&self, inputs: &[f64], second: usize, first: &[usize], column: usize) -> Vec<Slope> {
        let width = self.width();
        let mut seeded: Vec<Slope> = inputs.iter().map(|&value| Slope::constant(value)).collect();
        for lane in 0..LANES.min(width - column) {
            let place = column + lane;
            seeded[place] = Slope::variable(First::constant(inputs[place]), lane);
        }
        seeded[width + second].value.value = Second::variable(inputs[width + second], 0);
        for (lane, &parameter) in first.iter().enumerate() {
            seeded[width + parameter].value.gradient[lane] = Second::constant(1.0);
        }
        seeded
    }

    fn collect(
        &self,
        outputs: &[Slope],
        (start, count, second): (usize, usize, usize),
        first_column: usize,
        found: &mut Vec<Curvature>,
    ) {
        let mut keep = |row: usize, column: usize, entry: &First| {
            for (lane, part) in entry.gradient.iter().take(count).enumerate() {
                let value = part.gradient[0];
                if value != 0.0 {
                    found.push(Curvature { row, column, first: start + lane, second, value });
                }
            }
        };
        let (height, columns) = (self.height(), LANES.min(self.width() - first_column));
        for (row, output) in outputs.iter().enumerate() {
            if row < height {
                for (offset, entry) in output.gradient.iter().take(columns).enumerate() {
                    keep(row, first_column + offset, entry);
                }
            } else if first_column == 0 {
                keep(row, 0, &output.value);
            }
        }
    }
}

#[cfg(test)]
#[path = "tests/model_curvature.rs"]
mod tests;
