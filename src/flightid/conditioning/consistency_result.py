"""Result of the kinematic consistency check."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import interval_words, shown


@dataclass(frozen=True)
class KinematicConsistency(
    Result,
    schema="flightid.kinematic_consistency/1",
    untold={
        "measured": "time histories",
        "reconstructed": "time histories",
        "corrected": "a record",
    },
):
    """How well rates, attitude, accelerations and velocities belong to one motion.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        Estimates by name.
    covariance : ndarray, shape (n_parameters, n_parameters)
        Covariance in the order of `parameters`, corrected for coloured residuals.
    correlation : ndarray, shape (n_parameters, n_parameters)
        Correlation of the estimates by the information matrix.
    measured : mapping of str to ndarray, shape (n,)
        Outputs as measured, angles without jumps, unit of the output.
    reconstructed : mapping of str to ndarray, shape (n,)
        Outputs rebuilt from the inputs with the estimated instrument errors, unit of the output.
    residual_rms : mapping of str to float
        Root mean square of measured less reconstructed output, unit of the output.
    fit_percent : mapping of str to float
        100 (1 − ‖z − ẑ‖/‖z − z̄‖) by output; None where the output stands still.
    corrected : Record
        The record without the estimated biases, scale factors and delays.
    findings : tuple of Finding
        Verdicts with what to do.

    Example
    -------
    >>> from flightid.conditioning import check_consistency
    >>> time_s = np.arange(500) / 50
    >>> rate = np.cos(time_s)
    >>> record = Record.from_arrays(time_s, outputs={"p": rate + 0.02, "q": 0 * rate,
    ...     "r": 0 * rate, "phi": np.sin(time_s), "theta": 0 * rate},
    ...     units={"p": "rad/s", "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad"})
    >>> check_consistency(record, estimate=["bias_p"])
    KinematicConsistency(500 samples, 3 parameters, worst fit 100 % (phi))
    """

    parameters: Mapping[str, Estimate]
    covariance: NDArray[np.float64]
    correlation: NDArray[np.float64]
    measured: Mapping[str, NDArray[np.float64]]
    reconstructed: Mapping[str, NDArray[np.float64]]
    residual_rms: Mapping[str, float]
    fit_percent: Mapping[str, float | None]
    corrected: Record
    findings: tuple[Finding, ...]

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the estimates with their intervals at a level."""
        level = shown(level)
        columns = (
            Column("parameter"),
            Column("unit"),
            Column("value"),
            Column(f"{interval_words(level)} from"),
            Column("to"),
            Column("significant"),
        )
        rows = tuple(
            (p.name, p.unit, p.value, *(p.interval(level) or (None, None)), p.is_significant)
            for p in self.parameters.values()
        )
        return Table(repr(self), columns, rows, tuple(map(str, self.findings)))

    def fits(self) -> Table:
        """Table of the outputs with residual and fit."""
        columns = (Column("output"), Column("residual"), Column("fit", "%"))
        rows = tuple((name, rms, self.fit_percent[name]) for name, rms in self.residual_rms.items())
        return Table("Outputs rebuilt from rates and accelerations", columns, rows)

    def __repr__(self) -> str:
        """Size and the worst fit on one line."""
        n = next(iter(self.reconstructed.values())).size
        fits = [(fit, name) for name, fit in self.fit_percent.items() if fit is not None]
        worst = f"worst fit {min(fits)[0]:.3g} % ({min(fits)[1]})" if fits else "nothing moves"
        return f"KinematicConsistency({n} samples, {len(self.parameters)} parameters, {worst})"

    def _tables(self) -> tuple[Table, ...]:
        return (self.summary(), self.fits())
