"""Inference: how well a fit knows its parameters. Plain arrays in, plain arrays out."""

from flightid.inference.covariance import (
    decibel_phase_sensitivity,
    estimator_gain,
    interval95,
    propagate,
    window_covariance,
)
from flightid.inference.cramer_rao import correlation, cramer_rao, gauss_newton_hessian
from flightid.inference.insensitivity import insensitivity, null_combination

__all__ = [
    "correlation",
    "cramer_rao",
    "decibel_phase_sensitivity",
    "estimator_gain",
    "gauss_newton_hessian",
    "insensitivity",
    "interval95",
    "null_combination",
    "propagate",
    "window_covariance",
]
