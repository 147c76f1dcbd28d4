"""Other gains of a design, judged by the same plants at once: what a slider shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.axis_tuning import held_by_hand
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.findings import GAINS, verdict
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.responses import ResponseBand, response_bands
from flightid.control.tuning.wider_band import wider_band
from flightid.control.tuning.worst_cases import WorstCase, worst_cases
from flightid.findings import Finding
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class MovedGains:
    """What gains of an axis promise.

    Attributes
    ----------
    values : mapping of str to float
        Every gain that moves, as the autopilot keeps it.
    finding : Finding
        Whether they are gains: what a tuning says of them, by hand or searched.
    worst_cases : tuple of WorstCase
        Beside those of the flown gains; the numbers of `tune(…, by_hand=values)`.
    met : ndarray of bool, shape (n_plants,)
        Which plants meet every requirement.
    short : tuple of str
        Requirements that some plant does not meet.
    unstable : int
        Plants that they do not hold stable.
    is_stable : bool
        Whether they hold the estimate: an unstable loop has no margins.
    responses : tuple of ResponseBand
        Of some of the plants; none where the estimate is unstable.
    omega_rad_s : ndarray, shape (n_f,)
    loops : mapping of str to ndarray of complex, shape (n_f,)
        Loop broken at the output, of the estimate, of the worst plant and of the flown gains.
    """

    values: Mapping[str, float]
    finding: Finding
    worst_cases: tuple[WorstCase, ...]
    met: NDArray[np.bool_]
    short: tuple[str, ...]
    unstable: int
    is_stable: bool
    responses: tuple[ResponseBand, ...]
    omega_rad_s: Array
    loops: Mapping[str, Complex]


def move_gains(
    design: PidDesign, values: Mapping[str, float], *, responses: bool = True
) -> MovedGains:
    """Judge other gains by the plants of a design, the loops of the other axes as they stand.

    Parameters
    ----------
    design : PidDesign
        Of an autopilot's axis.
    values : mapping of str to float
        By the autopilot's names; those that are not named are those of the design.
    responses : bool
        Also time responses, which take longer than all margins.

    Raises
    ------
    UnknownNameError
        The axis has no such gain.

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.control.autopilots import axis_loop
    >>> plant = fid.load_model("rate_integrator", axis="roll").with_values(
    ...     {"Ltphi": 140.0, "tau": 0.03})
    >>> design = fid.tune_pid(plant, gains=axis_loop("arducopter", "roll", loop_rate_hz=400.0),
    ...     band_rad_s=(1.0, 100.0), nominal=True)
    >>> moved = move_gains(design, design.gains)
    >>> moved.worst_cases[1].nominal == design.worst_cases[1].nominal
    True
    """
    problem = design.problem
    paths = cast(ControllerPaths, problem.paths)
    all_values = {**design.gains, **values}
    loop = paths.with_parameters({n: paths.loop.written(v) for n, v in all_values.items()})
    gains = paths.gains_of(loop)
    judged = problem.judge(gains[None])
    band = cast("tuple[float, float] | None", design.provenance.get("band_rad_s"))
    made, met = worst_cases(problem, gains, None, band, judged)
    flown = {(each.loop, each.name): each for each in design.worst_cases}
    beside = tuple(
        replace(
            each,
            flown=flown[each.loop, each.name].flown,
            flown_worst=flown[each.loop, each.name].flown_worst,
        )
        for each in made
    )
    slack = judged.slack.squeeze(1)
    short = tuple(n for n, row in zip(judged.names, slack, strict=True) if row.min() < 0.0)
    worst = int(slack.min(axis=0).argmin())
    chosen = problem.plants.take([0, worst])
    seen = problem.loops(gains[None], chosen).whole.squeeze(0)
    curves = {"estimate": seen[0], "worst plant": seen[1]}
    if design.flown.has_flown and not design.filters:
        old = paths.gains_of(design.flown)[None]
        curves["flown"] = problem.loops(old, chosen).whole.squeeze(0)[0]
    made_of = {name: loop.gains[name] for name in paths.names}
    return MovedGains(
        made_of,
        _verdict(design, made_of, held_by_hand(problem, gains, judged), met, made),
        beside,
        met,
        short,
        int(np.count_nonzero(~judged.stable)),
        holds := bool(judged.stable.squeeze(0)[0]),
        _bands(design, loop) if responses and holds else (),
        problem.plants.omega_rad_s,
        curves,
    )


def _verdict(
    design: PidDesign,
    values: Mapping[str, float],
    held: GainSearchResult,
    met: NDArray[np.bool_],
    made: Sequence[WorstCase],
) -> Finding:
    """Of the design where its gains are these, else of gains by hand."""
    if values == design.gains:
        return next(each for each in design.findings if each.code in GAINS)
    known = bool(design.provenance.get("draws"))
    left = cast(int, design.provenance.get("left_out", 0))
    band = cast("tuple[float, float] | None", design.provenance.get("band_rad_s"))
    wider = wider_band(design.problem, held.gains, band)
    return verdict(
        held, met, len(met) + left if known else 0, made, band, wider, design.problem.rigid
    )


def _bands(design: PidDesign, loop: object) -> tuple[ResponseBand, ...]:
    """Time responses with the axis' loop put among the others."""
    closed = design.closed
    if closed is None:
        return ()
    loops = [loop if k == closed.place else each for k, each in enumerate(design.loops)]
    known = {each.name: each.flown for each in design.responses}
    if known:
        new = response_bands(closed, loops, None)  # type: ignore[arg-type]
        return tuple(replace(each, flown=known.get(each.name)) for each in new)
    steady = any(each.flown is not None for each in design.worst_cases)
    before = [design.flown if k == closed.place else each for k, each in enumerate(design.loops)]
    return response_bands(closed, loops, before if steady else None)  # type: ignore[arg-type]
