"""What samples show of damage, channel by channel: spikes, dead stretches, repeats, limits, wraps.

Each test asks for several signs at once, for what it says makes a fit red or amber: a manoeuvre may
be sharp, a sensor coarse, a simulated channel free of noise.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light, Role
from flightid.findings import Finding, counted
from flightid.frozen import dataclass
from flightid.record.commanded_edges import Surroundings, answered, answers
from flightid.record.outlying import FAR, HALF_WIDTH, HARMFUL, NORMAL_MAD, alone
from flightid.record.repeats import measured_rows, rests_within_a_count, stands_still
from flightid.record.validation import LARGEST
from flightid.units import DIMENSIONLESS, is_convertible, si_base

Array = NDArray[np.float64]
TOLD = 4
"""Instants of samples that are named."""
FEWEST = 50
"""Samples below which nothing is judged."""
RED_SHARE = 0.05
"""Share of a channel's variance, or of its samples, from which a fault is red."""
DEAD_SAMPLES, DEAD_SHARE, NOISY = 20, 0.01, 0.3
REPEATED, ABRUPT = 0.01, 0.25
"""Share of values that come twice in a channel that never rests; last step before it stops, over
the median one."""
LIMIT_SHARE, LIMIT_RUN, LIMIT_RUNS, LEVELS = 0.01, 3, 3, 30
MOST_PLACES = 50
"""Stretches of one fault that are told apart; nearer ones are joined."""
TURN, NEAR_TURN = 2.0 * np.pi, 0.05
ALONE = Surroundings()


@dataclass(frozen=True)
class SampleFault:
    """A finding on one channel and the stretch of time that it concerns.

    Attributes
    ----------
    channel : str
    start_s, stop_s : float
    finding : Finding
    places_s : tuple of tuple of float
        Where in that stretch it is, first and last instant of each place; none: all of it.
    deviations : float or None
        Threshold of outliers that bridges spikes and no other sample; None: there is none.
    """

    channel: str
    start_s: float
    stop_s: float
    finding: Finding
    places_s: tuple[tuple[float, float], ...] = ()
    deviations: float | None = None


def sample_faults(
    name: str,
    time_s: Array,
    samples: Array,
    *,
    unit: str,
    role: Role,
    around: Surroundings = ALONE,
) -> list[SampleFault]:
    """Examine the samples of one channel on its own stamps, before anything is resampled.

    Parameters
    ----------
    name : str
        Channel, for messages.
    time_s, samples : ndarray, shape (n,)
        Increasing stamps, s; samples that are not finite are passed over.
    unit : str
    role : Role
        Inputs, and what was injected, may step, stand still and meet limits: they are examined for
        spikes and wraps alone.
    around : Surroundings
        What else was recorded then: edges of a command and what answers them are no spikes.

    Returns
    -------
    list of SampleFault

    Example
    -------
    >>> t = np.arange(400) / 100
    >>> y = np.sin(3 * t) + 0.01 * np.random.default_rng(0).standard_normal(400)
    >>> y[200] = 90.0
    >>> [fault.finding.code for fault in sample_faults("y", t, y, unit="1", role=Role.OUTPUT)]
    ['spikes']
    """
    stamps, values, signs = time_s, samples, _Signs.of(time_s, samples)
    if not signs.is_finite:
        present = np.isfinite(samples) & np.isfinite(time_s)
        stamps, values = time_s[present], samples[present]
        signs = _Signs.of(stamps, values)
    # What is larger is refused by name where it is worked with.
    if values.size < FEWEST or not 0.0 < signs.range <= LARGEST:
        return []
    spikes, rests = _spikes, [_dead, _held, _clipped]
    if role in (Role.INPUT, Role.EXCITATION):
        spikes, rests = _input_spikes, []
    checks = [*([spikes] if signs.stands_out else []), _wraps, *(rests if signs.rests else [])]
    channel = _ExaminedChannel(name, stamps, values, unit, role, around, signs)
    return [fault for check in checks if (fault := check(channel))]


class _Signs(NamedTuple):
    """What one reading of a channel tells: most need no closer look.

    Attributes
    ----------
    is_finite : bool
        Nothing else is known where it is not.
    range : float
    rests : bool
        Whether any sample is that before.
    largest_step : float
        From a sample to the next.
    stands_out : bool
        Whether any may be `FAR` robust deviations from the median of its neighbours.
    """

    is_finite: bool
    range: float
    rests: bool
    largest_step: float
    stands_out: bool

    @classmethod
    def of(cls, stamps: Array, values: Array) -> _Signs:
        return cls(*_native.sample_signs(stamps, values, HALF_WIDTH, NORMAL_MAD * FAR))


@dataclass(frozen=True)
class _ExaminedChannel:
    """One channel, all of it finite."""

    name: str
    stamps: Array
    values: Array
    unit: str
    role: Role
    around: Surroundings
    signs: _Signs

    @cached_property
    def alone(self) -> tuple[NDArray[np.intp], Array, float]:
        """Samples alone; distances of all from the median of their neighbours; their spread."""
        if not self.signs.stands_out:
            return np.empty(0, dtype=np.intp), np.empty(0), 0.0
        return alone(self.values)

    @cached_property
    def spikes(self) -> NDArray[np.intp]:
        """Samples alone, without edges of commands and what answers them."""
        at, _, _ = self.alone
        if not at.size:
            return at
        own = self.stamps, self.values
        explained = (
            answered(own, at, self.around.signals(Role.OUTPUT))
            if self.role is Role.INPUT
            else answers(own, at, self.around.signals(Role.INPUT, Role.EXCITATION))
        )
        return at[~explained]

    @cached_property
    def steps(self) -> Array:
        """From each sample to the next."""
        return np.diff(self.values)

    @property
    def of_unit(self) -> str:
        """The unit as it follows a number."""
        return "" if self.unit == DIMENSIONLESS else f" {self.unit}"

    def fault(
        self,
        starts: NDArray[np.intp],
        stops: NDArray[np.intp],
        finding: tuple[str, Light, str, str],
    ) -> SampleFault:
        """A finding on stretches, by the first and the last sample of each."""
        code, light, said, action = finding
        ends = self.stamps[starts], self.stamps[stops]
        places = tuple(zip(*(each.tolist() for each in _joined(*ends)), strict=True))
        told = Finding(code, light, said, action)
        return SampleFault(self.name, places[0][0], places[-1][1], told, places)


def _joined(starts: Array, stops: Array) -> tuple[Array, Array]:
    """Stretches, those that lie nearest to each other as one where they are many."""
    parted = np.sort(np.argsort(stops[:-1] - starts[1:], kind="stable")[: MOST_PLACES - 1])
    return starts[np.concatenate([[0], parted + 1])], stops[np.concatenate([parted, [-1]])]


def _input_spikes(channel: _ExaminedChannel) -> SampleFault | None:
    """Spikes beyond all else that the input does; pulses have one height, or begin at rest."""
    values, at = channel.values, channel.spikes
    rest = np.delete(values, at)
    range_ = float(np.ptp(rest))
    if not at.size or range_ == 0.0:
        return None
    several = bool(np.any(np.diff(at) > HALF_WIDTH))
    if several and float(np.ptp(values[at])) < HARMFUL * range_:
        return None
    margin = HARMFUL * range_
    beyond = (values[at] < rest.min() - margin) | (values[at] > rest.max() + margin)
    return _spikes(channel) if np.any(beyond) else None


def _spikes(channel: _ExaminedChannel) -> SampleFault | None:
    name, stamps, values = channel.name, channel.stamps, channel.values
    at, (_, away, spread) = channel.spikes, channel.alone
    if not at.size:
        return None
    share = float(np.sum(away[at] ** 2) / np.sum((values - np.median(values)) ** 2))
    light = Light.RED if share >= RED_SHARE else Light.AMBER
    said = (
        f"{counted(at.size, 'sample')} of {name} {'stands' if at.size == 1 else 'stand'} alone, "
        f"{float(np.max(away[at])):.3g}{channel.of_unit} from "
        f"{'its neighbours' if at.size == 1 else 'the neighbours at most'} "
        f"({_percent(share)} of the channel's variance): {_instants(stamps[at])}"
    )
    between = _between(away[at], np.delete(away, at), spread)
    found = channel.fault(at, at, ("spikes", light, said, _spike_action(between, at.size)))
    return replace(found, deviations=between)


def _instants(stamps: Array) -> str:
    """When they were, the first few."""
    told = [f"{each:.6g}" for each in stamps[:TOLD]]
    more = f" and {len(stamps) - TOLD} more" if len(stamps) > TOLD else ""
    return f"at {', '.join(told)} s{more}"


def _between(heights: Array, others: Array, spread: float) -> float | None:
    """A threshold in deviations between spikes and all other samples; None: there is none."""
    least, most = float(np.min(heights)), float(np.max(others))
    if most >= least:
        return None
    between = float(np.sqrt(least * max(most, 1e-3 * least)))
    return float(f"{between / spread if spread > 0.0 else FAR:.0f}")


def _percent(share: float) -> str:
    """Whole percents; what is there is not called none."""
    return f"{100 * share:.0f} %" if share >= 0.005 else "less than 1 %"


def _spike_action(deviations: float | None, number: int) -> str:
    """What takes out the spikes and no more."""
    them, whose = ("it", "its") if number == 1 else ("them", "their")
    if deviations is None:
        return (
            f"cut the record before and after {them}: what bridges {them} would bridge edges of "
            "the commands"
        )
    return (
        f"look for {whose} cause (a connector, the logger), and bridge {them} before any fit: "
        "write [[conditioning]] into the study and below it outliers = { deviations = "
        f"{deviations:.0f} }}, which lies between {them} and all other samples"
    )


def _wraps(channel: _ExaminedChannel) -> SampleFault | None:
    name = channel.name
    if not is_convertible(channel.unit, "rad"):
        return None
    turn = TURN / si_base(channel.unit)[0]
    if channel.signs.largest_step < (1.0 - 2.0 * NEAR_TURN) * turn:
        return None
    steps = channel.steps
    at = np.flatnonzero(np.abs(np.abs(steps) - turn) < NEAR_TURN * turn)
    alone, _, _ = channel.alone
    # A lone sample that is off by a turn is a spike; both of its steps are.
    at = at[~np.isin(at, alone) & ~np.isin(at + 1, alone)]
    if not at.size or np.median(np.abs(steps)) > 0.1 * turn:
        return None
    said = f"{name} jumps by a whole turn {counted(at.size, 'time')}: a heading that wraps"
    finding = ("wrapped", Light.RED, said, "unwrap it before it is fitted")
    return channel.fault(at, at + 1, finding)


def _dead(channel: _ExaminedChannel) -> SampleFault | None:
    """Stretches of one and the same value in a channel whose noise, or whose motion, never rests.

    One at the beginning or the end may be rest; one at an end of the range may be a limit.
    """
    name, stamps, values = channel.name, channel.stamps, channel.values
    starts, stops = _runs(channel.steps == 0.0)
    inner = (starts > 0) & (stops < values.size - 1)
    starts, stops = starts[inner], stops[inner]
    long = (stops - starts) >= max(DEAD_SAMPLES, DEAD_SHARE * values.size)
    long[long] = ~rests_within_a_count(values, plateaus=starts, rests=(starts[long], stops[long]))
    if not long.any():
        return None
    moving = np.ones(values.size - 1, dtype=np.bool_)
    for start, stop in zip(starts[long], stops[long], strict=True):
        moving[start:stop] = False
    steps = channel.steps[moving]
    turning = np.mean(np.diff(np.sign(steps)) != 0) if steps.size > DEAD_SAMPLES else 0.0
    noisy = turning >= NOISY and np.mean(steps == 0.0) <= 1.0 - 2 * NOISY
    if not (noisy or _stops_in_motion(channel, starts[long], steps)):
        return None
    share = float(np.sum((stops - starts)[long])) / values.size
    longest = int(np.argmax(stops - starts))
    light = Light.RED if share >= RED_SHARE else Light.AMBER
    said = (
        f"{name} stands still at one value for {100 * share:.2g} % of its samples, from "
        f"{stamps[starts[longest]]:.6g} to {stamps[stops[longest]]:.6g} s at the longest, though "
        f"{'its noise never rests' if noisy else 'it never rests'} elsewhere: nothing was measured "
        "there"
    )
    action = "cut the record before and after, or leave the channel out"
    return channel.fault(starts[long], stops[long], ("flat", light, said, action))


def _stops_in_motion(channel: _ExaminedChannel, starts: NDArray[np.intp], elsewhere: Array) -> bool:
    """Whether a channel that never repeats a value elsewhere stops within one sample, inside.

    What settles stops little by little, and what a limit stops lies at an end of its range.
    """
    values = channel.values
    if elsewhere.size <= DEAD_SAMPLES or np.mean(elsewhere == 0.0) > REPEATED:
        return False
    before = np.abs(channel.steps[starts - 1])
    inside = (values[starts] > values.min()) & (values[starts] < values.max())
    return bool(np.all(inside & (before >= ABRUPT * np.median(np.abs(elsewhere)))))


def _held(channel: _ExaminedChannel) -> SampleFault | None:
    name, values = channel.name, channel.values
    rows = measured_rows(values)
    # Of a channel without a role nobody knows whether it commands: one that steps far does.
    unknown = channel.role is Role.OTHER
    if rows is None or (unknown and stands_still(values)):
        return None
    slow = f"measured {rows.step} times slower than it is stored, and lags by half of that"
    said = f"{name} repeats its samples: it changes every {rows.step} rows, so that it was "
    said += f"held as a command is, or {slow}" if unknown else slow
    places = {2: "second", 3: "third"}
    place = places.get(rows.step, f"{rows.step}th")
    action = f"resample the record to every {place} row (resample_to_s): of outputs it "
    action += "takes the new values alone, each at its instant"
    if unknown:
        action = f"a command: nothing; what was measured: {action}"
    ends = np.array([0]), np.array([values.size - 1])
    return channel.fault(*ends, ("samples-repeated", Light.AMBER, said, action))


def _clipped(channel: _ExaminedChannel) -> SampleFault | None:
    """Flat tops at the very extremes, met and left abruptly, again and again."""
    name, values = channel.name, channel.values
    for end in (float(values.max()), float(values.min())):
        starts, stops = _runs(values == end)
        inner = (stops - starts >= LIMIT_RUN) & (starts > 0) & (stops < values.size)
        starts, stops = starts[inner], stops[inner]
        share = float(np.sum(stops - starts)) / values.size
        if starts.size < LIMIT_RUNS or share < LIMIT_SHARE:
            continue
        if np.unique(values).size < LEVELS:
            return None
        steps = np.minimum(np.abs(values[starts - 1] - end), np.abs(values[stops] - end))
        if np.median(steps) < 0.1 * np.median(np.abs(np.diff(values))):
            continue
        light = Light.RED if share >= RED_SHARE else Light.AMBER
        said = (
            f"{name} is cut off at {end:.6g}{channel.of_unit} for {100 * share:.2g} % of its "
            f"samples, {starts.size} times"
        )
        action = "fit records in which it stays inside its range; fly a smaller amplitude"
        return channel.fault(starts, stops - 1, ("clipped", light, said, action))
    return None


def _runs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and one past the last of each run of true."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
