"""Disk margins: gain and phase that loops stand at once, one loop or several together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.disk_geometry import gain_limits, phase_limit_deg
from flightid.control.margins.findings import as_far_as_read, guide_finding, unread_findings
from flightid.control.margins.loop_grid import zoomed
from flightid.control.margins.loop_metrics import loop_metrics
from flightid.control.margins.loop_source import Controller
from flightid.control.margins.margins import GAIN_GUIDE_DB, PHASE_GUIDE_DEG
from flightid.control.margins.matrix_loop import (
    At,
    MatrixLoop,
    equivalent_loop,
    read_loops,
    uncertain_at,
)
from flightid.control.margins.structured_gain import structured_gain
from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate, Reading, estimate_table
from flightid.uncertainty.quantiles import shown

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
GRID = 160
"""Most frequencies at which several loops are looked at."""
NEAR = 1.4
"""Intervals look at frequencies where the margin is at most this times the least."""
ZOOMS = (0.03, 0.005)
QUANTITIES = (
    ("alpha", "disk margin", "1"),
    ("gain_rise", "gain may rise", "dB"),
    ("gain_fall", "gain may fall", "dB"),
    ("phase", "phase margin", "deg"),
    ("frequency", "critical frequency", "rad/s"),
)
UNSTABLE = "the closed loop is unstable"


@dataclass(frozen=True, eq=False, repr=False)
class DiskMargin(Result, schema="flightid.disk_margin/1"):
    """Result of `disk_margin`.

    Attributes
    ----------
    channels : tuple of str
        Where loops are broken.
    skew : float
        σ of the disk.
    alpha : Estimate
        Size α of the least disk of gains that may be unstable.
    gain_rise, gain_fall : Estimate
        How much all gains may rise or fall at once, each for itself, dB; None where without limit.
    phase : Estimate
        How much phase all may lose or gain at once, degrees.
    frequency : Estimate
        Where the disk is least, rad/s.
    omega_rad_s, alphas : ndarray, shape (n_f,)
        α over frequency.
    response : ndarray of complex, shape (n_f,), or None
        L of a single loop, for the Nyquist picture.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> fid.disk_margin(loop)
    DiskMargin(y: 1.028, gain -9.87 to 9.87 dB, phase 54.4 deg)
    """

    channels: tuple[str, ...]
    skew: float
    alpha: Reading
    gain_rise: Reading
    gain_fall: Reading
    phase: Reading
    frequency: Reading
    omega_rad_s: Array = field(repr=False)
    alphas: Array = field(repr=False)
    response: Complex | None = field(repr=False, default=None)
    findings: tuple[Finding, ...] = ()

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """All numbers with their intervals."""
        return tuple(getattr(self, key) for key, *_ in QUANTITIES)

    def __repr__(self) -> str:
        """Disk, gains and phase on one line."""
        if self.alpha.value is None:
            return f"DiskMargin({', '.join(self.channels)}: {self.alpha.reason})"
        ends = [each.value for each in (self.gain_fall, self.gain_rise)]
        low, high = ("any" if each is None else f"{each:.3g}" for each in ends)
        return (
            f"DiskMargin({', '.join(self.channels)}: {self.alpha.value:.4g}, gain -{low} to {high}"
            f" dB, phase {self.phase.value:.3g} deg)"
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of all numbers with their intervals."""
        level = shown(level)
        title = f"Disk margin at {', '.join(self.channels)}, skew {self.skew:g}"
        return estimate_table(title, self.quantities, tuple(map(str, self.findings)), level=level)


def disk_margin(
    source: object,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    *,
    controller: Controller | None = None,
    at: At = "outputs",
    skew: float = 0.0,
    band_rad_s: tuple[float, float] | None = None,
    unstable_poles: int | None = None,
) -> DiskMargin:
    """How far gain and phase of one or several loops may move at the same time.

    Each loop is multiplied by a factor of its own from the disk
    ``(1 + (1 − σ)/2 δ) / (1 − (1 + σ)/2 δ)``, |δ| < α. The disk margin is the greatest α for which
    the closed loop is stable whatever the factors are.

    Parameters
    ----------
    source : Fit, model, LinearSystem, connection, or FrequencyResponse
        Broken loops, as many back as out, for negative feedback; or the plant where `controller`
        is given.
    inputs, outputs : str or sequence of str, optional
        Channels of `source`; left out: the controller's, or all.
    controller : model, optional
        From plant outputs to plant inputs, for negative feedback: u = −K y. For one loop also a
        function of s = jω, values, or a number.
    at : {"outputs", "inputs", "both"}
        Where loops are broken: all plant outputs, all plant inputs, or all of both at once.
    skew : float
        σ: 0 balances rise and fall of the gain, 1 is the disk of the sensitivity, −1 that of the
        complementary sensitivity.
    band_rad_s : tuple of float, optional
        Frequencies to look at, rad/s.
    unstable_poles : int, optional
        Unstable poles of the open loops. Left out: counted in models; none in a measurement.

    Raises
    ------
    OptionError
        An option without meaning.
    UnknownNameError
        There is no such channel.
    ModelError
        The loop has no frequency response.
    ShapeError
        Numbers of channels that do not fit.
    DataError
        A loop that is not finite.

    Assumes
    -------
    Linear loops. With more than three loops the margin is a lower bound (an upper bound of the
    structured singular value), within about 0.1 % of the best that scalings give. Intervals are
    carried by first order.

    Reference
    ---------
    Seiler, Packard & Gahinet, "An introduction to disk margins", *IEEE Control Systems Magazine* 40
    (2020), theorem 1 and equations 9, 10, 20.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> round(disk_margin(loop, skew=1.0).alpha.value, 4)
    0.6956
    """
    if not np.isfinite(skew):
        raise OptionError("skew is not finite", found=skew, needed="a number, 0 for balance")
    loops = read_loops(
        source,
        [outputs] if isinstance(outputs, str) else outputs,
        [inputs] if isinstance(inputs, str) else inputs,
        controller=controller,
        at=at,
        band_rad_s=band_rad_s,
        unstable_poles=unstable_poles,
    )
    omega, alphas, count = _over_frequency(loops, skew)
    findings = [*_stability(count), *unread_findings(loops.unread), *loops.uncertain.findings]
    if count > 0:
        none = {key: Estimate(name, None, unit, None, UNSTABLE) for key, name, unit in QUANTITIES}
        return DiskMargin(
            loops.channels,
            skew,
            **none,
            omega_rad_s=omega,
            alphas=np.zeros(len(omega)),
            response=None,
            findings=tuple(findings),
        )
    made, unknown = _carried(loops, omega, alphas, skew)
    findings += _guides(made) + unknown
    single = len(loops.channels) == 1
    response = loops.of(loops.uncertain.value, omega)[:, 0, 0] if single else None
    return DiskMargin(
        loops.channels,
        skew,
        **made,
        omega_rad_s=omega,
        alphas=alphas,
        response=response,
        findings=tuple(findings),
    )


def alphas_of(loops: Complex, skew: float) -> Array:
    """α at each frequency, shape (n_f,), of loops (n_f, n, n)."""
    one = np.eye(loops.shape[1])
    sensitivity = np.linalg.inv(one + loops)
    size = structured_gain(sensitivity + 0.5 * (skew - 1.0) * one)
    return np.asarray(1.0 / np.maximum(size, 1e-300))


def _over_frequency(loops: MatrixLoop, skew: float) -> tuple[Array, Array, int]:
    """Frequencies, α at each, and unstable poles of the closed loop."""
    omega, thing = loops.omega_rad_s, loops.uncertain.value
    turning = equivalent_loop(loops.of(thing, omega))
    found = loop_metrics(
        omega,
        turning,
        unstable_poles=loops.unstable_poles,
        closed_unstable_poles=loops.closed_unstable_poles,
    )
    count = round(float(found.unstable_poles))
    if loops.measured:
        return omega, alphas_of(loops.of(thing, omega), skew), count
    if len(loops.channels) > 1 and len(omega) > GRID:
        omega = omega[np.linspace(0, len(omega) - 1, GRID).astype(int)]
    alphas = alphas_of(loops.of(thing, omega), skew)
    for ratio in ZOOMS:
        dips = omega[1:-1][(alphas[1:-1] <= alphas[:-2]) & (alphas[1:-1] <= alphas[2:])]
        finer = zoomed(omega, dips, ratio)
        new = np.setdiff1d(finer, omega)
        if not len(new):
            break
        omega, order = np.unique(np.concatenate([omega, new]), return_index=True)
        alphas = np.concatenate([alphas, alphas_of(loops.of(thing, new), skew)])[order]
    return omega, alphas, count


def _carried(
    loops: MatrixLoop, omega: Array, alphas: Array, skew: float
) -> tuple[dict[str, Reading], list[Finding]]:
    """Numbers with their intervals, from the frequencies where the disk is small."""
    low = alphas <= NEAR * np.min(alphas)
    near = low | np.append(low[1:], False) | np.append(False, low[:-1])
    # Errors may move the least of a measured loop to anywhere.
    if np.count_nonzero(near) < 3 or (loops.measured and len(loops.channels) == 1):
        near = np.ones(len(omega), dtype=bool)
    at = omega[near]

    def all_of(thing: Any) -> Array:  # noqa: ANN401 — whatever is uncertain
        alpha, place = _least(at, alphas_of(loops.of(thing, at), skew))
        fall, rise = gain_limits(alpha, skew)
        decibels = [np.nan if g in (0.0, np.inf) else 20.0 * np.log10(g) for g in (rise, fall)]
        phase = phase_limit_deg(alpha, skew)
        return np.array([alpha, decibels[0], -decibels[1], phase, place])

    uncertain = uncertain_at(loops, at)
    carried = uncertain.carried(all_of)
    made = {
        key: carried.number(place, name, unit, "the disk sets no limit")
        for place, (key, name, unit) in enumerate(QUANTITIES)
    }
    if loops.measured:
        made = {key: as_far_as_read(each, alphas) for key, each in made.items()}
    if uncertain.known:
        return made, []
    return made, [Finding("no-intervals", Light.UNKNOWN, f"no intervals: {uncertain.reason}")]


def _least(omega: Array, alphas: Array) -> tuple[float, float]:
    """Bottom of a parabola through the least point and its neighbours, over log frequency."""
    place = int(np.argmin(alphas))
    if place in (0, len(alphas) - 1):
        return float(alphas[place]), float(omega[place])
    x = np.log(omega[place - 1 : place + 2] / omega[place])
    y = np.log(alphas[place - 1 : place + 2] / alphas[place])
    left, right = y[0] / x[0], y[2] / x[2]
    bend = (right - left) / (x[2] - x[0])
    slope = left - bend * x[0]
    shift = -0.5 * slope / bend if bend > 0.0 else 0.0
    return float(alphas[place] * np.exp(0.5 * slope * shift)), float(omega[place] * np.exp(shift))


def _guides(made: dict[str, Reading]) -> list[Finding]:
    action = "take gain or lag out of the loops"
    found = [guide_finding(made["phase"], PHASE_GUIDE_DEG, "disk-phase-margin", action)]
    for key in ("gain_rise", "gain_fall"):
        if made[key].value is not None:
            code = f"disk-{key.replace('_', '-')}"
            found.append(guide_finding(made[key], GAIN_GUIDE_DB, code, action))
    # A disk asks more than one margin at a time, so that missing a guide is a doubt, no failure.
    return [
        Finding(each.code, Light.AMBER, each.message, each.action)
        if each.light is Light.RED
        else each
        for each in found
    ]


def _stability(count: int) -> list[Finding]:
    if count <= 0:
        return []
    return [
        Finding(
            "closed-loop-unstable",
            Light.RED,
            f"the closed loop is unstable: {count} unstable poles by the Nyquist criterion",
            "change the gains, or give unstable_poles",
        )
    ]
