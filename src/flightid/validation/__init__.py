"""Validation: how a model predicts what it has not seen.

>>> from flightid import validation
>>> float(validation.theil([1.0, -1.0], [1.0, -1.0]))
0.0
"""

from flightid.validation.comparison import Comparison, Contrast
from flightid.validation.correlation_test import CorrelationTest, Horizon, Kind, Loop, Verdict
from flightid.validation.cross_validation import cross_validate
from flightid.validation.cross_validation_result import CrossRun, CrossValidation
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
from flightid.validation.narx_search import NarxSearch, search_narx
from flightid.validation.order_scan import scan_orders
from flightid.validation.order_scan_result import OrderScan, OrderTrial
from flightid.validation.residual_result import ResidualTests
from flightid.validation.residuals import residual_tests
from flightid.validation.shifts import Shifts
from flightid.validation.spectra import compare_spectra, residual_spectra
from flightid.validation.spectra_result import Peak, ResidualSpectra, SpectrumComparison
from flightid.validation.verification import Prediction, Verification
from flightid.validation.verify import verify

__all__ = [
    "Comparison",
    "Contrast",
    "CorrelationTest",
    "CrossRun",
    "CrossValidation",
    "Envelopes",
    "Horizon",
    "Kind",
    "Loop",
    "Mismatch",
    "NarxSearch",
    "OrderScan",
    "OrderTrial",
    "Peak",
    "Prediction",
    "ResidualSpectra",
    "ResidualTests",
    "Shifts",
    "SpectrumComparison",
    "Verdict",
    "Verification",
    "compare_spectra",
    "cross_validate",
    "fit_percent",
    "mismatch",
    "mse",
    "muad_envelopes",
    "r_squared",
    "residual_spectra",
    "residual_tests",
    "rms_error",
    "scan_orders",
    "search_narx",
    "theil",
    "vaf_percent",
    "verify",
    "weighted_rms",
]
