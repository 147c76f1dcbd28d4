"""What identified models promise of the loops that a log flew, in the numbers of a review."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.from_log import axis_loop_of
from flightid.control.tuning.evidence import gather
from flightid.control.tuning.responses import responses
from flightid.control.tuning.sampled_plants import sample_plants
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.errors import DataError
from flightid.logs import Log
from flightid.models.model import Model, model_of
from flightid.review.deconvolution import LoopDraws
from flightid.review.loop_response import LoopResponse
from flightid.review.loops import SLOWEST_HZ, WINDOW_S
from flightid.review.step_features import frequency_features, step_features

Array = NDArray[np.float64]
DRAWS = 40
SHOWN_S = 8.0
"""Of steps from which frequencies are read: slow integrators bring the last of a rate over seconds,
and what is cut off would be missing at low frequencies."""
RESPONSES = {"rate": "rate step", "attitude": "angle step"}


def promised_loops(sources: Iterable[object], log: Log) -> tuple[LoopResponse, ...]:
    """Closed loops of identified models under the gains that a log flew.

    Parameters
    ----------
    sources : iterable of Fit or model
        Rates over commands; a model from the file of a fit has its covariance.
    log : Log
        Whose gains are flown.

    Raises
    ------
    DataError
        No model has an axis whose loops the log tells.

    Notes
    -----
    Steps begin where the log has the set-point, which the rate loop of some autopilots takes a loop
    later. Angle loops where the set-point acts by the angle controller alone, without feed-forward
    of its rate. Axes of one model that couple are closed together. Intervals are of draws over the
    fit's covariance: what its data allow.

    Example
    -------
    >>> models = [fid.load_model("flight-output/models/roll.toml")]   # doctest: +SKIP
    >>> promised_loops(models, log)[0]["rise time"]                   # doctest: +SKIP
    Estimate(rise time = 0.084 (0.081 to 0.087) s)
    """
    found: dict[str, LoopResponse] = {}
    for source in sources:
        model = cast(Model, model_of(source))
        axes = [
            axis
            for axis, (command, rate) in CHANNELS.items()
            if command in model.inputs and rate in model.outputs
        ]
        if axes:
            loops = [axis_loop_of(log, axis) for axis in axes]
            for each in _promised(source, axes, loops):
                if each.loop == "rate" or _angle_alone(log, each.axis):
                    found.setdefault(each.name, each)
    if not found:
        raise DataError(
            "no model promises anything of these loops",
            needed="a model of a body rate over its command, as flightid run makes of a log",
        )
    return tuple(found.values())


def _angle_alone(log: Log, axis: str) -> bool:
    """Whether an angle's set-point acts by the angle controller alone, as the promise has it.

    Sticks ask for yaw rates. ArduPilot adds the set-point's own rate unless told not to, and PX4
    that of its reference model where it has one (MC_REF_FF).
    """
    fed = log.kind == "ardupilot" and log.parameters.get("ATC_RATE_FF_ENAB", 1.0) != 0.0
    return axis != "yaw" and not fed and log.parameters.get("MC_REF_FF", 0.0) <= 0.0


def _promised(source: object, axes: list[str], loops: list[AxisLoop]) -> list[LoopResponse]:
    step_s = 1.0 / loops[0].loop_rate_hz
    pairs = [CHANNELS[axis] for axis in axes]
    commands, rates = zip(*pairs, strict=True)
    evidence = gather(
        source, step_s, [f"{rate}/{command}" for command, rate in pairs],
        draws=DRAWS, fresh=1, seed=0, band_rad_s=None, verification=None, nominal=True,
        accept_red=True, needs_band=False,
    )  # fmt: skip
    plants = sample_plants(
        (evidence.estimate, *evidence.draws), rates, commands, step_s,
        hold_in_model=evidence.hold_in_model,
    )  # fmt: skip
    made = []
    for place, axis in enumerate(axes):
        told = responses(plants, loops, place, "filtered", shown_s=SHOWN_S)
        for loop, name in RESPONSES.items():
            if name in told:
                late = loops[place].set_point_delay_loops if loop == "rate" else 0
                steps = _later(told[name][1], late)
                made.append(_loop(axis, loop, steps, step_s, bool(evidence.draws)))
    return made


def _later(steps: Array, loops: int) -> Array:
    """The same by so many samples later."""
    return np.pad(steps, ((0, 0), (loops, 0)))[:, : steps.shape[1]]


def _loop(axis: str, loop: str, steps: Array, step_s: float, known: bool) -> LoopResponse:
    """Readings of steps at the loop's samples; one plant alone has no intervals."""
    shown = steps if known else np.repeat(steps[:1], 2, axis=0)
    pulses = np.diff(shown, axis=1, prepend=0.0)
    draws = LoopDraws(pulses, np.ones((len(pulses), 1)), step_s)
    by_frequency = frequency_features(draws, SLOWEST_HZ[loop])
    shown = shown[:, : round(4.0 * WINDOW_S[loop] / step_s)]
    time_s = np.arange(shown.shape[1], dtype=np.float64) * step_s
    readings = (*step_features(shown, time_s), *by_frequency)
    return LoopResponse(
        axis, loop, "identified model", "gains of the log", 1.0 / step_s, 0.0, 0, None, None,
        time_s, shown[0], shown[1:], readings,
    )  # fmt: skip
