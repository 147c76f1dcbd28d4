"""Validation: how a model predicts what it has not seen.

>>> from flightid import validation
>>> float(validation.theil([1.0, -1.0], [1.0, -1.0]))
0.0
"""

from flightid.identification.prediction.result import Prediction, Shifts
from flightid.simulation.metrics import (
    fit_percent,
    mse,
    r_squared,
    rms_error,
    theil,
    vaf_percent,
    weighted_rms,
)
from flightid.validation.order_scan.narx_search import NarxSearch, search_narx
from flightid.validation.order_scan.result import OrderScan, OrderTrial
from flightid.validation.order_scan.scan_orders import scan_orders
from flightid.validation.residuals.correlation_result import (
    CorrelationTest,
    Horizon,
    Kind,
    Loop,
    Verdict,
)
from flightid.validation.residuals.residual_tests import residual_tests
from flightid.validation.residuals.result import ResidualTests
from flightid.validation.spectra.result import Peak, ResidualSpectra, SpectrumComparison
from flightid.validation.spectra.spectra import compare_spectra, residual_spectra
from flightid.validation.verification.comparison import Comparison, Contrast
from flightid.validation.verification.muad import Envelopes, Mismatch, mismatch, muad_envelopes
from flightid.validation.verification.result import Verification
from flightid.validation.verification.verify import verify

__all__ = [
    "Comparison",
    "Contrast",
    "CorrelationTest",
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


def __dir__() -> list[str]:
    return sorted(__all__)
