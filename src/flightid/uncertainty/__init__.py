"""Uncertainty: how well numbers are known, and what that makes of others computed from them."""

from flightid.uncertainty.covariance import (
    decibel_phase_sensitivity,
    estimator_gain,
    interval95,
    propagate,
    window_covariance,
)
from flightid.uncertainty.cramer_rao import correlation, cramer_rao, gauss_newton_hessian
from flightid.uncertainty.insensitivity import insensitivity, null_combination
from flightid.uncertainty.quantity import Quantity, quantity_table
from flightid.uncertainty.spread import Propagated, Spread

__all__ = [
    "Propagated",
    "Quantity",
    "Spread",
    "correlation",
    "cramer_rao",
    "decibel_phase_sensitivity",
    "estimator_gain",
    "gauss_newton_hessian",
    "insensitivity",
    "interval95",
    "null_combination",
    "propagate",
    "quantity_table",
    "window_covariance",
]
