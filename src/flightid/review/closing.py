"""The end of a flight's review: which steps it tells, and the command that goes on from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from flightid.conventions import Light
from flightid.findings import CAUSES, DIVERGES, Finding
from flightid.inspection.flight_phases import FlightPhases
from flightid.review.loop_response import LoopResponse
from flightid.surface import spoken

AMISS = (Light.AMBER, Light.RED)
SHAKEN = ("vibration", "accelerometer-clips")
"""Beginnings of codes that tell of vibration; the other causes are motors."""
PLANNED = ("copter", "plane")
"""Vehicles of ArduPilot for which sweeps can be planned."""


class ReviewedFlight(Protocol):
    """What is asked of a `FlightReview`."""

    @property
    def name(self) -> str:
        """File of its log."""
        ...

    @property
    def kind(self) -> str:
        """Who wrote it."""
        ...

    @property
    def vehicle(self) -> str | None:
        """Kind of vehicle."""
        ...

    @property
    def phases(self) -> FlightPhases:
        """Airborne spans."""
        ...

    @property
    def loops(self) -> tuple[LoopResponse, ...]:
        """Loops of each axis."""
        ...

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts."""
        ...

    @property
    def swept(self) -> bool:
        """Whether the autopilot flew sweeps."""
        ...

    @property
    def carried(self) -> tuple[str, ...]:
        """Axes whose sweeps carry a model."""
        ...


def closing_lines(review: ReviewedFlight) -> Iterator[str]:
    """Sentences that end a review: a fall first, steps of the loops, what is next.

    Parameters
    ----------
    review : FlightReview
        Of which the verdicts are made.
    """
    phases = review.phases
    if phases.is_known and not phases.airborne:
        yield "This log holds no flight, so it tells nothing of the vehicle in the air."
        return
    if not phases.is_known and not review.loops:
        yield f"This log does not tell whether it flew: {phases.evidence}."
        return
    if phases.fall:
        yield f"{phases.fall[0].upper()}{phases.fall[1:]}."
    if growing := _diverging(review):
        yield f"It diverges in {_listed(growing)}: do not fly these settings again."
    yield _told(review)
    if way := _next(review):
        yield spoken(f"Next: {way}.")


def _told(review: ReviewedFlight) -> str:
    """Loops whose steps are told, by how they are judged, and those whose steps are not."""
    if not review.loops:
        return "This flight tells no step: no loop is logged."
    lights = {each.code: each.light for each in review.findings}
    groups: dict[Light, list[str]] = {}
    for loop in review.loops:
        if loop.is_told:
            light = lights.get(f"step-{loop.axis}-{loop.loop}", Light.UNKNOWN)
            groups.setdefault(light, []).append(loop.name)
    words = {
        Light.GREEN: "nothing is against {0}",
        Light.AMBER: "{0} {1} in doubt",
        Light.UNKNOWN: "{0} {1} not judged",
    }
    parts = [
        said.format(_listed(groups[light]), "is" if len(groups[light]) == 1 else "are")
        for light, said in words.items()
        if light in groups
    ]
    count = sum(map(len, groups.values()))
    if not count:
        loops = "one loop" if len(review.loops) == 1 else f"{len(review.loops)} loops"
        return f"This flight tells no step of its {loops}."
    if len(groups.get(Light.GREEN, ())) == len(review.loops):
        return f"This flight tells the steps of all {count} loops, with nothing against any."
    return (
        f"This flight tells the steps of {count} of {len(review.loops)} loops: {'; '.join(parts)}."
    )


def _diverging(review: ReviewedFlight) -> list[str]:
    """Axes that grow until the flight ends."""
    codes = (each.code for each in review.findings)
    return [code.rsplit("-", 1)[1] for code in codes if code.startswith(DIVERGES)]


def _next(review: ReviewedFlight) -> str:
    """What goes on from here: the cause of a fall, sweeps that were flown, or sweeps to fly."""
    if review.phases.fall:
        return "find the cause of the fall; sweeps, filters and gains come after it"
    if _diverging(review):
        return "mend what diverges; sweeps, filters and gains come after it"
    if review.carried:
        return f"flightid tune {review.name} (models of its sweeps, then gains)"
    if review.swept:
        why = f"flightid inspect {review.name} (why its sweeps carry no model)"
        planned = f", then flightid plan {review.name} (amplitude, band and axis of better ones)"
        return why + (planned if _plannable(review) else "")
    amiss = [f.code for f in review.findings if f.light in AMISS and f.code.startswith(CAUSES)]
    shaken = [code for code in amiss if code.startswith(SHAKEN)]
    parts = ["motors"] * (len(amiss) > len(shaken)) + ["vibration"] * bool(shaken)
    way = f"mend what is said of {' and '.join(parts)} first" if parts else ""
    if _plannable(review):
        planned = f"flightid plan {review.name} (sweeps to fly, for models and gains)"
        way = "; then ".join(filter(None, (way, planned)))
    return way


def _plannable(review: ReviewedFlight) -> bool:
    return review.kind != "ardupilot" or review.vehicle in PLANNED


def _listed(names: list[str]) -> str:
    """Names in a sentence.

    Example
    -------
    >>> _listed(["roll rate", "yaw rate", "yaw attitude"])
    'roll rate, yaw rate and yaw attitude'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
