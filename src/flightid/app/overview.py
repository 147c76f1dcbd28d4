"""An inspection and a review, laid out for the page: one sentence, three cards, one time strip."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from flightid.app.schemas import (
    AxisCard,
    Light,
    Overview,
    ReviewPart,
    ShownFinding,
    StepCurve,
    StripBlock,
    StripEvent,
    StripLine,
)
from flightid.findings import FALL, FIRST, GRAVITY, Finding, in_order, urgency
from flightid.inspection import Inspection
from flightid.inspection.carried import carried_sentence
from flightid.inspection.usable_band import hertz_words
from flightid.logs import Log
from flightid.logs.first_fix import log_start
from flightid.review import FlightReview
from flightid.review.loop_response import LoopResponse
from flightid.review.step_features import BANDWIDTH
from flightid.review.tables import cell
from flightid.review.timeline import FlightTimeline, TimelineBlock
from flightid.study.settings import Settings
from flightid.uncertainty.estimate import Estimate, Reading

AXES = ("roll", "pitch", "yaw")
MOST_EVENTS = 500
READINGS = ("level", "rise time", "overshoot", "settling time", BANDWIDTH)
CALLED = {"level": "reaches"}
"""What people say of a reading."""
PLACES = {
    "airborne": "air",
    "excitation-found": "sid autotune chirp sweep steps",
    "tipped-over": "fall",
    "gap": "gap",
    "dropout": "gap",
}
"""Beginning of a finding's code, and the kinds of blocks that show it."""


def overview_of(
    log: Log,
    inspection: Inspection,
    timeline: FlightTimeline,
    missed: Sequence[Finding],
    settings: Settings | None,
) -> Overview:
    """Lay out what an inspection found.

    Parameters
    ----------
    log : Log
    inspection : Inspection
    timeline : FlightTimeline
    missed : sequence of Finding
        Why axes have no model.
    settings : Settings or None
        The study that the log asks for.
    """
    cards = [_card(axis, inspection, missed, settings) for axis in AXES]
    began = log_start(log)
    return Overview(
        name=inspection.name,
        vehicle=" ".join(filter(None, (inspection.kind, inspection.vehicle))),
        firmware=inspection.firmware,
        flown="" if began is None else f"{began:%Y-%m-%d %H:%M}",
        duration_s=inspection.duration_s,
        airborne=inspection.phases.airborne_words,
        light=light_of(inspection.verdict),
        sentence=carried_sentence(inspection),
        verdicts=_verdicts(inspection.findings, timeline.blocks),
        cards=cards,
        span_s=timeline.span_s,
        lines=[
            StripLine(
                name=line.name,
                label=line.label,
                unit=line.unit,
                low=_finite(line.low),
                high=_finite(line.high),
            )
            for line in timeline.lines
        ],
        blocks=[
            StripBlock(kind=b.kind, axis=b.axis, text=b.text, start_s=b.start_s, stop_s=b.stop_s)
            for b in timeline.blocks
        ],
        events=_events(log),
        has_study=settings is not None,
    )


def review_of(review: FlightReview) -> ReviewPart:
    """Lay out what a review adds: the steps of rate loops, and its verdicts."""
    told = [each for each in review.loops if each.loop == "rate" and each.is_told]
    untold = {
        each.axis: (each.reason, each.action)
        for each in review.loops
        if each.loop == "rate" and not each.is_told
    }
    return ReviewPart(
        light=light_of(review.verdict),
        steps=[step_curve(each) for each in told],
        verdicts=_verdicts(in_order(review.findings), ()),
        untold=untold,
    )


def light_of(light: object) -> Light:
    """A light as the page is told it."""
    return cast("Light", str(light))


def _card(
    axis: str, inspection: Inspection, missed: Sequence[Finding], settings: Settings | None
) -> AxisCard:
    band = next((each for each in inspection.bands if each.axis == axis), None)
    finding = next((f for f in inspection.findings if f.code == f"band-{axis}"), None)
    model = next((m for m in (settings.models if settings else ()) if m.axis == axis), None)
    fitted = None if model is None else model.band_rad_s
    if model is not None and fitted is not None:
        # The log's own band, which the study proposes: a hand may have changed that since.
        fitted = fitted if band is None or band.band_rad_s is None else band.band_rad_s
        light: Light = "green" if finding is None else light_of(finding.light)
        coherence = None if band is None or band.coherence is None else band.coherence
        said = "" if coherence is None else f"Mean coherence {coherence:.2f}"
        swept = [each for each in inspection.excitations if each.axis == axis]
        told = "; ".join(dict.fromkeys(f"{each.words}: {each.detail}" for each in swept))
        return AxisCard(
            axis=axis,
            kind="model",
            light=light,
            headline=f"Can be identified {hertz_words(fitted)}",
            detail=". ".join(f"{each[0].upper()}{each[1:]}" for each in (said, told) if each),
            action="" if finding is None else finding.action,
            model=model.name,
            band_rad_s=fitted,
            coherence=coherence,
        )
    why = next((f for f in missed if f.message.startswith(f"{axis}:")), None)
    reason = "" if band is None else band.reason
    said = reason if why is None else why.message.partition("no model, ")[2]
    # No sweep is advised of a vehicle that fell: what made it fall is still there.
    before = next((f for f in inspection.findings if f.code in FIRST), None)
    action = next((f.action for f in (before, why, finding) if f is not None and f.action), "")
    return AxisCard(
        axis=axis,
        kind="nothing",
        light="red",
        headline="No model from this log",
        detail=said or "its command or its rate is not logged",
        action=action,
        first=before is not None,
    )


def _verdicts(findings: Iterable[Finding], blocks: Iterable[TimelineBlock]) -> list[ShownFinding]:
    findings = tuple(findings)
    listed, given = list(blocks), set[str]()
    fallen = any(each.code == FALL for each in findings)
    made = []
    for finding in findings:
        action = "" if finding.action in given else finding.action
        given.add(finding.action)
        made.append(
            ShownFinding(
                code=finding.code,
                light=light_of(finding.light),
                message=finding.message,
                action=action,
                spans_s=[(b.start_s, b.stop_s) for b in listed if _shows(b, finding.code)][:50],
                first=finding.code in FIRST,
                rank=_rank(finding, fallen),
            )
        )
    return made


def _rank(finding: Finding, fallen: bool) -> int:
    """Place among the verdicts of a flight, whoever tells them: the lower, the earlier."""
    group, gravity = urgency(finding, fallen)
    return group * len(GRAVITY) + gravity


def _shows(block: TimelineBlock, code: str) -> bool:
    """Whether a block is where a finding points."""
    axis = code.rpartition("-")[2]
    if axis in AXES and code.startswith("band"):
        return block.axis == axis
    if code.startswith("saturated"):
        return block.kind == "limit" and block.axis == (axis if axis in AXES else "")
    kinds = next((kinds for start, kinds in PLACES.items() if code.startswith(start)), "")
    return block.kind in kinds.split()


def step_curve(loop: LoopResponse) -> StepCurve:
    """A step of a loop as the page is told it."""
    low, high = loop.band()
    known = {each.name: _reading(each) for each in loop.readings}
    return StepCurve(
        axis=loop.axis,
        loop=loop.loop,
        time_s=loop.time_s.tolist(),
        step=loop.step.tolist(),
        low=low.tolist(),
        high=high.tolist(),
        readings=[(CALLED.get(name, name), known[name]) for name in READINGS if name in known],
    )


def _reading(reading: Reading | Estimate) -> str:
    """A number of a step with its interval and unit, to three digits."""
    said = cell(reading)
    if said is None:
        return reading.text
    return said if reading.unit in ("", "1") else f"{said} {reading.unit}"


def _events(log: Log) -> list[StripEvent]:
    kinds = ("error", "event", "arming", "text")
    told = [
        StripEvent(time_s=each.time_s, kind=each.kind, text=each.text[:200])
        for each in log.events
        if each.time_s is not None and each.kind in kinds
    ]
    changed = [
        StripEvent(time_s=each.time_s, kind="parameter", text=f"{each.name} = {each.new:g}")
        for each in log.parameter_changes
        if each.time_s is not None and each.old != each.new
    ]
    return sorted([*told, *changed], key=lambda each: each.time_s)[:MOST_EVENTS]


def _finite(values: NDArray[np.float64]) -> list[float | None]:
    return [float(f"{each:.6g}") if math.isfinite(each) else None for each in values.tolist()]


def shown_finding(finding: Finding) -> ShownFinding:
    """A finding as the page is told it."""
    return ShownFinding(
        code=finding.code,
        light=light_of(finding.light),
        message=finding.message,
        action=finding.action,
        spans_s=[],
    )
