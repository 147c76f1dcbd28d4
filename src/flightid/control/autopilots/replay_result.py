"""What a replay of a controller found."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.conventions import Light
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table

Samples = NDArray[np.float64]
QUIET = 1e-9
"""A logged term below this in size says nothing about a fit."""


@dataclass(frozen=True)
class TermReplay:
    """One term of the controller, logged and replayed.

    Attributes
    ----------
    name : str
        ``P``, ``I``, ``D``, ``FF``, ``DFF``, ``Tar``, ``Err``, or ``output`` for their sum.
    fit_percent : float or None
        100 (1 − rms error / deviation of the logged term); None where the term rests.
    rms_error, largest_error, rms_logged : float
        In the output's unit (``Tar`` and ``Err``: rad/s).
    """

    name: str
    fit_percent: float | None
    rms_error: float
    largest_error: float
    rms_logged: float


def compare(name: str, logged: Samples, replayed: Samples) -> TermReplay:
    """Judge one term."""
    error = replayed - logged
    deviation = float(np.std(logged))
    rms = float(np.sqrt(np.mean(error**2)))
    fit = None if deviation < QUIET else 100.0 * (1.0 - rms / deviation)
    largest = float(np.abs(error).max())
    return TermReplay(name, fit, rms, largest, float(np.sqrt(np.mean(logged**2))))


@dataclass(frozen=True)
class Replay(
    Result,
    schema="flightid.replay/1",
    untold={"time_s": "time histories", "logged": "time histories", "replayed": "time histories"},
):
    """A controller run on a log's set-point and rate, beside what the log says it put out.

    Attributes
    ----------
    log : str
        Name of the log.
    loop : AxisLoop
        The controller.
    time_s : ndarray, shape (n,)
        Stamps on the autopilot's clock, s.
    logged, replayed : mapping of str to ndarray, shape (n,)
        Terms by name; more are replayed than a log may hold.
    terms : tuple of TermReplay
        Their comparison, the output last.
    setpoint_lag_s, rate_lag_s : float
        By how much the logged set-point and rate had to be delayed to act as the log says, s.
    log_rate_hz : float
        Rows of the log per second.
    exact : bool
        True: every loop was logged, and nothing was interpolated.
    findings : tuple of Finding
        What holds, what does not, and why.

    Example
    -------
    >>> import flightid as fid
    >>> found = fid.replay(fid.read_log("flight.bin"), "roll")       # doctest: +SKIP
    >>> found["P"].fit_percent, found.findings[0].code               # doctest: +SKIP
    (100.0, 'replay-reproduced')
    """

    log: str
    loop: AxisLoop
    time_s: Samples
    logged: Mapping[str, Samples]
    replayed: Mapping[str, Samples]
    terms: tuple[TermReplay, ...]
    setpoint_lag_s: float
    rate_lag_s: float
    log_rate_hz: float
    exact: bool
    findings: tuple[Finding, ...]

    def __getitem__(self, name: str) -> TermReplay:
        """Comparison of a term by name."""
        return next(term for term in self.terms if term.name == name)

    def __repr__(self) -> str:
        """Axis, fit of the output and verdict on one line."""
        fit = self.terms[-1].fit_percent
        shown = "at rest" if fit is None else f"fit {fit:.5g} %"
        how = "every loop" if self.exact else f"{self.log_rate_hz:.3g} Hz, interpolated"
        return (
            f"Replay({self.loop.autopilot} {self.loop.axis}, output {shown}, {self.time_s.size} "
            f"rows, {how}, {self.light})"
        )

    @property
    def light(self) -> Light:
        """Worst finding."""
        return worst(self.findings)

    @property
    def error(self) -> Samples:
        """Replayed minus logged output."""
        return np.asarray(self.replayed["output"] - self.logged["output"])

    def summary(self) -> Table:
        """Table of the terms."""
        columns = (
            Column("term"),
            Column("fit", "%", 6),
            Column("rms error"),
            Column("largest error"),
            Column("rms logged"),
        )
        rows = tuple(
            (t.name, t.fit_percent, t.rms_error, t.largest_error, t.rms_logged) for t in self.terms
        )
        return Table(repr(self), columns, rows, tuple(map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        return {
            "span_s": [float(self.time_s[0]), float(self.time_s[-1])],
            "rows": int(self.time_s.size),
        }
