//! What a fit to frequency responses asks of a model. (Python side:
//! identification/frequency_domain/fit.py)

use num_complex::Complex64;

use crate::error::CoreError;

/// A model that gives responses and the gradient of their logarithm.
pub trait ResponseModel {
    /// Number of responses.
    fn n_responses(&self) -> usize;
    /// Number of parameters that vary.
    fn n_free(&self) -> usize;
    /// Take new values of the free parameters.
    ///
    /// # Errors
    /// Where the model has no meaning at these values.
    fn prepare(&mut self, free: &[f64], with_gradient: bool) -> Result<(), CoreError>;
    /// H(jω) of one response; the gradient of log H (n_free) is written where asked for.
    fn response(
        &self,
        response: usize,
        omega: f64,
        gradient: Option<&mut [Complex64]>,
    ) -> Complex64;
    /// H(jω) of one response at several frequencies; the gradients of log H (n_omega × n_free) are
    /// written where asked for.
    fn responses(
        &self,
        response: usize,
        omega: &[f64],
        values: &mut [Complex64],
        gradients: Option<&mut [Complex64]>,
    ) {
        match gradients {
            Some(gradients) if self.n_free() > 0 => {
                let rows = gradients.chunks_exact_mut(self.n_free());
                for ((value, &each), row) in values.iter_mut().zip(omega).zip(rows) {
                    *value = self.response(response, each, Some(row));
                }
            }
            _ => {
                for (value, &each) in values.iter_mut().zip(omega) {
                    *value = self.response(response, each, None);
                }
            }
        }
    }
}
