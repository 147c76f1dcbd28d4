"""What was set otherwise in two flights: gains, filters, and what else their loops depend on."""

from __future__ import annotations

from collections.abc import Iterator

from flightid.review.result import FlightReview

MATERIAL_VOLTAGE = 1.2
"""Ratio of first voltages beyond which the batteries are not alike: a cell empties by a fifth."""


def filters_between(before: FlightReview, after: FlightReview) -> dict[str, tuple[str, str]]:
    """Settings in words of filters that differ between two flights; ``"off"`` where one has none.

    Empty where either log does not tell its filters.
    """
    if not (before.filters.axes and after.filters.axes):
        return {}
    old, new = (
        {stage.name: stage.settings for use in each.filters.axes for stage in use.stages}
        for each in (before, after)
    )
    pairs = {name: (old.get(name, "off"), new.get(name, "off")) for name in {**old, **new}}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def unlike_between(before: FlightReview, after: FlightReview) -> dict[str, tuple[str, str]]:
    """What differs between two flights, of what both logs tell, that their loops depend on."""
    old, new = (dict(_state(each)) for each in (before, after))
    found = {what: (old[what], new[what]) for what in old if new.get(what, old[what]) != old[what]}
    one, other = before.identity.battery, after.identity.battery
    if "battery cells" not in found and one is not None and other is not None:
        low, high = sorted((one.start_v, other.start_v))
        if high > MATERIAL_VOLTAGE * low:
            found["battery"] = f"{one.start_v:.3g} V", f"{other.start_v:.3g} V"
    return found


def _state(review: FlightReview) -> Iterator[tuple[str, str]]:
    battery = review.identity.battery
    cells = None if battery is None else battery.cells
    told = {
        "vehicle": " ".join(filter(None, (review.kind, review.vehicle))),
        "firmware": review.firmware,
        "frame": review.identity.frame,
        "battery cells": f"{cells}" if cells else "",
    }
    yield from ((what, value) for what, value in told.items() if value)


def gains_between(before: FlightReview, after: FlightReview) -> dict[str, tuple[float, float]]:
    """Flown gains that differ between two flights."""
    old, new = (
        {name: v for values in each.identity.gains.values() for name, v in values.items()}
        for each in (before, after)
    )
    return {name: (old[name], new[name]) for name in old if name in new and old[name] != new[name]}
