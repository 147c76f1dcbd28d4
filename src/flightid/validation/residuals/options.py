"""Options of residual tests; see `flightid.residual_tests`."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class ResidualTestOptions(Options):
    """Against what residuals are tested, and how far apart.

    Example
    -------
    >>> ResidualTestOptions().maximum_lag
    25
    """

    excitations: tuple[str, ...] | None = option(
        None,
        doc="Injected signals that free runs are tested against where a loop was closed; default: "
        "the records' own.",
    )
    loop: str | None = option(
        None,
        choices=("open", "closed", "closed within the sample"),
        doc="Whether residuals reach the inputs; default: what records know, else a test.",
    )
    maximum_lag: int = option(25, minimum=1, doc="Largest lag, samples.")
