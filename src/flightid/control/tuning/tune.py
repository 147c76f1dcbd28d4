"""The verb for several axes: each with the others closed, in turn, and then all together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.tuning.axis_tuning import (
    AxisResult,
    Setting,
    axis_steps,
    judge_axis,
    tune_axis,
)
from flightid.control.tuning.controller_paths import ControllerPaths, has_angle_loop
from flightid.control.tuning.evidence import Verdicts, gather
from flightid.control.tuning.filter_choice import FilterChoice
from flightid.control.tuning.flown_gains import GainsOfAxes, flown_loop, loops_of, require_known
from flightid.control.tuning.judge_together import judge_together
from flightid.control.tuning.options import DRAWS, OtherLoops
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.result import RefusedAxis, Tuning
from flightid.control.tuning.structure_error import Band
from flightid.control.tuning.together import ClosedAxis, Together
from flightid.control.tuning.tune_pid import (
    CHANNELS,
    design_of,
    make_setting,
    naming_filters,
    tune_pid,
    with_filters,
)
from flightid.control.tuning.tuned_filters import tuned_filters
from flightid.errors import DataError, FlightidError, ModelError, OptionError
from flightid.frozen import dataclass
from flightid.progress import progress
from flightid.threads import on_one_thread

Array = NDArray[np.float64]
ROUNDS = 4
"""In which each axis is tuned beside the others."""
BESIDE = ("filters", "by_hand")
"""What is shared by axes and is no part of the evidence."""
SETTLED = 0.02
"""Largest relative change of a gain from one round to the next that ends the rounds."""
TINY_GAIN = 1e-9
"""What a gain of zero counts as there."""


@on_one_thread
def tune(
    fits: Mapping[str, object],
    *,
    gains: GainsOfAxes,
    autopilot: str = "arducopter",
    requirements: TuningRequirements | Mapping[str, TuningRequirements] | None = None,
    gyro: Gyro = "filtered",
    angle_loop: bool = True,
    signs: Mapping[str, float] | None = None,
    band_rad_s: Band | None = None,
    verifications: Mapping[str, Verdicts | Iterable[Verdicts]] | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    nominal: bool = False,
    accept_red: bool = False,
    other_loops: OtherLoops = "closed",
    filters: FilterChoice | None = None,
    by_hand: Mapping[str, float] | None = None,
    rigid: bool = False,
) -> Tuning:
    """Gains of several axes; axes of one model are tuned with each other's loops closed.

    Where two axes have the same fit, each is tuned with the other's loops closed, in turn, until
    the gains settle; then all loops are closed together for plants that no search has seen, and
    the disk margin at all outputs at once is told. An axis that its data do not allow is refused by
    name, and the others are tuned.

    Parameters
    ----------
    fits : mapping of str to fit
        By axis: ``{"roll": fit, "pitch": fit, "yaw": other}``. One fit for two axes holds both
        commands and both rates.
    gains : mapping of str to AxisLoop, Log, or mapping of str to float
        As flown: by axis, the log of the flight, or all parameters by the autopilot's names.
    autopilot : str
        Of parameters given by name; a log tells its autopilot.
    requirements : TuningRequirements, or a mapping of them by axis, optional
    gyro, angle_loop, band_rad_s, draws, seed, nominal, accept_red, rigid : optional
        As for `flightid.tune_pid`.
    signs : mapping of str to int, optional
        −1 for an axis whose rate answers the command the other way round.
    verifications : mapping of str to Verification or several, optional
        Predictions of unseen records, by axis.
    other_loops : {"closed", "open"}
        ``"open"``: axes of one model are designed each as if the other had no controller, and then
        judged with all loops closed; where that breaks a requirement they are red.
    filters : FilterChoice, optional
        Filters to tune with, as `choose_filters` found them for the noise of the flight, which then
        bounds the output's in place of its growth; default: those that flew.
    by_hand : mapping of str to float, optional
        Gains by the autopilot's names that are judged as they stand in place of a search; those of
        their axes that are not named stay as flown. Axes that none of them belongs to are searched.

    Raises
    ------
    DataError
        The data support gains of no axis; see `flightid.tune_pid`.
    ModelError
        The rate of every axis answers its command the other way round.
    OptionError
        No axis, or one that is not known; a gain by hand that no axis has or outside its range.

    Reference
    ---------
    Maciejowski, *Multivariable Feedback Design* (1989), section 4.2 (sequential loop closing);
    Seiler, Packard & Gahinet, *IEEE Control Systems Magazine* 40 (2020), 78–95 (disk margins).

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.control.autopilots import axis_loop
    >>> plant = fid.load_model("rate_integrator", axis="yaw").with_values(
    ...     {"Ntpsi": 40.0, "tau": 0.03})
    >>> flown = {"yaw": axis_loop("arducopter", "yaw", loop_rate_hz=400.0)}
    >>> tuning = fid.tune({"yaw": plant}, gains=flown, nominal=True, angle_loop=False,
    ...     band_rad_s=(0.5, 60.0), requirements=fid.TuningRequirements(noise_growth=None))
    >>> tuning["yaw"].axis
    'yaw'
    """
    unknown = [axis for axis in fits if axis not in CHANNELS]
    if not fits or unknown:
        raise OptionError(
            "axes to tune", found=", ".join(unknown) or "none", needed=", ".join(CHANNELS)
        )
    shared: dict[str, Any] = {
        "band_rad_s": band_rad_s, "draws": draws, "seed": seed,
        "nominal": nominal, "accept_red": accept_red, "filters": filters,
        "by_hand": by_hand or {}, "rigid": rigid,
    }  # fmt: skip
    if by_hand:
        require_known(by_hand, loops_of(gains, autopilot, fits))
    designs: dict[str, PidDesign] = {}
    together: list[Together] = []
    errors: list[tuple[str, FlightidError]] = []
    for axes in _groups(fits):
        asked = [
            AxisRequest(
                axis,
                _requirements(requirements, axis),
                int((signs or {}).get(axis, 1)),
                _verdicts(verifications, axis),
            )
            for axis in axes
        ]
        try:
            flown = [flown_loop(gains, autopilot, axis) for axis in axes]
            made, whole = _tuned(fits[axes[0]], asked, flown, gyro, angle_loop, other_loops, shared)
        except (DataError, ModelError) as error:
            errors += [(axis, error) for axis in axes]
            continue
        designs |= dict(zip(axes, made, strict=True))
        together += whole
    if not designs:
        raise errors[0][1]
    kept = tuple(designs[axis] for axis in fits if axis in designs)
    refused = tuple(RefusedAxis.by(*each) for each in errors)
    told = None if filters is None else tuned_filters(filters, designs)
    return Tuning(kept, tuple(together), refused, told)


@dataclass(frozen=True)
class AxisRequest:
    """What is asked of one axis.

    Attributes
    ----------
    axis : str
    requirements : TuningRequirements
    sign : int
    verdicts : sequence of verifications
    """

    axis: str
    requirements: TuningRequirements
    sign: int
    verdicts: Sequence[Verdicts]

    @property
    def channels(self) -> tuple[str, str]:
        """Command and rate."""
        return CHANNELS[self.axis]


def _tuned(
    fit: object,
    asked: Sequence[AxisRequest],
    flown: list[AxisLoop],
    gyro: Gyro,
    angle_loop: bool,
    other_loops: OtherLoops,
    shared: Mapping[str, Any],
) -> tuple[list[PidDesign], list[Together]]:
    """The axes of one fit: one alone, or several with each other's loops."""
    alone = [
        tune_pid(
            fit, gains=loop, requirements=each.requirements, angle_loop=angle_loop, gyro=gyro,
            sign=each.sign, verification=each.verdicts,
            **{**shared, "by_hand": _of(loop, shared["by_hand"])},
        )
        for each, loop in zip(asked, flown, strict=True)
        if len(asked) == 1 or other_loops == "open"
    ]  # fmt: skip
    if len(asked) == 1:
        return alone, []
    evidence = gather(
        fit,
        max(1.0 / each.loop_rate_hz for each in flown),
        [f"{rate}/{command}" for command, rate in (each.channels for each in asked)],
        fresh=shared["draws"],
        verification=[verdict for each in asked for verdict in each.verdicts],
        needs_band=any(each.requirements.band_factor is not None for each in asked),
        **{name: value for name, value in shared.items() if name not in BESIDE},
    )
    setting = make_setting(
        evidence,
        flown,
        [each.channels[1] for each in asked],
        [each.channels[0] for each in asked],
        asked[0].requirements,
        gyro,
        angle_loop and all(map(has_angle_loop, flown)),
        [each.sign for each in asked],
        None,
    )
    setting = replace(setting, by_hand=shared["by_hand"])
    if alone:
        return alone, [_closed(setting, alone, flown, asked)]
    made, whole = _coupled(setting, flown, asked, shared["seed"], shared["filters"])
    return made, [whole]


def _of(loop: AxisLoop, by_hand: Mapping[str, float]) -> dict[str, float]:
    """Gains by hand of one axis."""
    own = set(loop.names.values())
    return {name: value for name, value in by_hand.items() if name in own}


def _closed(
    setting: Setting,
    alone: list[PidDesign],
    flown: list[AxisLoop],
    asked: Sequence[AxisRequest],
) -> Together:
    """Axes that were designed alone, judged with all loops closed."""
    loops = [design.loop for design in alone]
    closed = []
    for place, each in enumerate(asked):
        worst, met = judge_axis(
            replace(setting, requirements=each.requirements), loops, flown, place
        )
        closed.append(ClosedAxis(each.axis, worst, int(met.sum()), len(met)))
    whole = judge_together(setting, loops, flown, [each.axis for each in asked])
    return replace(whole, closed=tuple(closed))


def _requirements(
    given: TuningRequirements | Mapping[str, TuningRequirements] | None, axis: str
) -> TuningRequirements:
    if isinstance(given, Mapping):
        return given.get(axis, TuningRequirements())
    return given or TuningRequirements()


def _verdicts(
    given: Mapping[str, Verdicts | Iterable[Verdicts]] | None, axis: str
) -> Sequence[Verdicts]:
    found = (given or {}).get(axis, ())
    return tuple(found) if isinstance(found, Iterable) else (found,)


def _groups(fits: Mapping[str, object]) -> list[list[str]]:
    """Axes by the fit that they share, in order."""
    groups: list[list[str]] = []
    for axis, fit in fits.items():
        for group in groups:
            if fits[group[0]] is fit:
                group.append(axis)
                break
        else:
            groups.append([axis])
    return groups


def _coupled(
    setting: Setting,
    flown: list[AxisLoop],
    asked: Sequence[AxisRequest],
    seed: int,
    filters: FilterChoice | None,
) -> tuple[list[PidDesign], Together]:
    """Each axis with the others closed, in turn, until the gains settle."""
    axes = [each.axis for each in asked]
    given = [with_filters(setting, loop, filters) for loop in flown]
    settings = [
        replace(each, requirements=request.requirements)
        for (each, _), request in zip(given, asked, strict=True)
    ]
    loops = [start for _, start in given]
    results: list[AxisResult] = []
    total = ROUNDS * sum(axis_steps(setting, loop) for loop in flown)
    with progress(total, f"tuning {' and '.join(axes)}") as advance:
        for _ in range(ROUNDS):
            before = list(loops)
            results = []
            for place, own in enumerate(settings):
                result = tune_axis(own, loops, flown, place, advance)
                results.append(result)
                if result.found.exists:
                    loops[place] = result.loop
            if all(_settled(setting, *pair) for pair in zip(before, loops, strict=True)):
                break
    designs = [
        naming_filters(design_of(settings[place], result, loops, place, flown, [], seed), filters)
        for place, result in enumerate(results)
    ]
    return designs, judge_together(setting, loops, flown, axes)


def _settled(setting: Setting, before: AxisLoop, after: AxisLoop) -> bool:
    paths = ControllerPaths(before, setting.gyro, setting.with_angle)
    old, new = paths.gains_of(before), paths.gains_of(after)
    return bool(np.all(np.abs(new - old) <= SETTLED * np.maximum(np.abs(old), TINY_GAIN)))
