"""What the flight in a log forbids, or asks to be looked at, before anything is flown after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.signals import find
from flightid.logs import Log
from flightid.planning.axis_guess import CHANNELS

if TYPE_CHECKING:
    from flightid.planning.result import AxisSweep

LARGEST_TRIM = 0.05
"""Mean command, share of full, that an integrator may hold unsaid."""


def flight_findings(
    log: Log | None, phases: FlightPhases | None, sweeps: Iterable[AxisSweep], assumed_hz: float
) -> list[Finding]:
    """A fall, a rate that nobody told, and trims that integrators held.

    Parameters
    ----------
    log : Log, optional
    phases : FlightPhases, optional
    sweeps : iterable of AxisSweep
    assumed_hz : float
        Rate of the controller that stands in for an unknown one, Hz; 0 where it is known.
    """
    if log is None or phases is None:
        return []
    found = []
    if phases.tipped_s is not None:
        found.append(
            Finding(
                "tipped-over",
                Light.RED,
                f"{phases.fall}: what made it fall is still there",
                "find the cause and fly an ordinary flight first, then plan from that log",
            )
        )
    if assumed_hz:
        found.append(
            Finding(
                "loop-rate-typical",
                Light.AMBER,
                f"the log does not tell the rate of the controller: {assumed_hz:g} Hz stands for "
                "it",
                "say it: loop_rate_hz=…",
            )
        )
    return [*found, *_trims(log, phases, sweeps)]


def _trims(log: Log, phases: FlightPhases, sweeps: Iterable[AxisSweep]) -> Iterator[Finding]:
    """What sets I to zero lets go of what the integrator held: about the mean command."""
    for each in sweeps:
        let_go = [c.name for c in each.changes if c.name.endswith("_I") and c.value == 0.0]
        command = find(log, CHANNELS[each.axis][0])
        held = np.zeros(0) if command is None else command.within(phases.airborne)
        if not let_go or not held.size or abs(float(np.mean(held))) < LARGEST_TRIM:
            continue
        yield Finding(
            "trim-let-go",
            Light.AMBER,
            f"{each.axis}: the sweep is flown with {let_go[0]} 0, and the integrator held "
            f"{100.0 * np.mean(held):+.0f} % of full command in this flight: without it the "
            "vehicle turns as the sweep begins",
            "take the trim out first (motors, frame, centre of gravity), or hold it by stick",
        )
