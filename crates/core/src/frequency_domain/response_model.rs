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
    /// H(jω) of one response at several frequencies; the gradients of log H (n_omega × n_free) are
    /// written where asked for.
    fn responses(
        &self,
        response: usize,
        omega: &[f64],
        values: &mut [Complex64],
        gradients: Option<&mut [Complex64]>,
    );
    /// The same at one frequency.
    fn response(
        &self,
        response: usize,
        omega: f64,
        gradient: Option<&mut [Complex64]>,
    ) -> Complex64 {
        let mut value = [Complex64::default()];
        self.responses(response, &[omega], &mut value, gradient);
        value[0]
    }
}
