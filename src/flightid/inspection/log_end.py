"""What it costs that a log was not ended by its writer: a flight, where it ends while one lasts.

One rule for all formats: a battery that is pulled on the ground ends nearly every log inside a
message, and takes nothing of the flight before with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.flight_phases import FlightPhases, landing_detector
from flightid.inspection.stamps import log_span
from flightid.inspection.usable_band import UNSWEPT_CODE
from flightid.logs import Log
from flightid.logs.log_cut import LOG_CUT

LONGEST_DIVE_S = 5.0
"""Throttle that is low for longer at the end of a log stands on the ground, s."""
AGAIN = "copy the log from the card again; what came before is read"


def end_judged(
    log: Log, phases: FlightPhases, findings: Iterable[Finding], until_s: float = math.inf
) -> tuple[Finding, ...]:
    """Findings of a log's reader, with what a cut end costs.

    Parameters
    ----------
    log : Log
    phases : FlightPhases
        Of the whole log.
    findings : iterable of Finding
        What its reader noticed.
    until_s : float
        End of the part that is looked at, s on the autopilot's clock.

    Returns
    -------
    tuple of Finding
        A cut is amber where the vehicle flew when the log ended. It has no light where the flight
        was over, or nothing tells whether there was one.
    """
    return tuple(
        _judged(log, phases, each, until_s) if each.code == LOG_CUT else each for each in findings
    )


def is_aside(finding: Finding) -> bool:
    """Whether a finding says nothing for or against the rest of its log.

    An axis that nobody swept leaves the others as they are; a cut after the flight leaves it whole.
    """
    cut_after = finding.code == LOG_CUT and finding.light is Light.UNKNOWN
    return cut_after or finding.code.startswith(UNSWEPT_CODE)


def _judged(log: Log, phases: FlightPhases, cut: Finding, until_s: float) -> Finding:
    end_s = log_span(log)[1]
    if until_s < end_s:
        return replace(cut, message=f"{cut.message}, {_late(end_s, until_s)} the part in question")
    since_s, what = _ground(log, phases, end_s)
    if since_s is not None:
        said = f"{cut.message}, {_late(end_s, since_s)} {what}: that flight is whole"
        return replace(cut, message=said if phases.airborne else said.rpartition(":")[0])
    if not phases.airborne:
        # What says so of the flight has a light of its own.
        said = f"{cut.message}: whether a flight was to come is not told"
        return replace(cut, message=said, action=AGAIN)
    said = f"{cut.message} while the vehicle flies: the rest of that flight is lost"
    return replace(cut, light=Light.AMBER, message=said, action=AGAIN)


def _late(end_s: float, since_s: float) -> str:
    return f"{max(end_s - since_s, 0.0):.1f} s after"


def _ground(log: Log, phases: FlightPhases, end_s: float) -> tuple[float | None, str]:
    """Since when the vehicle stays on the ground as the log ends, and by what; None: it may fly."""
    arming = [e for e in log.events if e.kind == "arming" and e.time_s is not None]
    if arming and arming[-1].text.startswith("disarmed"):
        return arming[-1].time_s, "the vehicle was disarmed"
    if not phases.airborne:
        return None, ""
    if phases.tipped_s is not None:
        return phases.tipped_s, "the vehicle fell over"
    told = landing_detector(log)
    last_s = phases.airborne[-1][1]
    # A dive leaves the throttle low, but not for long; where the autopilot tells, it knows better.
    if (told is not None and told[1][-1]) or end_s - last_s <= LONGEST_DIVE_S:
        return None, ""
    return last_s, "it was last in the air"
