"""Plans: an excitation, a guess of the vehicle, and what the flight would give."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.excitation.excitation import Excitation
from flightid.excitation.vehicle import RateAxis
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.result import Result
from flightid.table import Cell, Column, Table

LEAST_COHERENCE = 0.6
"""Coherence from which a response counts as measured."""
PARAMETERS = (("gain", "rad/s"), ("time constant", "s"), ("delay", "s"))


@dataclass(frozen=True)
class Limits(Options):
    """What the vehicle may do during the manoeuvre, about its trim.

    Attributes
    ----------
    control : float
        Input that is free on either side of trim, in the unit of the excitation.
    control_rate_per_s : float or None
        Fastest change that the actuator follows, unit/s; None where it does not matter.
    rate_rad_s : float
        Largest rate, rad/s.
    attitude_rad : float
        Largest attitude change, rad.

    Example
    -------
    >>> Limits(control=0.4).attitude_rad
    0.5235987755982988
    """

    control: float = option(
        1.0, above=0.0, doc="Limit: input that is free on either side of trim, in its unit."
    )
    control_rate_per_s: float | None = option(
        None, above=0.0, doc="Limit: fastest change that the actuator follows, unit/s."
    )
    rate_rad_s: float = option(
        math.radians(200.0), unit="rad/s", above=0.0, doc="Limit: largest rate."
    )
    attitude_rad: float = option(
        math.radians(30.0), unit="rad", above=0.0, doc="Limit: largest attitude change."
    )


@dataclass(frozen=True, eq=False)
class AxisForecast:
    """Prediction for one input and its rate.

    Attributes
    ----------
    name : str
        Input.
    input_density, coherence, random_error : ndarray, shape (n_freqs,)
        Density of the total input (unit²/Hz), coherence of input and rate, and the normalised
        1-sigma error of the response's magnitude over all records.
    peak_control, peak_control_rate, peak_rate_rad_s, peak_attitude_rad : float
        Largest magnitudes; the total input is excitation and feedback together.
    stderr : tuple of float or None
        Cramér-Rao bound (1 sigma) on gain, time constant and delay over all records; None where
        the record holds no information on one of them.

    Example
    -------
    >>> from flightid.excitation import assess, doublet
    >>> made = doublet(amplitude=0.1, step_s=0.4, sample_rate_hz=50.0)
    >>> [axis.name for axis in assess(made, RateAxis(gain=5.0, time_constant_s=0.2)).axes]
    ['u']
    """

    name: str
    input_density: NDArray[np.float64]
    coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    peak_control: float
    peak_control_rate: float
    peak_rate_rad_s: float
    peak_attitude_rad: float
    stderr: tuple[float, float, float] | None

    @property
    def coherent_percent(self) -> float:
        """Share of the band with coherence of 0.6 or more, percent."""
        return 100.0 * float(np.mean(self.coherence >= LEAST_COHERENCE))


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result, schema="flightid.excitation.plan/1"):
    """What a manoeuvre would give, and a go/no-go list.

    Attributes
    ----------
    excitation : Excitation
        What would be flown.
    band_rad_s : tuple of float
        Band in which a response is wanted, rad/s.
    n_records : int
        Times it is flown.
    vehicles : mapping of str to RateAxis
        Guess by input.
    limits : Limits
        What the vehicle may do.
    windows_s : tuple of float
        Window lengths for the estimate, s, longest first; empty where no length will do.
    omega_rad_s : ndarray, shape (n_freqs,)
        Frequencies of the forecasts, rad/s.
    axes : tuple of AxisForecast
        One for each input.
    findings : tuple of Finding
        Go/no-go list.

    Example
    -------
    >>> from flightid.excitation import assess, doublet
    >>> made = doublet(amplitude=0.1, step_s=0.4, sample_rate_hz=50.0)
    >>> assess(made, RateAxis(gain=5.0, time_constant_s=0.2)).is_go
    True
    """

    excitation: Excitation
    band_rad_s: tuple[float, float]
    n_records: int
    vehicles: Mapping[str, RateAxis]
    limits: Limits
    windows_s: tuple[float, ...]
    omega_rad_s: NDArray[np.float64]
    axes: tuple[AxisForecast, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def is_go(self) -> bool:
        """Whether nothing on the list is red."""
        return worst(self.findings) is not Light.RED

    def summary(self) -> Table:
        """Table of predictions by input, with the go/no-go list below."""
        unit = self.excitation.unit
        columns = (
            Column("input"),
            Column("coverage", "%", 3),
            Column("coherent band", "%", 3),
            Column("median error", "%", 2),
            Column("peak control", unit, 3),
            Column("peak rate", "rad/s", 3),
            Column("peak attitude", "rad", 3),
            *(Column(f"{name} ±", part, 2) for name, part in PARAMETERS),
        )
        coverage = self.excitation.coverage(self.band_rad_s)
        rows: list[tuple[Cell, ...]] = []
        for axis, share in zip(self.axes, coverage, strict=True):
            stderr: tuple[float | None, ...] = axis.stderr or (None, None, None)
            rows.append(
                (
                    axis.name,
                    float(share),
                    axis.coherent_percent,
                    100.0 * float(np.median(axis.random_error)),
                    axis.peak_control,
                    axis.peak_rate_rad_s,
                    axis.peak_attitude_rad,
                    *stderr,
                )
            )
        windows = ", ".join(f"{window:.3g}" for window in self.windows_s) or "none possible"
        notes = (f"Windows [s]: {windows}.", *map(str, self.findings))
        return Table(repr(self), columns, tuple(rows), notes)

    def _computed(self) -> dict[str, object]:
        return {
            "go": self.is_go,
            "excitation": {
                key: value for key, value in self.excitation.to_dict().items() if key != "signals"
            },
        }

    def __repr__(self) -> str:
        """Kind, size and the verdict on one line."""
        verdict = "go" if self.is_go else "no-go"
        return (
            f"Plan({self.excitation.kind!r}, {self.n_records} × {self.excitation.duration_s:.4g} s,"
            f" {self.band_rad_s[0]:.3g} to {self.band_rad_s[1]:.3g} rad/s, {verdict})"
        )
