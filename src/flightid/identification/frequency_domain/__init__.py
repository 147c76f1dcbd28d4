"""Fits to frequency responses (native: `frequency_fit.rs`)."""
