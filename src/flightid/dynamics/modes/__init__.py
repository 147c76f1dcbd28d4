"""Modes of motion: eigenvalues, participation, names, approximations."""
