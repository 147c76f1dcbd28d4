"""Bandwidth and phase delay of an attitude response."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flightid.conventions import Light
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.findings import Finding
from flightid.models import Model
from flightid.responses import FrequencyResponse
from flightid.table import Column, Table

SCHEMA = "flightid.attitude_bandwidth/1"
PHASE_MARGIN_DEG = 45.0
GAIN_MARGIN_DB = 6.0
DEGREES_PER_RADIAN = 57.3
"""As the standard writes it in the definition of phase delay."""
GRID_POINTS = 2000
Array = NDArray[np.float64]


@dataclass(frozen=True)
class AttitudeBandwidth:
    """Result of `attitude_bandwidth`.

    Attributes
    ----------
    omega_180_rad_s : float
        Where the phase passes −180°, rad/s.
    phase_bandwidth_rad_s : float
        Where the phase passes −135°, 45° before instability, rad/s.
    gain_bandwidth_rad_s : float or None
        Where the gain is 6 dB above that at ω_180, rad/s; None where a finding says why.
    phase_delay_s : float or None
        Slope of the phase beyond ω_180, s; None where a finding says why.
    findings : tuple of Finding

    Example
    -------
    >>> AttitudeBandwidth(5.47, 2.14, 3.59, 0.073).bandwidth_rad_s
    2.14
    """

    omega_180_rad_s: float
    phase_bandwidth_rad_s: float
    gain_bandwidth_rad_s: float | None
    phase_delay_s: float | None
    findings: tuple[Finding, ...] = ()

    @property
    def bandwidth_rad_s(self) -> float:
        """The lesser of both, as for rate-command systems, rad/s.

        For attitude-command systems the standard takes `phase_bandwidth_rad_s` alone.
        """
        if self.gain_bandwidth_rad_s is None:
            return self.phase_bandwidth_rad_s
        return min(self.phase_bandwidth_rad_s, self.gain_bandwidth_rad_s)

    def __repr__(self) -> str:
        """Bandwidth and phase delay on one line."""
        delay = "unknown" if self.phase_delay_s is None else f"{self.phase_delay_s:.4g} s"
        return f"AttitudeBandwidth({self.bandwidth_rad_s:.4g} rad/s, phase delay {delay})"

    def summary(self) -> Table:
        """Table of all values.

        Returns
        -------
        Table
        """
        rows = (
            ("ω_180", self.omega_180_rad_s, "rad/s"),
            ("phase bandwidth", self.phase_bandwidth_rad_s, "rad/s"),
            ("gain bandwidth", self.gain_bandwidth_rad_s, "rad/s"),
            ("phase delay", self.phase_delay_s, "s"),
        )
        columns = (Column("quantity"), Column("value", digits=5), Column("unit"))
        return Table("Attitude bandwidth", columns, rows, tuple(map(str, self.findings)))

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key."""
        return {
            "schema": SCHEMA,
            "omega_180_rad_s": self.omega_180_rad_s,
            "phase_bandwidth_rad_s": self.phase_bandwidth_rad_s,
            "gain_bandwidth_rad_s": self.gain_bandwidth_rad_s,
            "bandwidth_rad_s": self.bandwidth_rad_s,
            "phase_delay_s": self.phase_delay_s,
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


def attitude_bandwidth(
    source: FrequencyResponse | Model,
    output: str,
    input: str,
    *,
    band_rad_s: tuple[float, float] = (0.1, 100.0),
) -> AttitudeBandwidth:
    """Bandwidth and phase delay of an attitude to a control.

    Bandwidth is the highest frequency at which a pilot can still close the loop with 45° of phase
    margin, or with 6 dB of gain margin; phase delay says how fast the phase falls off beyond.

    Parameters
    ----------
    source : FrequencyResponse, TransferFunctionModel or StateSpaceModel
        Measured points are joined by straight lines of dB and degrees over log frequency; a model
        is evaluated where it is needed.
    output, input : str
        Attitude and control.
    band_rad_s : tuple of float
        Band to look in, rad/s; of a measured response, what lies in it.

    Returns
    -------
    AttitudeBandwidth

    Raises
    ------
    DataError
        The phase does not pass −135° and −180° in the band.
    OptionError
        The band has no meaning.
    UnknownNameError
        There is no such channel.

    Assumes
    -------
    An attitude (not a rate) whose phase begins between −270° and 90°: change the sign of a control
    that pulls the other way. Biased by noise where coherence is low near ω_180 or its double: look
    at the coherence there first.

    Reference
    ---------
    ADS-33E-PRF, *Handling Qualities Requirements for Military Rotorcraft* (2000), §3.3.2.1 and
    figure 5; MIL-STD-1797A, appendix A, §4.2.1.2.

    Example
    -------
    >>> import flightid as fid
    >>> model = fid.load_model("attitude_first_order", axis="roll")
    >>> found = attitude_bandwidth(model, model.outputs[0], model.inputs[0])
    >>> found.phase_bandwidth_rad_s < found.omega_180_rad_s
    True
    """
    low, high = band_rad_s
    if not (np.isfinite(low) and np.isfinite(high) and 0.0 < low < high):
        raise OptionError("band_rad_s has no meaning", found=band_rad_s, needed="0 < low < high")
    curve = _Curve.of(source, output, input, low, high)
    crossing = curve.falls_through(-180.0)
    margin = curve.falls_through(PHASE_MARGIN_DEG - 180.0)
    if crossing is None or margin is None:
        raise DataError(
            f"{output}/{input} has no bandwidth in the band",
            found=f"phase from {curve.degrees[0]:.0f}° to {curve.degrees[-1]:.0f}°",
            needed="a phase that passes −135° and −180°",
            action="widen the band; take the attitude and not the rate, with its sign",
        )
    gain, delay, findings = curve.above(crossing, GAIN_MARGIN_DB), None, []
    if gain is None:
        findings.append(
            Finding(
                "gain-bandwidth",
                Light.UNKNOWN,
                "the gain is never 6 dB above that at ω_180 below it",
                "begin the band lower; a response that is flat there has no gain bandwidth",
            )
        )
    if 2.0 * crossing <= curve.omega[-1] * (1.0 + 1e-12):
        beyond = -180.0 - curve.at(2.0 * crossing)[1]
        delay = float(beyond / (DEGREES_PER_RADIAN * 2.0 * crossing))
    else:
        findings.append(
            Finding(
                "phase-delay",
                Light.UNKNOWN,
                f"twice ω_180, {2 * crossing:.3g} rad/s, lies beyond the band",
                "widen the band, or excite higher frequencies",
            )
        )
    return AttitudeBandwidth(crossing, margin, gain, delay, tuple(findings))


@dataclass(frozen=True)
class _Curve:
    """Decibels and degrees on a grid, and between its frequencies."""

    omega: Array
    decibels: Array
    degrees: Array
    exact: Callable[[float], complex] | None

    @classmethod
    def of(
        cls, source: FrequencyResponse | Model, output: str, control: str, low: float, high: float
    ) -> _Curve:
        exact = None
        if isinstance(source, FrequencyResponse):
            pair = source.pair(output, control)
            inside = (pair.omega_rad_s >= low) & (pair.omega_rad_s <= high)
            omega, values = pair.omega_rad_s[inside], pair.response[inside]
        else:
            for name, known in ((output, source.outputs), (control, source.inputs)):
                if name not in known:
                    needed = ", ".join(known)
                    raise UnknownNameError("there is no such channel", found=name, needed=needed)
            place = source.outputs.index(output), source.inputs.index(control)
            omega = np.geomspace(low, high, GRID_POINTS)
            values = source.frequency_response(omega)[place]

            def exact(at: float) -> complex:
                return complex(source.frequency_response([at])[place][0])

        if len(omega) < 2 or np.any(values == 0.0):
            raise DataError(
                f"{output}/{control} has no points in the band",
                found=f"{np.count_nonzero(values)} between {low:g} and {high:g} rad/s",
                needed="two or more, none of them zero",
            )
        degrees = np.degrees(np.unwrap(np.angle(values)))
        # The branch on which a plain integrator of positive gain lies at −90°.
        degrees -= 360.0 * np.ceil((degrees[0] - 90.0) / 360.0)
        return cls(omega, 20.0 * np.log10(np.abs(values)), degrees, exact)

    def at(self, omega: float) -> tuple[float, float]:
        """Decibels and degrees at one frequency: of a model exactly, else between neighbours."""
        logs, wanted = np.log(self.omega), np.log(omega)
        decibel = float(np.interp(wanted, logs, self.decibels))
        degrees = float(np.interp(wanted, logs, self.degrees))
        if self.exact is None:
            return decibel, degrees
        value = self.exact(omega)
        angle = float(np.degrees(np.angle(value)))
        turns = round((degrees - angle) / 360.0)
        return float(20.0 * np.log10(abs(value))), angle + 360.0 * turns

    def falls_through(self, level: float) -> float | None:
        """Lowest frequency at which the phase falls through a level."""
        high = self.degrees - level
        places = np.flatnonzero((high[:-1] > 0.0) & (high[1:] <= 0.0))
        return None if not len(places) else self._between(int(places[0]), 1, level)

    def above(self, limit: float, margin_db: float) -> float | None:
        """Highest frequency below a limit at which the gain is still a margin above that there."""
        level = self.at(limit)[0] + margin_db
        count = int(np.searchsorted(self.omega, limit))
        high = np.append(self.decibels[:count], level - margin_db) - level
        places = np.flatnonzero((high[:-1] >= 0.0) & (high[1:] < 0.0))
        return None if not len(places) else self._between(int(places[-1]), 0, level)

    def _between(self, place: int, part: int, level: float) -> float:
        left = float(self.omega[place])
        right = float(self.omega[min(place + 1, len(self.omega) - 1)])
        return float(brentq(lambda at: self.at(at)[part] - level, left, right, xtol=1e-12))
