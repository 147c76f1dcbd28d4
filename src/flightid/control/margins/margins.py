"""Margins of one loop with their intervals: crossover, phase, gain, delay, distance from −1."""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.crossings import gain_crossings, phase_crossings
from flightid.control.margins.findings import (
    CONTRADICTED,
    UNREAD,
    as_far_as_read,
    margin_findings,
)
from flightid.control.margins.gain_limits import (
    GAIN_LIMITS,
    UNSEEN,
    loop_numbers,
    measured_up,
    outside_findings,
)
from flightid.control.margins.loop_source import BrokenLoop, Controller, Given, read_loop
from flightid.control.margins.outside_band import outside_band, outside_band_findings
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Reading, estimate_table
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uneven import frequency_from_zero

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
PHASE_GUIDE_DEG = 45.0
GAIN_GUIDE_DB = 6.0
"""MIL-F-9490D table III and its successors, for modes between 0.06 Hz and the first elastic one."""
DRAWN_POINTS = 400
FAR_DB = 40.0
"""Beyond which a passage of the negative axis is not listed."""
QUANTITIES = (
    ("crossover", "crossover_rad_s", "rad/s"),
    ("phase margin", "phase_margin_deg", "deg"),
    ("delay margin", "delay_margin_s", "s"),
    ("gain margin", "gain_margin_db", "dB"),
    ("phase crossover", "phase_crossover_rad_s", "rad/s"),
    ("gain-reduction margin", "gain_reduction_margin_db", "dB"),
    ("gain-reduction crossing", "gain_reduction_rad_s", "rad/s"),
    ("modulus margin", "modulus_margin", "1"),
    ("sensitivity peak", "sensitivity_peak", "1"),
)
NO_CROSSOVER = "the gain does not pass one in the band"
MISSING = {
    "crossover_rad_s": NO_CROSSOVER,
    "phase_margin_deg": NO_CROSSOVER,
    "delay_margin_s": NO_CROSSOVER,
    "gain_margin_db": "no rise of the gain makes the loop unstable",
    "phase_crossover_rad_s": "there is no gain margin",
    "gain_reduction_margin_db": "no fall of the gain makes the loop unstable",
    "gain_reduction_rad_s": "there is no gain-reduction margin",
}


@dataclass(frozen=True, eq=False)
class LoopCurve:
    """A loop's response for pictures, with standard errors.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    response : ndarray of complex, shape (n_f,)
        L, negative feedback.
    stderr_db, stderr_deg : ndarray, shape (n_f,), or None
        Of gain and phase; None without covariance.
    """

    omega_rad_s: Array
    response: Complex
    stderr_db: Array | None = None
    stderr_deg: Array | None = None


@dataclass(frozen=True)
class Crossing:
    """One passage of the unit circle or of the negative real axis.

    Attributes
    ----------
    omega_rad_s : float
    margin : float
        Degrees from −180° at the unit circle, positive: lag to spare; dB below one at the axis.

    Example
    -------
    >>> Crossing(4.0, 67.1).margin
    67.1
    """

    omega_rad_s: float
    margin: float


@dataclass(frozen=True, eq=False, repr=False)
class Margins(Result, schema="flightid.margins/1"):
    """Result of `margins`.

    Attributes
    ----------
    name : str
        The loop: output and input.
    crossover, phase_margin, delay_margin : Estimate
        At the crossover with the least phase to spare: rad/s, degrees, s. Margins of an unstable
        loop are negative.
    gain_margin, phase_crossover : Estimate
        How much the gain may rise, dB, and where, rad/s.
    gain_reduction_margin, gain_reduction_crossing : Estimate
        How much it may fall, dB, and where, rad/s.
    modulus_margin, sensitivity_peak : Estimate
        Least distance of L from −1, and its inverse.
    crossovers : tuple of Crossing
        All passages of the unit circle.
    phase_crossovers : tuple of Crossing
        All passages of the negative real axis within 40 dB of −1.
    unstable_poles : int
        Of the closed loop, by the Nyquist criterion; of a measurement as far as it is read.
    curve : LoopCurve
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> fid.margins(loop)
    Margins(y / e: phase 67.08 deg, gain 11.88 dB)
    """

    name: str
    crossover: Reading
    phase_margin: Reading
    delay_margin: Reading
    gain_margin: Reading
    phase_crossover: Reading
    gain_reduction_margin: Reading
    gain_reduction_crossing: Reading
    modulus_margin: Reading
    sensitivity_peak: Reading
    crossovers: tuple[Crossing, ...]
    phase_crossovers: tuple[Crossing, ...]
    unstable_poles: int
    curve: LoopCurve = field(repr=False)
    findings: tuple[Finding, ...] = ()

    @property
    def is_stable(self) -> bool | None:
        """Whether the closed loop has no unstable pole, by the Nyquist criterion.

        None where that is unknown: a measurement that ends where it may still turn about −1, or
        that turns as no loop with so many open unstable poles does.
        """
        unknown = any(each.code in (UNREAD, CONTRADICTED) for each in self.findings)
        return None if unknown else self.unstable_poles == 0

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """All numbers with their intervals."""
        return tuple(
            getattr(self, name.replace("-", "_").replace(" ", "_")) for name, *_ in QUANTITIES
        )

    def __repr__(self) -> str:
        """Verdict, phase and gain margin on one line."""
        verdict = "" if self.is_stable else f"unstable with {self.unstable_poles} poles, "
        verdict = "stability not known, " if self.is_stable is None else verdict
        return (
            f"Margins({self.name}: {verdict}phase {self.phase_margin.text}, "
            f"gain {self.gain_margin.text})"
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of all numbers with their intervals."""
        level = shown(level)
        notes = tuple(map(str, self.findings))
        return estimate_table(f"Margins of {self.name}", self.quantities, notes, level=level)

    def crossing_table(self) -> Table:
        """Table of every crossing, by frequency."""
        columns = (Column("frequency", "rad/s"), Column("what"), Column("margin"), Column("unit"))
        rows = [(c.omega_rad_s, "gain passes one", c.margin, "deg") for c in self.crossovers]
        rows += [
            (c.omega_rad_s, "phase passes −180°", c.margin, "dB") for c in self.phase_crossovers
        ]
        return Table(f"Crossings of {self.name}", columns, tuple(sorted(rows)))

    def _computed(self) -> dict[str, object]:
        return {"stable": self.is_stable}


def margins(
    source: object,
    inputs: str | None = None,
    outputs: str | None = None,
    *,
    controller: Controller | None = None,
    given: Given = "broken",
    band_rad_s: tuple[float, float] | None = None,
    unstable_poles: int | None = None,
    phase_guide_deg: float = PHASE_GUIDE_DEG,
    gain_guide_db: float = GAIN_GUIDE_DB,
    rigid: bool = False,
) -> Margins:
    """Margins of a loop, broken at one point, with 95 % intervals.

    The loop is the response from what enters the break to what comes back, for negative feedback:
    ``1 + L = 0`` is critical. A summing junction that adds needs ``controller=-1``.

    Parameters
    ----------
    source : Fit, model, LinearSystem, connection broken at a signal, or FrequencyResponse
        The broken loop itself, or the plant where `controller` is given.
    inputs, outputs : str, optional
        Which pair; may be left out where there is one only.
    controller : model, callable of s = jω, array_like, shape (n_f,), or number, optional
        Known part by which the response is multiplied. A model's unstable poles are counted; a
        function or numbers are taken as stable.
    given : {"broken", "closed", "sensitivity"}
        What a measured response is: the broken loop L, feedback over reference L/(1 + L), or error
        over reference (fed-back signal over a disturbance added to it) 1/(1 + L).
    band_rad_s : tuple of float, optional
        Frequencies at which margins are looked for, rad/s; left out: all of a measurement, and for
        a model what its roots and delays call for. Whether a model's loop is stable, and how far
        its gain may go, holds over all frequencies; of a measurement the band is all there is.
    unstable_poles : int, optional
        Unstable poles of the open loop. Left out: counted in a model; none in a measurement.
    phase_guide_deg, gain_guide_db : float
        What the findings ask for, at the worse end of the interval.
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
    Intervals are those of the estimate's covariance carried by first order, by draws
    where a margin hangs on two crossings that change places, and leave out what a model lacks.
    Numbers that are read above the band to which a fit was shown to hold have none, and intervals
    of gain margin, modulus margin and sensitivity peak reach what a resonance of 20 dB above that
    band may leave: they have none where it may leave less than `gain_guide_db`. The sensitivity
    peak of a noisy measurement is biased upwards: it is the highest of many points. A
    measurement should begin below and end above the crossings; joint input and output
    with a known excitation (``estimate_response(estimator="instrument")`` from error to feedback)
    gives L of a flown loop without the bias of a direct estimate.

    Reference
    ---------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 7th ed., sections 6.3
    and 6.4; guides: MIL-F-9490D (1975) §3.1.3.6.1, kept by SAE AS94900.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> found = margins(loop)
    >>> round(found.phase_margin.value, 2), round(found.gain_margin.value, 2)
    (67.08, 11.88)
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
    return margins_of(loop, phase_guide_deg=phase_guide_deg, gain_guide_db=gain_guide_db)


def margins_of(
    loop: BrokenLoop,
    *,
    phase_guide_deg: float = PHASE_GUIDE_DEG,
    gain_guide_db: float = GAIN_GUIDE_DB,
) -> Margins:
    """Margins of a loop that was read; see `margins`."""
    omega, metrics = measured_up(loop)
    estimate = loop.of(loop.uncertain.value, omega)
    quantities, curve = _carried(loop, omega)
    rows, logs = estimate[None, :], np.log(omega)
    gains, phases = gain_crossings(logs, rows), phase_crossings(logs, rows)
    phases = phases.kept(np.abs(phases.value) < np.log(10.0) / 20.0 * FAR_DB)
    outside = outside_band(loop)
    made = {
        name.replace("-", "_").replace(" ", "_"): outside.promised(each, field, gain_guide_db)
        for (name, field, _), each in quantities
    }
    if loop.measured:
        for key in ("modulus_margin", "sensitivity_peak"):
            last = float(np.abs(estimate[-1]))
            made[key] = as_far_as_read(made[key], np.abs(1.0 + estimate), last)
    findings = margin_findings(
        loop,
        metrics,
        made,
        phase_guide_deg=phase_guide_deg,
        gain_guide_db=gain_guide_db,
    )
    findings += (
        *outside_findings(loop, made),
        *outside_band_findings(loop, outside, gain_guide_db),
    )
    return Margins(
        loop.name,
        **made,
        crossovers=tuple(map(Crossing, gains.omega.tolist(), np.degrees(gains.value).tolist())),
        phase_crossovers=tuple(
            map(Crossing, phases.omega.tolist(), (-20 / np.log(10) * phases.value).tolist())
        ),
        unstable_poles=max(round(float(metrics.unstable_poles)), 0),
        curve=curve,
        findings=findings,
    )


def drawn_points(loop: BrokenLoop, omega: Array) -> Array:
    """Frequencies for a picture: of a model some, of a measurement all."""
    if loop.measured or len(omega) <= DRAWN_POINTS:
        return omega
    return np.asarray(omega[np.linspace(0, len(omega) - 1, DRAWN_POINTS).astype(int)])


def _carried(loop: BrokenLoop, omega: Array) -> tuple[list[tuple[Any, Reading]], LoopCurve]:
    """Every number with its interval, and the curve with its standard errors."""
    names = [name for _, name, _ in QUANTITIES]
    drawn = drawn_points(loop, omega)
    centre, places = loop.of(loop.uncertain.value, drawn), np.searchsorted(omega, drawn)

    def all_of(things: list[Any]) -> Array:
        numbers, values = loop_numbers(loop, omega, things, names)
        ratio = values[:, places] / centre
        return np.hstack([numbers, 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))])

    carried = loop.uncertain.carried_together(all_of)
    missing = MISSING | (dict.fromkeys(GAIN_LIMITS, UNSEEN) if loop.measured else {})
    if loop.unread:
        missing = dict.fromkeys(MISSING, loop.unread)
    quantities = [
        (
            each,
            frequency_from_zero(carried.number(place, each[0], each[2], missing.get(each[1], ""))),
        )
        for place, each in enumerate(QUANTITIES)
    ]
    stderr, count = carried.stderr, len(names)
    if stderr is None:
        return quantities, LoopCurve(drawn, centre)
    parts = stderr[count : count + len(drawn)], stderr[count + len(drawn) :]
    return quantities, LoopCurve(drawn, centre, *parts)
