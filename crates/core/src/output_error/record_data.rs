//! One record's measurements and what of its own numbers is free. (Python side:
//! identification/records/setup.py)

use crate::error::CoreError;

/// One record's measurements, the start of its own numbers, and which of them are free.
#[derive(Debug, Clone, Default)]
pub struct RecordData {
    /// Measured outputs, sample by sample (n_samples × n_outputs).
    pub measured: Vec<f64>,
    /// Initial state.
    pub initial: Vec<f64>,
    /// Added to each input.
    pub shift: Vec<f64>,
    /// Added to each output.
    pub bias: Vec<f64>,
    /// Entries of the initial state that are free.
    pub free_initial: Vec<usize>,
    /// Inputs whose shift is free.
    pub free_shift: Vec<usize>,
    /// Outputs whose bias is free.
    pub free_bias: Vec<usize>,
    /// Least and largest value of each free number; empty without bounds.
    pub limits: Vec<(f64, f64)>,
}

impl RecordData {
    /// Require what belongs to a record of so many samples, outputs, initial states and inputs.
    ///
    /// # Errors
    /// `Shape` for lengths and places that do not fit, `Range` for bounds that hold no number.
    pub fn require(
        &self,
        n_samples: usize,
        n_outputs: usize,
        n_initial: usize,
        n_inputs: usize,
    ) -> Result<(), CoreError> {
        same("measured values", self.measured.len(), n_samples * n_outputs)?;
        same("initial state", self.initial.len(), n_initial)?;
        same("input shifts", self.shift.len(), n_inputs)?;
        same("output biases", self.bias.len(), n_outputs)?;
        if !self.limits.is_empty() {
            same("bounds of free numbers", self.limits.len(), self.n_free())?;
        }
        let crossed = |&&(low, high): &&(f64, f64)| low.is_nan() || high.is_nan() || low > high;
        if let Some(&(found, _)) = self.limits.iter().find(crossed) {
            let (what, needed) = ("lower bound of a free number", "at most the upper bound");
            return Err(CoreError::Range { what, found, needed });
        }
        let places = [
            (&self.free_initial, n_initial),
            (&self.free_shift, n_inputs),
            (&self.free_bias, n_outputs),
        ];
        for (places, needed) in places {
            if let Some(&found) = places.iter().find(|&&k| k >= needed) {
                return Err(CoreError::Shape { what: "index of a free number", found, needed });
            }
        }
        Ok(())
    }

    /// Numbers of this record that are free.
    pub fn n_free(&self) -> usize {
        self.free_initial.len() + self.free_shift.len() + self.free_bias.len()
    }

    /// Take numbers at a bound that the residuals push outward out of normal equations whose last
    /// column is the residual.
    pub fn hold(&self, values: &[f64], gram: &mut [f64], width: usize) {
        for (k, (&value, &(low, high))) in values.iter().zip(&self.limits).enumerate() {
            let slope = gram[k * width + width - 1];
            if (value <= low && slope > 0.0) || (value >= high && slope < 0.0) {
                (0..width).for_each(|i| gram[i.min(k) * width + i.max(k)] = 0.0);
            }
        }
    }

    /// The values of the free numbers: initial states, shifts, biases.
    pub fn free_values(&self) -> Vec<f64> {
        let parts = [
            (&self.free_initial, &self.initial),
            (&self.free_shift, &self.shift),
            (&self.free_bias, &self.bias),
        ];
        parts.iter().flat_map(|(places, from)| places.iter().map(|&k| from[k])).collect()
    }

    /// Initial state, shifts and biases with these values of the free numbers.
    pub fn moved(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let (mut initial, mut shift, mut bias) =
            (self.initial.clone(), self.shift.clone(), self.bias.clone());
        let mut values = values.iter();
        let mut place = |places: &[usize], into: &mut [f64]| {
            for (&k, &value) in places.iter().zip(values.by_ref()) {
                into[k] = value;
            }
        };
        place(&self.free_initial, &mut initial);
        place(&self.free_shift, &mut shift);
        place(&self.free_bias, &mut bias);
        (initial, shift, bias)
    }
}

/// Require a length.
pub(crate) fn same(what: &'static str, found: usize, needed: usize) -> Result<(), CoreError> {
    if found == needed { Ok(()) } else { Err(CoreError::Shape { what, found, needed }) }
}

/// Inputs of one record (n_inputs × n_samples, time last) on its time base.
#[derive(Debug, Clone)]
pub struct RecordInputs {
    /// Measured inputs.
    pub inputs: Vec<f64>,
    /// Number of samples.
    pub n_samples: usize,
    /// Sample time, s.
    pub sample_s: f64,
}
