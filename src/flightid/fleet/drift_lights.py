"""Verdicts on what a type's histories rest on: errors of estimates, and what all vehicles share."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.fleet.statistics.drift import FleetDrift
from flightid.fleet.statistics.flight_errors import NOTABLE, ErrorScale
from flightid.fleet.statistics.repeats import RepeatScatter
from flightid.uncertainty.quantiles import shown

TWICE = "fly some vehicles twice a day: that tells errors from flights that differ"


def estimate_lights(drift: FleetDrift, labels: Mapping[str, str]) -> tuple[Finding, ...]:
    """All verdicts on errors of the estimates."""
    return (
        *errors_lights(drift, labels),
        *scale_lights(drift, labels),
        *persistent_lights(drift, labels),
    )


def errors_lights(drift: FleetDrift, labels: Mapping[str, str]) -> tuple[Finding, ...]:
    """Whether errors of each parameter hold, and what they were taken for."""
    return tuple(
        _errors_light(each, drift.errors[each.name], labels.get(each.name, each.name))
        for each in drift.repeats
    )


def shared_lights(drift: FleetDrift, labels: Mapping[str, str]) -> tuple[Finding, ...]:
    """What all vehicles of the type did together: of none by itself."""
    act = (
        "look for what all share: air, season, firmware; vehicles are held beside the others of "
        "their days"
    )
    few = (
        "look for what all share: air, season, firmware; flights of another vehicle of the type, "
        "from before and after, decide: it stayed, and each changed, or it moved, and the type did"
    )
    return (
        *(
            Finding("shared-change", Light.AMBER, each.words(labels, drift.apart(each)), act)
            for each in drift.shared
        ),
        *(Finding("moved-alike", Light.AMBER, each.words(labels), few) for each in drift.alike),
    )


def scale_lights(drift: FleetDrift, labels: Mapping[str, str]) -> tuple[Finding, ...]:
    """Vehicles whose own flights scatter further than those of the others."""
    act = "look for what differs between its flights, and fly it twice on a day"
    return tuple(
        Finding("vehicle-errors", Light.AMBER, each.words(labels), act)
        for each in drift.scales
        if each.is_sure
    )


def persistent_lights(drift: FleetDrift, labels: Mapping[str, str]) -> tuple[Finding, ...]:
    """Parameters whose flights go on as their neighbours did."""
    act = "look for what lasts for days: air, battery, payload; name it in [questions] covariates"
    return tuple(
        Finding("days-go-on", Light.AMBER, each.words(labels.get(name, name)), act)
        for name, each in drift.persistent.items()
    )


def _errors_light(scatter: RepeatScatter, errors: ErrorScale, name: str) -> Finding:
    ends = scatter.understated_ends(shown())
    if ends is None:
        words = f"{name}: no vehicle flew twice on a day; {errors.words()}"
        light = Light.AMBER if errors.typical >= NOTABLE else Light.UNKNOWN
        return Finding("repeats", light, words, TWICE)
    words = (
        f"{name}: flights of one day scatter {scatter.understated:.2f} times their errors "
        f"({ends[0]:.2f} to {ends[1]:.2f}; χ² {scatter.chi2:.0f} of {scatter.freedom})"
    )
    words += errors.days_words()
    if scatter.errors_hold and errors.typical < NOTABLE:
        return Finding("repeats", Light.GREEN, words)
    act = f"errors count {errors.typical:.2f} times as stated before anything is called a change"
    return Finding("repeats", Light.AMBER, words, act)
