"""Validation: how a model predicts what it has not seen.

>>> from flightid import validation
>>> float(validation.theil([1.0, -1.0], [1.0, -1.0]))
0.0
"""

from flightid.validation.metrics import (
    fit_percent,
    mse,
    r_squared,
    rms_error,
    theil,
    vaf_percent,
    weighted_rms,
)
from flightid.validation.muad import Envelopes, Mismatch, mismatch, muad_envelopes
from flightid.validation.shifts import Shifts
from flightid.validation.verification import Prediction, Verification
from flightid.validation.verify import verify

__all__ = [
    "Envelopes",
    "Mismatch",
    "Prediction",
    "Shifts",
    "Verification",
    "fit_percent",
    "mismatch",
    "mse",
    "muad_envelopes",
    "r_squared",
    "rms_error",
    "theil",
    "vaf_percent",
    "verify",
    "weighted_rms",
]
