"""Gaps of a stream judged by where they lie: in flight they cost data, between flights nothing."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.inspection.advice import logging
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.rates import StreamRate, stream_gaps
from flightid.inspection.signals import Span
from flightid.inspection.stamps import believed
from flightid.logs import Log
from flightid.logs.blackbox.firmware import BETAFLIGHT, BLACKBOX

NEAR_S = 1.0
"""A flight that ends so shortly before a gap and one that begins so shortly after it are one."""


def gap_findings(log: Log, rate: StreamRate, phases: FlightPhases) -> list[Finding]:
    """What the gaps of one stream cost; an autopilot that logs while armed pauses between arms."""
    gaps = stream_gaps(believed(log.table(rate.message, rate.instance).time_s))
    armed = [e.time_s for e in log.events if e.kind == "arming" and e.time_s is not None]
    flown = [gap for gap in gaps if not phases.is_known or _in_flight(gap, phases.airborne, armed)]
    findings = []
    if flown:
        where = " in flight" if phases.is_known else ""
        findings.append(
            Finding(
                "gaps",
                Light.AMBER,
                f"{rate.label} has {counted(len(flown), 'gap')}{where}, the longest "
                f"{_longest(flown):.3g} s (median interval {1e3 / rate.rate_hz:.3g} ms)",
                f"{_remedy(log, flown)}; records are cut at gaps",
            )
        )
    if paused := [gap for gap in gaps if gap not in flown]:
        findings.append(
            Finding(
                "pauses",
                Light.GREEN,
                f"{rate.label} pauses {counted(len(paused), 'time')} outside of flight, "
                f"{_longest(paused):.3g} s at most: that costs no data",
            )
        )
    return findings


def _remedy(log: Log, gaps: list[Span]) -> str:
    """What to do about gaps: a card loses samples only where the logger counted them."""
    dropouts = [gap for gap in log.gaps if log.kind == "px4" and gap.duration_s > 0]
    lost = any(d.start_s < stop and d.stop_s > start for d in dropouts for start, stop in gaps)
    if log.kind in BLACKBOX:
        setting = "blackbox_sample_rate" if log.kind == BETAFLIGHT else "blackbox_rate_denom"
        return f"log at a lower rate ({setting}), or to a faster card"
    if lost or any(finding.code == "messages-dropped" for finding in log.findings):
        return "the logger itself counted lost samples: use a faster card, or log less"
    if log.kind == "px4" or "DSF" in log:
        return (
            f"{logging(log)}: the logger counts no lost samples there, so that no card is to blame"
        )
    return "the log does not tell whether the card or the autopilot left them out"


def _longest(gaps: list[Span]) -> float:
    return max(stop - start for start, stop in gaps)


def _in_flight(gap: Span, airborne: tuple[Span, ...], armed: list[float]) -> bool:
    if any(start < gap[1] and stop > gap[0] for start, stop in airborne):
        return True
    before = any(0.0 <= gap[0] - stop <= NEAR_S for _, stop in airborne)
    after = any(0.0 <= start - gap[1] <= NEAR_S for start, _ in airborne)
    return before and after and not any(gap[0] <= time_s <= gap[1] for time_s in armed)
