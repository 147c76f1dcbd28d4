"""Dynamics: what a model says of the vehicle's motion."""

from flightid.dynamics.eigenvalues import Eigenvalue, eigenvalue_table, eigenvalues_of

__all__ = ["Eigenvalue", "eigenvalue_table", "eigenvalues_of"]
