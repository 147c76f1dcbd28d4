"""Options of an estimate of frequency responses; see `flightid.estimate_response`."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.record.hold import LOOPS, Loop
from flightid.responses.windows.defaults import DEFAULT_FREQUENCIES, DEFAULT_OVERLAP

ESTIMATORS = ("auto", "composite", "instrument", "local_polynomial", "periodic", "prewhitened")
DETRENDS = ("none", "mean", "line")
AUTOMATIC = "auto"
"""Word for windows that nobody chose."""


@dataclass(frozen=True)
class ResponseOptions(Options):
    """Options of `flightid.estimate_response`."""

    band_rad_s: tuple[float, float] | None = option(
        None,
        unit="rad/s",
        above=0.0,
        doc="Lowest and highest frequency; default: what the records carry.",
    )
    excitations: tuple[str, ...] | None = option(
        None,
        doc="Injected signals, independent of noise: for 'instrument', and for 'auto' where named.",
    )
    loop: Loop | None = option(
        None, choices=LOOPS, doc="Whether a loop was closed; default: a test decides."
    )
    estimator: str = option(
        "auto",
        choices=ESTIMATORS,
        doc="Found from the inputs; direct; by way of the excitation, for closed loops; without "
        "windows; at harmonics; or with a model of the noise, for loops without an excitation.",
    )
    n_omega: int = option(DEFAULT_FREQUENCIES, minimum=2, doc="Log-spaced frequencies in the band.")
    window_s: str | float | Sequence[float] = option(
        AUTOMATIC, unit="s", above=0.0, choices=(AUTOMATIC,), doc="Window lengths."
    )
    overlap: float = option(
        DEFAULT_OVERLAP, minimum=0.0, below=1.0, doc="Overlap of neighbouring windows."
    )
    detrend: str = option("mean", choices=DETRENDS, doc="What is removed from each window.")
    covariance: bool = option(True, doc="Keep what the covariance of errors needs.")
