"""What gains promise: each margin and bandwidth at the estimate, over its spread, at its worst."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.tuning.limits import ANGLE, Limit, limits, noise_limit
from flightid.control.tuning.loop_problem import FULL, LoopAssessment, LoopProblem
from flightid.control.tuning.modes_outside import Place, beside_modes, modes_outside
from flightid.findings import SHOWN_DIGITS as DIGITS
from flightid.findings import held
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.uneven import DrawnEnds, Reaching

Array = NDArray[np.float64]
FEWEST = 3
"""A spread needs more than the estimate and one other."""


@dataclass(frozen=True)
class WorstCase:
    """One number of one loop.

    Attributes
    ----------
    loop, name : str
    estimate : Estimate
        Of the estimated plant, with the middle of all plants as its interval; no value where there
        is no such crossing, no interval where there is one plant, or a crossing is missing.
    worst : float or None
        Of all plants, on the side of its limit, and no better than a mode outside the identified
        band may leave it; none where one of them reads it above, or such a mode may leave less
        than is required, nor of a loop that is at one below the band.
    flown, flown_worst : float or None
        The same with the gains of the log; None where they are not stable either.
    required : str
        What was asked for; empty where nothing was.
    met : bool
        Whether every plant meets it.
    digits : int
        How many its numbers are shown with: as many as tell them from what was asked for.
    missed : float or None
        Of the plant that is furthest from what was asked for, where one misses it: promised or not,
        that is what the verdict is on.
    n_missed, n_plants : int
        How many of the plants miss it.

    Example
    -------
    >>> margin = Estimate("rate loop: phase margin", 52.0, "deg")
    >>> WorstCase("rate loop", "phase margin", margin, 47.1, 60.0, 55.0, "≥ 45")
    WorstCase(rate loop: phase margin 52 deg, worst 47.1)
    """

    loop: str
    name: str
    estimate: Reading
    worst: float | None
    flown: float | None
    flown_worst: float | None
    required: str = ""
    met: bool = True
    digits: int = DIGITS
    missed: float | None = None
    n_missed: int = 0
    n_plants: int = 1

    def __repr__(self) -> str:
        """Loop, name and numbers on one line."""
        values = ["none" if each is None else f"{each:.4g}" for each in (self.nominal, self.worst)]
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"WorstCase({self.loop}: {self.name} {values[0]}{unit}, worst {values[1]})"

    @property
    def unit(self) -> str:
        """Unit of all its numbers."""
        return self.estimate.unit

    @property
    def nominal(self) -> float | None:
        """Value of the estimated plant."""
        return self.estimate.value

    @property
    def shown_worst(self) -> tuple[float | None, float | None]:
        """Worst with the new and with the flown gains at its digits, rounded to the worse."""
        return (
            to_the_worse(self.name, self.worst, self.nominal, self.digits),
            to_the_worse(self.name, self.flown_worst, self.flown, self.digits),
        )

    @property
    def shown_missed(self) -> float | None:
        """The plant that is furthest from what was asked for, rounded to the worse."""
        least = "≥" in self.required
        return None if self.missed is None else held(self.missed, self.digits, least=least)

    def shown(self, value: float | None) -> float | None:
        """Another number of it, such as the estimate or an end of its interval, at its digits."""
        return None if value is None else float(f"{value:.{self.digits}g}")

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return self.estimate.to_dict() | {
            "worst": self.worst,
            "flown": self.flown,
            "flown_worst": self.flown_worst,
            "required": self.required,
            "met": self.met,
            "missed": self.missed,
            "n_missed": self.n_missed,
            "n_plants": self.n_plants,
        }


@dataclass(frozen=True)
class _Kind:
    """A number of `LoopMetrics`: where it is, its name, unit, and whether more is better."""

    field: str
    name: str
    unit: str
    more: bool
    place: str = ""
    """Field that says at which frequency it is read, where that may lie above the band."""

    def at(self, loop: str) -> Place:
        """Of one loop."""
        return Place(loop, self.field, self.place, self.more)


NOISE = _Kind("noise", "noise", "1", False)
KINDS = (
    _Kind("crossover_rad_s", "crossover", "rad/s", True),
    _Kind("phase_margin_deg", "phase margin", "deg", True),
    _Kind("gain_margin_db", "gain margin", "dB", True, "phase_crossover_rad_s"),
    _Kind("gain_reduction_margin_db", "gain reduction margin", "dB", True),
    _Kind("delay_margin_s", "delay margin", "s", True),
    _Kind("sensitivity_peak", "sensitivity peak", "1", False, "sensitivity_peak_rad_s"),
    _Kind("disturbance_bandwidth_rad_s", "disturbance bandwidth", "rad/s", True),
    _Kind("disturbance_peak_db", "disturbance peak", "dB", False),
)


def to_the_worse(
    name: str, value: float | None, estimate: float | None = None, digits: int = DIGITS
) -> float | None:
    """A number of a loop at few digits, rounded to the side on which its promise still holds.

    Parameters
    ----------
    name : str
        What the number is; noise is called by what it is of, such as ``"noise, rms"``.
    value : float or None
        Of the worst plant.
    estimate : float or None
        Of the estimated one: the worst lies on the bad side of it, whichever that is.
    digits : int

    Example
    -------
    >>> to_the_worse("phase margin", 45.46), to_the_worse("sensitivity peak", 1.6412)
    (45.4, 1.65)
    >>> to_the_worse("noise, rms", 0.5517), to_the_worse("crossover", 21.32, 20.1)
    (0.552, 21.4)
    """
    if value is not None and estimate is not None and value != estimate:
        return held(value, digits, least=value < estimate)
    kind = name.partition(" over ")[0].partition(",")[0]
    more = next((each.more for each in (*KINDS, NOISE) if each.name == kind), True)
    return held(value, digits, least=more)


def worst_cases(
    problem: LoopProblem,
    gains: Array,
    old: LoopAssessment | None,
    band_rad_s: tuple[float, float] | None = None,
    judged: LoopAssessment | None = None,
) -> tuple[tuple[WorstCase, ...], NDArray[np.bool_]]:
    """Numbers of all loops, and which plants meet every requirement.

    Parameters
    ----------
    problem : LoopProblem
        Its plants are those to promise for, the estimate first.
    gains : ndarray, shape (n_gains,)
        New gains.
    old : LoopAssessment or None
        The flown gains on the same plants; None where nothing was flown.
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s: nothing is promised of what is read above it.
    judged : LoopAssessment, optional
        The new gains judged by the problem, where that is known.

    Returns
    -------
    tuple of tuple of WorstCase and ndarray of bool, shape (n_plants,)
    """
    new = problem.judge(gains[None]) if judged is None else judged
    new = beside_modes(new, problem, gains, band_rad_s)
    least_db, made = problem.requirements.gain_margin_db, []
    for loop, usual in _wanted(new):
        asked = _asked(problem, new, loop, usual)
        kind = replace(usual, more=_more_is_better(new, asked, usual))
        values = _values(new, loop, kind)
        unknown, bound = modes_outside(new, kind.at(loop), band_rad_s, least_db)
        worst = (
            None if unknown else _worst(np.append(_asked_of(new, asked, values), bound), kind.more)
        )
        flown, flown_worst = _flown(old, loop, kind, band_rad_s, least_db)
        made.append(
            WorstCase(
                loop,
                kind.name,
                _estimate(f"{loop}: {kind.name}", kind, values, unknown, bound),
                worst,
                flown,
                flown_worst,
                *_requirement(new, asked, values, worst),
            )
        )
    made.append(_noise(problem, new, old))
    return tuple(made), np.asarray(new.slack.squeeze(1).min(axis=0) >= 0.0)


def _values(judged: LoopAssessment, loop: str, kind: _Kind) -> Array:
    values: Array = getattr(judged.metrics[loop], kind.field).squeeze(0)
    return values


def _flown(
    old: LoopAssessment | None,
    loop: str,
    kind: _Kind,
    band_rad_s: tuple[float, float] | None,
    least_db: float,
) -> tuple[float | None, float | None]:
    """A number with the gains that flew: of the estimate, and at worst as far as it is promised."""
    if old is None or not bool(old.stable.squeeze(0)[0]):
        return None, None
    values = _values(old, loop, kind)
    unknown, bound = modes_outside(old, kind.at(loop), band_rad_s, least_db)
    promised = bool(old.stable.all()) and not unknown
    return _number(values[0]), _worst(np.append(values, bound), kind.more) if promised else None


def _wanted(judged: LoopAssessment) -> Iterator[tuple[str, _Kind]]:
    for loop in judged.metrics:
        for kind in KINDS:
            if loop != ANGLE or not kind.field.startswith("disturbance"):
                yield loop, kind


def _asked(problem: LoopProblem, judged: LoopAssessment, loop: str, kind: _Kind) -> list[Limit]:
    """Requirements on a number."""
    return [
        limit
        for limit in limits(problem.requirements, judged.metrics, problem.crossover_limit_rad_s)
        if (limit.loop, limit.field) == (loop, kind.field)
    ]


def _slack(judged: LoopAssessment, limit: Limit) -> Array:
    return np.asarray(judged.slack[judged.names.index(limit.name), 0])


def _more_is_better(judged: LoopAssessment, asked: list[Limit], kind: _Kind) -> bool:
    """On which side the worst plant is: that of the limit which a plant comes nearest to."""
    if not asked:
        return kind.more
    return not min(asked, key=lambda limit: float(_slack(judged, limit).min())).most


def _asked_of(judged: LoopAssessment, asked: list[Limit], values: Array) -> Array:
    """Values that a verdict is on: the highest of several crossovers, where that has a limit."""
    for limit in asked:
        if limit.highest:
            slack = _slack(judged, limit)
            highest = np.where(slack < FULL, limit.bound * np.exp(-slack), -np.inf)
            return np.asarray(np.fmax(values, highest))
    return values


def _requirement(
    judged: LoopAssessment, asked: list[Limit], values: Array, worst: float | None
) -> tuple[str, bool, int, float | None, int, int]:
    """What was asked of a number, in words; whether all plants meet it, and which misses most."""
    slacks = [_slack(judged, limit) for limit in asked]
    missing = (
        [bool(each) for each in np.any([slack < 0.0 for slack in slacks], axis=0)] if asked else []
    )
    missed = None
    if any(missing):
        k = int(np.argmin([slack.min() for slack in slacks]))
        missed = _number(missed_most(asked[k], slacks[k], values))
    shown = (worst, _number(values[0]), missed)
    digits = max((_digits(limit, shown) for limit in asked), default=DIGITS)
    told = " and ".join(limit.told(digits) for limit in asked)
    return told, not any(missing), digits, missed, sum(missing), len(values)


def missed_most(limit: Limit, slack: Array, values: Array) -> float:
    """Number of the plant that is furthest from a limit.

    Parameters
    ----------
    limit : Limit
    slack, values : ndarray, shape (n_plants,)
        Of the limit, and of the number that it speaks of, in its unit.

    Returns
    -------
    float
        In the unit of the number; not finite where that plant has no such number.
    """
    worst = int(slack.argmin())
    if limit.highest:
        return float(limit.bound * np.exp(-slack[worst]))
    return float(values[worst])


def _digits(limit: Limit, shown: tuple[float | None, float | None, float | None]) -> int:
    """How many tell the worst plant, the estimate and the one that misses most from a limit."""
    worst, nominal, missed = shown
    promised = [limit.digits_beside(each) for each in (worst, missed) if each is not None]
    of_nominal = DIGITS if nominal is None else limit.digits_beside(nominal, promised=False)
    return max(DIGITS, of_nominal, *promised)


def _noise(problem: LoopProblem, new: LoopAssessment, old: LoopAssessment | None) -> WorstCase:
    known = problem.noise_psd is not None
    values = new.noise.squeeze(0)
    most = problem.noise_limit
    asked = [] if most is None else [noise_limit(most)]
    before = None if old is None or not old.stable.squeeze(0)[0] else old.noise.squeeze(0)
    rate = problem.inner == AxisLoop.inner
    sensor, unit = "gyro" if rate else "measurement", "1/(rad/s)" if rate and not known else "1"
    name = "noise, rms" if known else f"noise over {sensor} noise"
    worst = _worst(values, False)
    return WorstCase(
        "output",
        name,
        _estimate(f"output: {name}", replace(NOISE, unit=unit), values),
        worst,
        None if before is None else _number(before[0]),
        None if before is None or old is None or not old.stable.all() else _worst(before, False),
        *_requirement(new, asked, values, worst),
    )


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _estimate(
    name: str, kind: _Kind, values: Array, unknown: str = "", bound: float = np.inf
) -> Reading:
    """Of the estimated plant, which is the first, with the middle of all plants about it."""
    value = _number(values[0])
    if value is None:
        return Estimate(name, None, kind.unit, None, "no crossing in the band of the loop")
    if unknown:
        return Estimate(name, value, kind.unit, None, unknown)
    if len(values) < FEWEST or not np.all(np.isfinite(values)):
        return Estimate(name, value, kind.unit)
    ends = DrawnEnds(values)
    worse = np.isfinite(bound) and _worst(np.append(values, bound), kind.more) == bound
    return Estimate(name, value, kind.unit, ends=Reaching(ends, bound) if worse else ends)


def _worst(values: Array, more: bool) -> float | None:
    """A missing crossing sets no limit, so the others decide."""
    present = values[np.isfinite(values)]
    if not present.size:
        return None
    return float(present.min() if more else present.max())
