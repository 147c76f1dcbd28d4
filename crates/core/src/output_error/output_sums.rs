//! What one record's rows sum up to, output by output, so that weights can be given afterwards: one
//! pass serves the cost of a trial point, its noise covariance and its linearisation.
//! (Python side: identification/output_error/fit.py)

use crate::numerics::widest::widest;
use crate::output_error::bias_sums::BiasSums;
use crate::output_error::model_on_records::LANES;
use crate::output_error::normal_equations::add_rows;
use crate::output_error::output_error_weights::{Moments, Weights};

/// Products and sums of rows before any weight.
#[derive(Debug, Clone, Default)]
pub struct OutputSums {
    stride: usize,
    n_outputs: usize,
    count: usize,
    /// By output, stride × stride; on and above the diagonal of tiles.
    products: Vec<f64>,
    /// By output, stride.
    sums: Vec<f64>,
}

impl OutputSums {
    /// Begin anew with rows of this length.
    pub fn clear(&mut self, n_outputs: usize, stride: usize) {
        (self.stride, self.n_outputs, self.count) = (stride, n_outputs, 0);
        for (values, size) in [
            (&mut self.products, n_outputs * stride * stride),
            (&mut self.sums, n_outputs * stride),
        ] {
            values.clear();
            values.resize(size, 0.0);
        }
    }

    /// Add whole samples; without biases the plain sums are not asked for.
    pub fn add(&mut self, rows: &[f64], has_bias: bool) {
        let (p, stride) = (self.n_outputs, self.stride);
        self.count += rows.len() / (p * stride).max(1);
        for (o, products) in self.products.chunks_exact_mut((stride * stride).max(1)).enumerate() {
            add_rows(products, &rows[o * stride..], stride, p);
        }
        if has_bias {
            widest(
                #[inline(always)]
                || add_columns(&mut self.sums, rows),
            );
        }
    }

    /// Products (stride × stride, on and above the diagonal of tiles) and sums of each output.
    pub fn by_output(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let stride = self.stride.max(1);
        self.products.chunks_exact(stride * stride).zip(self.sums.chunks_exact(stride))
    }

    /// Moments of the residuals under uncorrelated weights without a limit.
    pub fn moments(&self, weights: &Weights) -> Moments {
        let p = self.n_outputs;
        let mut found = Moments { count: self.count, ..Moments::new(p) };
        for (o, products) in
            self.products.chunks_exact((self.stride * self.stride).max(1)).enumerate()
        {
            let square = weights.inverse()[o * (p + 1)].powi(2) * products[0];
            found.products[o * (p + 1)] = square;
            found.cost += square;
        }
        found
    }

    /// Products of all outputs, and sums for biases, under uncorrelated weights without a limit.
    pub fn weighed(&self, weights: &Weights) -> (Vec<f64>, BiasSums) {
        let (p, stride) = (self.n_outputs, self.stride);
        let mut gram = vec![0.0; stride * stride];
        let mut sums = BiasSums { weight: vec![self.count as f64; p], rows: self.sums.clone() };
        for (o, products) in self.products.chunks_exact((stride * stride).max(1)).enumerate() {
            let factor = weights.inverse()[o * (p + 1)];
            let square = factor * factor;
            gram.iter_mut().zip(products).for_each(|(sum, value)| *sum += square * value);
            sums.rows[o * stride..(o + 1) * stride].iter_mut().for_each(|value| *value *= factor);
        }
        (gram, sums)
    }
}

/// Sums over the samples, a few columns at a time in registers.
#[inline(always)]
fn add_columns(sums: &mut [f64], rows: &[f64]) {
    let length = sums.len();
    for (chunk, into) in sums.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let mut sum = [0.0; LANES];
        for row in rows.chunks_exact(length) {
            if let Some(values) = row[chunk * LANES..].first_chunk::<LANES>() {
                sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        }
        into.iter_mut().zip(sum).for_each(|(into, each)| *into += each);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output_error::output_error_weights::Noise;
    use crate::output_error::record_data::RecordData;

    #[test]
    fn weights_given_afterwards_are_weights_given_first() {
        let noise = Noise { full: false, limit: f64::INFINITY, consistency: 1.0 };
        let measured = vec![0.0, 0.0, 1.0, -4.0, 2.0, 8.0];
        let data = [RecordData { measured, ..RecordData::default() }];
        let weights = Weights::new(&noise, &data, 2).unwrap();
        let rows: Vec<f64> = (0..3 * 2 * LANES).map(|k| (k as f64).sin()).collect();
        let mut sums = OutputSums::default();
        sums.clear(2, LANES);
        sums.add(&rows[..2 * LANES], true);
        sums.add(&rows[2 * LANES..], true);
        let mut white = rows.clone();
        white.chunks_exact_mut(2 * LANES).for_each(|sample| weights.whiten(sample, LANES));
        let mut wanted = vec![0.0; LANES * LANES];
        add_rows(&mut wanted, &white, LANES, 1);
        let (gram, biases) = sums.weighed(&weights);
        let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-13, "{x} {y}");
        gram.iter().zip(&wanted).for_each(|(&x, &y)| near(x, y));
        near(sums.moments(&weights).cost, wanted[0]);
        for (k, &found) in biases.rows.iter().enumerate() {
            near(found, white.iter().skip(k).step_by(2 * LANES).sum());
        }
        assert_eq!(biases.weight, [3.0, 3.0]);
    }
}
