"""One axis tuned with the others as they stand: search, fresh plants to judge by, safe steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.margins.outside_band import MarginBeyond
from flightid.control.tuning.controller_paths import ControllerPaths, loop_responses, standing
from flightid.control.tuning.evidence import TuningEvidence
from flightid.control.tuning.gain_search import EDGE, search
from flightid.control.tuning.gain_search import steps as search_steps
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.gain_steps import Stage, TunedGain
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem, Plants
from flightid.control.tuning.margins_beyond import margins_beyond
from flightid.control.tuning.modes_outside import beside_modes
from flightid.control.tuning.order_statistics import MOST
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.sampled_plants import (
    AxisLoops,
    SampledPlants,
    loop_grid,
    plants_of_axis,
)
from flightid.control.tuning.shortfalls import shortfalls
from flightid.control.tuning.unseen_modes import moved_of
from flightid.control.tuning.whole_gains import whole_gains
from flightid.control.tuning.worst_cases import WorstCase, worst_cases
from flightid.frozen import dataclass
from flightid.responses.pair import PairResponse

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SEARCH_POINTS, JUDGED_POINTS = 200, 700
"""Frequencies of the loops that are searched, and of those that judge the gains."""
SAME_GAIN = 1e-9
"""Step by which a ratio may pass its limit: rounding."""


@dataclass(frozen=True, eq=False)
class PlantSet:
    """Plants with their responses on one grid.

    Attributes
    ----------
    sampled : SampledPlants
    omega_rad_s : ndarray, shape (n_f,)
    rate, angle : ndarray of complex, shape (n, n_axes, n_axes, n_f)
    """

    sampled: SampledPlants
    omega_rad_s: Array
    rate: Complex
    angle: Complex

    @classmethod
    def of(
        cls,
        sampled: SampledPlants,
        points: int,
        loops: Sequence[AxisLoop],
        gyro: Gyro,
        factors: Callable[[Array], Complex],
    ) -> PlantSet:
        """Evaluate plants, each with its own error, on a grid that is fine where they resonate."""
        omega = loop_grid(sampled.sample_time_s, points, sampled.resonances())
        rate, angle = loop_responses(sampled, omega, loops, gyro)
        factor = factors(omega)
        return cls(sampled, omega, rate * factor, angle * factor)

    def axis(self, place: int, loops: list[AxisLoop], gyro: Gyro) -> Plants:
        """Plants of one axis with the other loops closed."""
        pairs = [standing(loop, self.omega_rad_s, gyro) for loop in loops]
        closed = AxisLoops(*(np.array(each) for each in zip(*pairs, strict=True)))
        return plants_of_axis(
            self.rate, self.angle, self.omega_rad_s, self.sampled.unstable, place, closed
        )


@dataclass(frozen=True, eq=False)
class Setting:
    """All that is the same for every axis and round.

    Attributes
    ----------
    evidence : TuningEvidence
    searched, judged : PlantSet
        Plants of the search, and fresh ones on a finer grid; the estimate first in both.
    gyro : {"raw", "filtered"}
    with_angle : bool
    requirements : TuningRequirements
    noise : tuple of ndarray or None
        Frequencies (rad/s) and spectral density ((rad/s)²/Hz) of the rate's noise.
    noise_allowed : float or None
        Output noise that is fine where that of the flight is known: bounds it in place of its
        growth, or as much as the flown gains make behind the filters that are tuned with.
    by_hand : mapping of str to float
        Gains by name that are judged as they stand; axes without any are searched.
    """

    evidence: TuningEvidence
    searched: PlantSet
    judged: PlantSet
    gyro: Gyro
    with_angle: bool
    requirements: TuningRequirements
    noise: tuple[Array, Array] | None = None
    noise_allowed: float | None = None
    by_hand: Mapping[str, float] = field(default_factory=dict)

    def measured_of(self, place: int) -> PairResponse | None:
        """The measured response of an axis, where the fit rests on one."""
        system = self.searched.sampled.systems[0]
        return self.evidence.measured.get(f"{system.outputs[place]}/{system.inputs[place]}")


@dataclass(frozen=True, eq=False)
class AxisResult:
    """What was found for one axis.

    Attributes
    ----------
    found : GainSearchResult
    loop : AxisLoop
        With the gains found, rounded.
    worst_cases : tuple of WorstCase
    met : ndarray of bool, shape (n_fresh,)
        Which fresh plants meet every requirement.
    flown_stable : ndarray of bool or None
        Which of them the flown gains hold stable, the estimate first; None where none flew.
    problem : LoopProblem
        With the fresh plants.
    beyond : tuple of MarginBeyond
        Margins that are read above the identified band.
    """

    found: GainSearchResult
    loop: AxisLoop
    worst_cases: tuple[WorstCase, ...]
    met: NDArray[np.bool_]
    flown_stable: NDArray[np.bool_] | None
    problem: LoopProblem
    beyond: tuple[MarginBeyond, ...] = ()


def problem_of(
    setting: Setting, plants: Plants, paths: ControllerPaths, noise_limit: float | None
) -> LoopProblem:
    """The axis as a problem on some plants."""
    need, band = setting.requirements, setting.evidence.band_rad_s
    low, high = paths.ranges()
    limit = None
    if band is not None and need.band_factor is not None:
        limit = band[1] / need.band_factor
    return LoopProblem(
        plants,
        paths,
        paths.kinds,
        low,
        high,
        need,
        limit,
        None if setting.noise is None else np.interp(plants.omega_rad_s, *setting.noise),
        noise_limit,
        paths.loop.inner,
        paths.loop.time_scale,
        paths.integral_ratio(need.integral_factor),
        rigid=setting.evidence.rigid,
    )


def noise_limit(setting: Setting, problem: LoopProblem, flown: Array) -> float | None:
    """Largest output noise: what was asked for, and the growth over the flown gains."""
    need, limits = setting.requirements, []
    if need.output_noise_rms is not None and setting.noise is not None:
        limits.append(need.output_noise_rms)
    allowed = setting.noise_allowed
    if allowed is not None:
        limits.append(allowed)
    if (allowed is not None or need.noise_growth is not None) and flown.any():
        judged = problem.judge(flown[None], [0])
        if judged.stable.item():
            noise = float(judged.noise.item())
            if allowed is not None:
                limits[-1] = max(allowed, noise)
            elif need.noise_growth is not None:
                limits.append(need.noise_growth * noise)
    return min(limits, default=None)


def tune_axis(
    setting: Setting,
    loops: list[AxisLoop],
    flown: list[AxisLoop],
    place: int,
    advance: Callable[[int], None],
) -> AxisResult:
    """Tune one axis with the loops of the others closed as they stand.

    Parameters
    ----------
    setting : Setting
    loops : list of AxisLoop
        All axes as they stand; that of this axis gives filters and start.
    flown : list of AxisLoop
        All axes as flown.
    place : int
        Which axis.
    advance : callable
        Told of steps done.
    """
    paths = ControllerPaths(loops[place], setting.gyro, setting.with_angle, flown[place])
    limit = _noise_limit(setting, paths, flown, place)
    given = {name: setting.by_hand[name] for name in paths.names if name in setting.by_hand}
    if given:
        loop = paths.with_parameters({n: paths.loop.written(v) for n, v in given.items()})
        fresh, old = _judged(setting, paths, limit, loops, flown, place)
        return _result(setting, paths, held_by_hand(fresh, paths.gains_of(loop)), loop, fresh, old)
    plants = setting.searched.axis(place, loops, setting.gyro)
    first = list(range(1 + len(setting.evidence.corners)))
    found = search(problem_of(setting, plants, paths, limit), first, advance)
    if paths.loop.gains_are_whole:
        found = whole_gains(problem_of(setting, plants, paths, limit), paths, found)
    loop = paths.with_parameters(paths.parameters(found.gains))
    fresh, old = _judged(setting, paths, limit, loops, flown, place)
    return _result(setting, paths, found, loop, fresh, old)


def held_by_hand(
    problem: LoopProblem, gains: Array, judged: LoopAssessment | None = None
) -> GainSearchResult:
    """Gains that nobody searched, with the requirements that fresh plants do not meet.

    Parameters
    ----------
    problem : LoopProblem
        Its plants are those to promise for.
    gains : ndarray, shape (n_gains,)
    judged : LoopAssessment, optional
        The gains judged by the problem, where that is known.

    Returns
    -------
    GainSearchResult
        Gains exist that hold for the estimate and for nine of ten plants: what the search promises
        of its own on fresh plants is no more.
    """
    judged = problem.judge(gains[None]) if judged is None else judged
    least = dict(zip(judged.names, judged.slack.squeeze(1).min(axis=-1).tolist(), strict=True))
    short = tuple(name for name, slack in least.items() if slack < 0.0)
    # Nothing moved these gains up to a requirement: one binds where they stand at it.
    tight = tuple(name for name, slack in least.items() if slack < EDGE)
    met = judged.slack.squeeze(1).min(axis=0) >= 0.0
    exists = bool(met[0]) and float(met.mean()) >= MOST
    missed = () if exists else shortfalls(problem, judged)
    return GainSearchResult(gains, exists, short or tight, least, by_hand=True, missed=missed)


def _result(
    setting: Setting,
    paths: ControllerPaths,
    found: GainSearchResult,
    loop: AxisLoop,
    fresh: LoopProblem,
    old: LoopAssessment | None,
) -> AxisResult:
    gains = paths.gains_of(loop)
    made, met = worst_cases(fresh, gains, old, setting.evidence.band_rad_s)
    held = None if old is None else old.stable.squeeze(0)
    beyond = margins_beyond(fresh, gains, setting.evidence.band_rad_s)
    return AxisResult(found, loop, made, met, held, fresh, beyond)


def judge_axis(
    setting: Setting, loops: list[AxisLoop], flown: list[AxisLoop], place: int
) -> tuple[tuple[WorstCase, ...], NDArray[np.bool_]]:
    """What the gains of one axis promise as they stand, and which fresh plants keep it.

    Parameters
    ----------
    setting : Setting
    loops, flown : list of AxisLoop
        All axes as they stand, and as flown.
    place : int
        Which axis.
    """
    paths = ControllerPaths(loops[place], setting.gyro, setting.with_angle)
    limit = _noise_limit(setting, paths, flown, place)
    fresh, old = _judged(setting, paths, limit, loops, flown, place)
    return worst_cases(fresh, paths.gains_of(loops[place]), old, setting.evidence.band_rad_s)


def _noise_limit(
    setting: Setting, paths: ControllerPaths, flown: list[AxisLoop], place: int
) -> float | None:
    """Largest output noise of one axis."""
    as_flown = problem_of(setting, setting.searched.axis(place, flown, setting.gyro), paths, None)
    return noise_limit(setting, as_flown, paths.gains_of(flown[place]))


def _judged(
    setting: Setting,
    paths: ControllerPaths,
    limit: float | None,
    loops: list[AxisLoop],
    flown: list[AxisLoop],
    place: int,
) -> tuple[LoopProblem, LoopAssessment | None]:
    """The axis on fresh plants, and its flown gains among the others' flown gains."""
    fresh = problem_of(setting, setting.judged.axis(place, loops, setting.gyro), paths, limit)
    system, omega = setting.judged.sampled.systems[0], fresh.plants.omega_rad_s
    names = system.outputs[place], system.inputs[place]
    moved = moved_of(setting.evidence, *names, omega)
    fresh = replace(fresh, moved_db=moved, measured=setting.measured_of(place))
    if not flown[place].has_flown:
        return fresh, None
    own = ControllerPaths(flown[place], setting.gyro, setting.with_angle)
    plants = setting.judged.axis(place, flown, setting.gyro)
    around = replace(problem_of(setting, plants, own, limit), moved_db=fresh.moved_db)
    gains = own.gains_of(flown[place])
    old = around.judge(gains[None])
    return fresh, beside_modes(old, around, gains, setting.evidence.band_rad_s)


def axis_steps(setting: Setting, loop: AxisLoop) -> int:
    """Steps that `tune_axis` announces."""
    paths = ControllerPaths(loop, setting.gyro, setting.with_angle)
    low, high = paths.ranges()
    plants = setting.searched.axis(0, [loop] * setting.searched.sampled.n_axes, setting.gyro)
    problem = LoopProblem(plants, paths, paths.kinds, low, high, setting.requirements)
    return search_steps(replace(problem, inner=loop.inner, time_scale=loop.time_scale))


def changes_of(paths: ControllerPaths, new: AxisLoop) -> tuple[TunedGain, ...]:
    """Each parameter before and after."""
    ranges, before, after = paths.loop.ranges, paths.loop.gains, new.gains
    flown = paths.loop.has_flown
    return tuple(
        TunedGain(
            name,
            ranges[name].unit,
            before[name] if flown else None,
            after[name],
            ranges[name].low,
            ranges[name].high,
        )
        for name in paths.names
    )


def stages_of(
    setting: Setting,
    loops: list[AxisLoop],
    place: int,
    changes: tuple[TunedGain, ...],
    limit: float,
) -> tuple[Stage, ...]:
    """Steps from the flown gains to the new ones, no ratio above the limit, each judged."""
    ratios = [abs(np.log(c.ratio)) for c in changes if c.ratio]
    count = max(1, int(np.ceil(max(ratios, default=0.0) / np.log(limit) - SAME_GAIN)))
    paths = ControllerPaths(loops[place], setting.gyro, setting.with_angle)
    plants = setting.searched.axis(place, loops, setting.gyro)
    problem = problem_of(setting, plants, paths, None)
    stages = []
    for k in range(1, count + 1):
        gains = {c.name: loops[place].written(_between(c, k / count)) for c in changes}
        judged = problem.judge(paths.gains_of(paths.with_parameters(gains))[None])
        inner = [each for name, each in judged.metrics.items() if name != ANGLE]
        stages.append(
            Stage(
                gains,
                bool(judged.stable.all()),
                _least([each.phase_margin_deg for each in inner]),
                _least([each.gain_margin_db for each in inner]),
            )
        )
    return tuple(stages)


def _between(change: TunedGain, share: float) -> float:
    """On the way from flown to new: by ratio, and by difference where one is zero."""
    if share >= 1.0 or change.flown is None:
        return change.new
    if change.ratio:
        value = change.flown * change.ratio**share
    else:
        value = change.flown + share * (change.new - change.flown)
    return float(value)


def _least(values: list[Array]) -> float | None:
    finite = [float(v) for each in values for v in each.ravel() if np.isfinite(v)]
    return min(finite, default=None)
