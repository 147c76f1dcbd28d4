"""Disturbance rejection: how fast a loop works against gusts, and where it makes them worse."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.crossings import level_crossings
from flightid.control.margins.findings import (
    as_far_as_read,
    guide_finding,
    stability_findings,
    unread_findings,
)
from flightid.control.margins.gain_limits import measured_up
from flightid.control.margins.loop_metrics import DISTURBANCE_LEVEL_DB
from flightid.control.margins.loop_source import Controller, Given, read_loop
from flightid.control.margins.margins import GAIN_GUIDE_DB, LoopCurve, drawn_points
from flightid.control.margins.outside_band import outside_band, outside_band_findings
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Table
from flightid.uncertainty.estimate import Reading, estimate_table
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uneven import frequency_from_zero

Array = NDArray[np.float64]
PEAK_GUIDE_DB = 5.0
QUANTITIES = (
    ("bandwidth", "disturbance-rejection bandwidth", "disturbance_bandwidth_rad_s", "rad/s"),
    ("peak", "disturbance-rejection peak", "disturbance_peak_db", "dB"),
    ("peak_frequency", "frequency of the peak", "sensitivity_peak_rad_s", "rad/s"),
)
NO_BANDWIDTH = (
    f"the disturbance response does not rise through {DISTURBANCE_LEVEL_DB:g} dB in the band"
)


@dataclass(frozen=True, eq=False, repr=False)
class DisturbanceRejection(Result, schema="flightid.disturbance_rejection/1"):
    """Result of `disturbance_rejection`.

    Attributes
    ----------
    name : str
        The loop: output and input.
    bandwidth : Estimate
        Lowest frequency at which |S| rises through −3 dB, rad/s: slower disturbances are halved in
        power at least.
    peak : Estimate
        Greatest |S|, dB.
    peak_frequency : Estimate
        Where, rad/s.
    crossings_rad_s : tuple of float
        All frequencies at which |S| passes −3 dB.
    curve : LoopCurve
        S = 1/(1 + L) over frequency.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[2.0]], [[1.0]], [[0.0]], ("e",), ("phi",), [0.1])
    >>> fid.disturbance_rejection(loop)
    DisturbanceRejection(phi / e: bandwidth 1.694 rad/s, peak 1.541 dB)
    """

    name: str
    bandwidth: Reading
    peak: Reading
    peak_frequency: Reading
    crossings_rad_s: tuple[float, ...]
    curve: LoopCurve = field(repr=False)
    findings: tuple[Finding, ...] = ()

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """All numbers with their intervals."""
        return tuple(getattr(self, key) for key, *_ in QUANTITIES)

    def __repr__(self) -> str:
        """Bandwidth and peak on one line."""
        shown = f"bandwidth {self.bandwidth.text}, peak {self.peak.text}"
        return f"DisturbanceRejection({self.name}: {shown})"

    def summary(self, *, level: float | None = None) -> Table:
        """Table of all numbers with their intervals."""
        level = shown(level)
        notes = tuple(map(str, self.findings))
        return estimate_table(
            f"Disturbance rejection of {self.name}", self.quantities, notes, level=level
        )


def disturbance_rejection(
    source: object,
    inputs: str | None = None,
    outputs: str | None = None,
    *,
    controller: Controller | None = None,
    given: Given = "broken",
    band_rad_s: tuple[float, float] | None = None,
    unstable_poles: int | None = None,
    bandwidth_guide_rad_s: float | None = None,
    peak_guide_db: float = PEAK_GUIDE_DB,
    rigid: bool = False,
) -> DisturbanceRejection:
    """Bandwidth and peak of a loop's response to disturbances of its output, with 95 % intervals.

    Both are read from S = 1/(1 + L): the fed-back signal over a disturbance added to it. Flown by
    adding a sweep to the measured attitude, rate, velocity or position (with ArduPilot, axes 14 to
    17 of its system-identification mode): give the response of measured signal plus injection to
    injection with ``given="sensitivity"``.

    Parameters
    ----------
    source : Fit, model, LinearSystem, connection broken at a signal, or FrequencyResponse
        The broken loop, or the plant where `controller` is given.
    inputs, outputs : str, optional
        Which pair; may be left out where there is one only.
    controller : model, callable of s = jω, array_like, shape (n_f,), or number, optional
        Known part by which the response is multiplied.
    given : {"broken", "closed", "sensitivity"}
        What a measured response is: L, L/(1 + L) or S.
    band_rad_s : tuple of float, optional
        Frequencies to look at, rad/s.
    unstable_poles : int, optional
        Unstable poles of the open loop. Left out: counted in a model; none in a measurement.
    bandwidth_guide_rad_s : float, optional
        Least bandwidth asked for, rad/s; it depends on axis and task, so that there is no default.
    peak_guide_db : float
        Greatest peak asked for, dB.
    rigid : bool
        Declare that nothing swings or bends above the band of the model; see `flightid.tune_pid`.

    Raises
    ------
    OptionError
        An option without meaning, or several channels without a choice.
    UnknownNameError
        There is no such channel.
    ModelError
        The loop has no frequency response.
    DataError
        A measurement with fewer than three neighbouring coherent frequencies, or a loop that is
        zero or not finite.
    ShapeError
        A controller that does not fit.

    Assumes
    -------
    A linear loop. Of a measurement the widest band of coherence 0.6 is read, and nothing beyond it.
    The peak of a noisy measurement is biased upwards: it is the highest of many
    points. Leakage and resolution are taken out of a response that was estimated from records, not
    of one from a file or arithmetic. Intervals are carried by first order; the peak's is promised
    above the band of a fit as in `margins`.

    Reference
    ---------
    Tischler, Berger, Ivler, Mansur, Cheung & Soong, *Practical Methods for Aircraft and Rotorcraft
    Flight Control Design* (2017), chapter 5.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[2.0]], [[1.0]], [[0.0]], ("e",), ("phi",), [0.1])
    >>> found = disturbance_rejection(loop)
    >>> round(found.bandwidth.value, 3), round(found.peak.value, 2)
    (1.694, 1.54)
    """
    loop = read_loop(
        source,
        outputs,
        inputs,
        controller=controller,
        given=given,
        band_rad_s=band_rad_s,
        unstable_poles=unstable_poles,
    )
    loop = replace(loop, rigid=rigid)
    omega, metrics = measured_up(loop)
    drawn = drawn_points(loop, omega)
    places = np.searchsorted(omega, drawn)
    sensitivity = 1.0 / (1.0 + loop.of(loop.uncertain.value, drawn))

    def all_of(things: list[Any]) -> Array:
        values = np.array([loop.of(each, omega) for each in things])
        found = loop.metrics(omega, values)
        ratio = 1.0 / ((1.0 + values[:, places]) * sensitivity)
        numbers = np.array([getattr(found, name) for _, _, name, _ in QUANTITIES]).T
        return np.hstack([numbers, 20 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))])

    carried, outside = loop.uncertain.carried_together(all_of), outside_band(loop)
    made = {
        key: outside.promised(
            frequency_from_zero(carried.number(place, name, unit, loop.unread or NO_BANDWIDTH)),
            field,
            GAIN_GUIDE_DB,
        )
        for place, (key, name, field, unit) in enumerate(QUANTITIES)
    }
    errors = carried.stderr
    parts = (None, None) if errors is None else np.split(errors[len(QUANTITIES) :], 2)
    estimate = loop.of(loop.uncertain.value, omega)
    level = -np.log(np.abs(1.0 + estimate))
    if loop.measured:
        for key in ("peak", "peak_frequency"):
            made[key] = as_far_as_read(made[key], -level, float(np.abs(estimate[-1])))
    level -= np.log(10.0) / 20.0 * DISTURBANCE_LEVEL_DB
    found = [*stability_findings(loop, metrics)]
    found += _guides(made, bandwidth_guide_rad_s, peak_guide_db)
    found += [*unread_findings(loop.unread), *loop.uncertain.findings]
    found += outside_band_findings(loop, outside, GAIN_GUIDE_DB)
    if not loop.uncertain.known:
        found.append(
            Finding("no-intervals", Light.UNKNOWN, f"no intervals: {loop.uncertain.reason}")
        )
    return DisturbanceRejection(
        loop.name,
        **made,
        crossings_rad_s=tuple(level_crossings(np.log(omega), level[None, :]).omega.tolist()),
        curve=LoopCurve(drawn, sensitivity, *parts),
        findings=tuple(found),
    )


def _guides(made: dict[str, Reading], bandwidth: float | None, peak: float) -> list[Finding]:
    found = [
        guide_finding(
            made["peak"], peak, "disturbance-peak", "take gain or lag out", at_least=False
        )
    ]
    if made["bandwidth"].value is None:
        found.append(
            Finding(
                "no-disturbance-bandwidth",
                Light.UNKNOWN,
                made["bandwidth"].reason or NO_BANDWIDTH,
                "begin the band lower; a loop without gain at low frequency rejects nothing",
            )
        )
    elif bandwidth is not None:
        guide = guide_finding(made["bandwidth"], bandwidth, "disturbance-bandwidth", "add gain")
        found.append(guide)
    return found
