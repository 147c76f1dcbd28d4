"""Spectra of outputs and residuals, compared."""
