"""What was set otherwise in two flights: gains and filters."""

from __future__ import annotations

from flightid.review.result import FlightReview


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


def gains_between(before: FlightReview, after: FlightReview) -> dict[str, tuple[float, float]]:
    """Flown gains that differ between two flights."""
    old, new = (
        {name: v for values in each.identity.gains.values() for name, v in values.items()}
        for each in (before, after)
    )
    return {name: (old[name], new[name]) for name in old if name in new and old[name] != new[name]}
