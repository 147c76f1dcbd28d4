"""Flights worth simulating: the published rig study, the rig as we advise, and sticks alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from flightid.errors import OptionError
from flightid.vehicles.autopilot import Autopilot, PilotDoublet, RateGains, SidActivation
from flightid.vehicles.flight import Flight, fly
from flightid.vehicles.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.vehicles.truth import AXES

Group = TypeVar("Group", QuadrotorParameters, Autopilot, Sensors, Turbulence)
SCENARIOS = ("advised", "published", "sticks")
STICK_RAD, STICK_YAW_RAD_S = 0.2, 0.8
"""Largest move of a stick at once: angle of roll and pitch, rate of yaw."""
MINUTE_S, FIRST_MOVE_S, BETWEEN_AXES_S = 60.0, 5.0, 5.0
WIDTHS_S, PAUSES_S = (0.25, 0.8), (0.3, 0.8)
"""Of half a move to and fro, and of the rest behind it: about one move a second."""
GROUPS = ("vehicle", "autopilot", "sensors", "turbulence")


def advised_runs() -> tuple[SidActivation, ...]:
    """Mixer sweeps of roll, pitch and yaw as we advise: 0.1–12 Hz, so that motors show themselves.

    The published settings end at 5 Hz, fade out from 3.9 Hz, and spend 40 of 130 s at 0.05 Hz where
    the attitude loop undoes them. The pilot leaves the mode twenty seconds after the chirp: windows
    then cover its end as they cover its middle.

    Example
    -------
    >>> [run.axis for run in advised_runs()]
    [10, 11, 12]
    """
    runs = []
    for number, (axis, magnitude) in enumerate(((10, 0.15), (11, 0.15), (12, 0.15))):
        runs.append(
            SidActivation(
                axis=axis,
                start_s=5.0 + 130.0 * number,
                magnitude=magnitude,
                start_hz=0.1,
                stop_hz=12.0,
                fade_in_s=5.0,
                record_s=100.0,
                fade_out_s=1.0,
                leave_after_s=125.0,
            )
        )
    return tuple(runs)


def published_runs() -> tuple[SidActivation, ...]:
    """Mixer sweeps of the published rig study (its table 2): 0.05–5 Hz in 130 s, yaw at 0.55.

    Example
    -------
    >>> published_runs()[2].magnitude
    0.55
    """
    first = SidActivation(axis=10, start_s=5.0)
    gap_s = first.duration_s + 10.0
    return (
        first,
        replace(first, axis=11, start_s=5.0 + gap_s),
        replace(first, axis=12, start_s=5.0 + 2 * gap_s, magnitude=0.55),
    )


def verification_doublets(start_s: float) -> tuple[PilotDoublet, ...]:
    """Pilot doublets on the three axes, for segments that no fit sees.

    Example
    -------
    >>> [move.start_s for move in verification_doublets(100.0)]
    [102.0, 108.0, 114.0]
    """
    amplitudes = (("roll", 0.20), ("pitch", 0.20), ("yaw", 0.60))
    return tuple(
        PilotDoublet(axis, start_s + 2.0 + 6.0 * number, amplitude)  # type: ignore[arg-type]
        for number, (axis, amplitude) in enumerate(amplitudes)
    )


def stick_moves(largest_rad: float = STICK_RAD, *, seed: int = 0) -> tuple[PilotDoublet, ...]:
    """A minute of quick moves of each stick, to and fro by chance: what an ordinary flight holds.

    Parameters
    ----------
    largest_rad : float
        Most that roll or pitch is asked to move at once, rad.
    seed : int
        Of sizes and times.

    Example
    -------
    >>> moves = stick_moves(0.1)
    >>> max(2.0 * abs(move.amplitude) for move in moves if move.axis == "roll") <= 0.1
    True
    """
    drawn = np.random.default_rng(seed)
    moves: list[PilotDoublet] = []
    time_s = FIRST_MOVE_S
    for axis in AXES:
        # Halfway a doublet jumps by twice its amplitude.
        largest = STICK_YAW_RAD_S if axis == "yaw" else 0.5 * largest_rad
        end_s = time_s + MINUTE_S
        while time_s < end_s:
            size = float(largest * drawn.uniform(0.5, 1.0) * drawn.choice((-1.0, 1.0)))
            move = PilotDoublet(axis, time_s, size, float(drawn.uniform(*WIDTHS_S)))
            moves.append(move)
            time_s = move.end_s + float(drawn.uniform(*PAUSES_S))
        time_s += BETWEEN_AXES_S
    return tuple(moves)


def fly_scenario(
    scenario: str = "advised",
    *,
    seed: int = 0,
    stick_rad: float | None = None,
    **changes: Mapping[str, Any],
) -> Flight:
    """Fly the rig: sweeps of the three axes and doublets for verification, or sticks alone.

    Parameters
    ----------
    scenario : {"advised", "published", "sticks"}
        Sweep settings, ours or those of the published rig study; or an ordinary flight: a minute of
        quick moves of each stick.
    seed : int
        Seed of all noise.
    stick_rad : float, optional
        Of sticks: most that roll or pitch is asked to move at once; default: 0.2 rad.
    **changes : mapping
        Groups ``vehicle``, ``autopilot``, ``sensors``, ``turbulence``, each with the fields that
        differ from the default.

    Raises
    ------
    OptionError
        No such scenario, group or field.

    Reference
    ---------
    Khudairi et al., gyroscopic rig study, table 2.

    Example
    -------
    >>> fly_scenario("advised", seed=3, turbulence={"rate_rad_s": 0.1})
    Flight(415.6 s at 400 Hz, 3 sweeps, 3 doublets, seed 3)
    """
    if scenario not in SCENARIOS:
        raise OptionError("scenario is not known", found=scenario, needed=f"one of {SCENARIOS}")
    for group in changes:
        if group not in GROUPS:
            raise OptionError("setting is not known", found=group, needed=f"one of {GROUPS}")
    runs, doublets = _flown(scenario, stick_rad, seed)
    return fly(
        runs=runs,
        doublets=doublets,
        vehicle=_changed(QuadrotorParameters(), changes.get("vehicle", {})),
        autopilot=_changed(Autopilot(), changes.get("autopilot", {})),
        sensors=_changed(Sensors(), changes.get("sensors", {})),
        turbulence=_changed(Turbulence(), changes.get("turbulence", {})),
        seed=seed,
    )


def _flown(
    scenario: str, stick_rad: float | None, seed: int
) -> tuple[tuple[SidActivation, ...], tuple[PilotDoublet, ...]]:
    """Sweeps and stick moves of a scenario."""
    if scenario == "sticks":
        largest = STICK_RAD if stick_rad is None else stick_rad
        if not (math.isfinite(largest) and largest > 0.0):
            raise OptionError("the size of stick moves", found=largest, needed="above 0 rad")
        return (), stick_moves(largest, seed=seed)
    if stick_rad is not None:
        raise OptionError(
            "sweeps are flown without sticks", found=f"sticks of {stick_rad:g} rad",
            needed="the scenario sticks",
        )  # fmt: skip
    runs = advised_runs() if scenario == "advised" else published_runs()
    return runs, verification_doublets(runs[-1].end_s + 5.0)


def _changed(group: Group, values: Mapping[str, Any]) -> Group:
    known = {field.name for field in fields(group)}
    for name in values:
        if name not in known:
            raise OptionError(
                f"{type(group).__name__} has no such field", found=name, needed=sorted(known)
            )
    settled: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
    }
    if "rate" in settled:
        settled["rate"] = tuple(
            gains if isinstance(gains, RateGains) else RateGains(**gains)
            for gains in settled["rate"]
        )
    return replace(group, **settled)
