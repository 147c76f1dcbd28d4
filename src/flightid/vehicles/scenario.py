"""Flights worth simulating: the published rig study, and the same rig flown as we advise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from flightid.errors import OptionError
from flightid.vehicles.autopilot import Autopilot, PilotDoublet, RateGains, SidActivation
from flightid.vehicles.flight import Flight, fly
from flightid.vehicles.quadrotor import QuadrotorParameters, Sensors, Turbulence

Group = TypeVar("Group", QuadrotorParameters, Autopilot, Sensors, Turbulence)
SCENARIOS = ("advised", "published")
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


def fly_scenario(
    scenario: str = "advised", *, seed: int = 0, **changes: Mapping[str, Any]
) -> Flight:
    """Fly the rig: sweeps of the three axes, then doublets for verification.

    Parameters
    ----------
    scenario : {"advised", "published"}
        Sweep settings: ours, or those of the published rig study.
    seed : int
        Seed of all noise.
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
    runs = advised_runs() if scenario == "advised" else published_runs()
    return fly(
        runs=runs,
        doublets=verification_doublets(runs[-1].end_s + 5.0),
        vehicle=_changed(QuadrotorParameters(), changes.get("vehicle", {})),
        autopilot=_changed(Autopilot(), changes.get("autopilot", {})),
        sensors=_changed(Sensors(), changes.get("sensors", {})),
        turbulence=_changed(Turbulence(), changes.get("turbulence", {})),
        seed=seed,
    )


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
