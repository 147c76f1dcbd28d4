//! Columns of the normal equations that output biases add, from sums over the rows alone.
//! (Python side: identification/output_error/fit.py)

use crate::output_error::record_data::RecordData;

/// Sums that bias columns need: for each whitened output Σ w and Σ √w · row.
#[derive(Debug, Clone)]
pub struct BiasSums {
    /// By output.
    pub weight: Vec<f64>,
    /// By output, one row each.
    pub rows: Vec<f64>,
}

impl BiasSums {
    /// Add one whitened row of an output.
    pub fn add(&mut self, output: usize, weight: f64, row: &[f64]) {
        let root = weight.sqrt();
        self.weight[output] += weight;
        let sums = &mut self.rows[output * row.len()..(output + 1) * row.len()];
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += root * value);
    }

    /// Normal equations in the order initial states, shifts, biases, θ, residual.
    pub fn ordered(
        &self,
        gram: &[f64],
        stride: usize,
        n_theta: usize,
        data: &RecordData,
        inverse: &[f64],
    ) -> Vec<f64> {
        let p = self.weight.len();
        let (runs, biases) = (data.free_initial.len() + data.free_shift.len(), &data.free_bias);
        let width = runs + biases.len() + n_theta + 1;
        // Column of a run's row; None for a bias.
        let column = |k: usize| match k {
            k if k < runs => Some(1 + n_theta + k),
            k if k < runs + biases.len() => None,
            k if k + 1 < width => Some(1 + k - runs - biases.len()),
            _ => Some(0),
        };
        let mut result = vec![0.0; width * width];
        for i in 0..width {
            for j in i..width {
                result[i * width + j] = match (column(i), column(j)) {
                    (Some(a), Some(b)) => gram[a.min(b) * stride + a.max(b)],
                    (Some(a), None) => self.mixed(inverse, biases[j - runs], a, stride),
                    (None, Some(b)) => self.mixed(inverse, biases[i - runs], b, stride),
                    (None, None) => (0..p)
                        .map(|o| {
                            let row = &inverse[o * p..(o + 1) * p];
                            row[biases[i - runs]] * row[biases[j - runs]] * self.weight[o]
                        })
                        .sum(),
                };
            }
        }
        result
    }

    fn mixed(&self, inverse: &[f64], bias: usize, column: usize, stride: usize) -> f64 {
        let p = self.weight.len();
        (0..p).map(|o| inverse[o * p + bias] * self.rows[o * stride + column]).sum()
    }
}
