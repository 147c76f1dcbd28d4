"""Uncertainty: how well numbers are known, and what that makes of others computed from them."""

from flightid.uncertainty.cramer_rao import correlation, cramer_rao, gauss_newton_hessian
from flightid.uncertainty.estimate import Estimate, Reading, estimate_table
from flightid.uncertainty.insensitivity import insensitivity, null_combination
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.response_errors import (
    decibel_phase_sensitivity,
    estimator_gain,
    window_covariance,
)
from flightid.uncertainty.uncertain import Uncertain, uncertain_numbers

__all__ = [
    "Estimate",
    "Reading",
    "Uncertain",
    "correlation",
    "cramer_rao",
    "decibel_phase_sensitivity",
    "estimate_table",
    "estimator_gain",
    "gauss_newton_hessian",
    "half_width",
    "insensitivity",
    "null_combination",
    "uncertain_numbers",
    "window_covariance",
]
