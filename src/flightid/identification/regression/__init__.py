"""Equation error and the Fourier methods."""
