"""The verb: what changed between two flights, or whether one keeps what models promised of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flightid.logs import Log, read_log
from flightid.review.apart import filters_between, gains_between
from flightid.review.comparison import FlightComparison, compare_loops
from flightid.review.flight import review_flight
from flightid.review.flight_state import FlightState
from flightid.review.promised import promised_loops
from flightid.review.result import FlightReview
from flightid.review.verdicts import loops_in_doubt
from flightid.threads import on_one_thread

Flown = FlightReview | Log | str | Path


@on_one_thread
def compare_flights(
    before: Flown, after: Flown, *, promise: FlightComparison | None = None
) -> FlightComparison:
    """Say what changed between two flights, or parts of one: steps, bandwidths, tracking, gains.

    Parameters
    ----------
    before, after : FlightReview, Log or path-like
        Reviews may be of parts: ``review_flight(log, span_s=(20.0, 80.0))``.
    promise : FlightComparison, optional
        `compare_with_promise` of the second: what got worse as models promised of its gains is no
        reason to go back.

    Raises
    ------
    DataError
        There is no loop whose step both tell.

    Assumes
    -------
    Flights of the same vehicle in like air, whose errors are independent. A change is called one by
    Holm's rule: one false verdict in 5 % of comparisons.

    Reference
    ---------
    Zou & Donner, *Statistics in Medicine* 27 (2008), for intervals of differences; see
    `review_flight`.

    Example
    -------
    >>> print(fid.compare_flights("before.BIN", "after.BIN").summary())   # doctest: +SKIP
    """
    first, second = _review(before), _review(after)
    names = first.name, second.name
    if names[0] == names[1]:
        names = f"{names[0]}, before", f"{names[1]}, after"
    return compare_loops(
        first.loops,
        second.loops,
        names,
        gains=gains_between(first, second),
        filters=filters_between(first, second),
        unlike=FlightState.of(first).unlike(FlightState.of(second)),
        promised=False,
        promise=promise,
        limits=(*loops_in_doubt(first), *loops_in_doubt(second)),
    )


@on_one_thread
def compare_with_promise(
    sources: Iterable[object],
    after: Log | str | Path,
    *,
    review: FlightReview | None = None,
    state: FlightState | None = None,
) -> FlightComparison:
    """Say whether a flight keeps what identified models promise of the gains that it flew.

    Parameters
    ----------
    sources : iterable of Fit or model
        Identified from an earlier flight of this vehicle.
    after : Log or path-like
        The flight with new gains.
    review : FlightReview, optional
        Of that flight, where it has been reviewed.
    state : FlightState, optional
        Of the flight that the models were identified from: what differs is said, and of another
        vehicle nothing is praised.

    Raises
    ------
    DataError
        The models promise nothing of loops that the flight tells.

    Reference
    ---------
    As `compare_flights`; steps of sampled loops as `flightid.tune` shows them.

    Example
    -------
    >>> models = [fid.load_model("flight-output/models/roll.toml")]      # doctest: +SKIP
    >>> print(fid.compare_with_promise(models, "after.BIN").summary())   # doctest: +SKIP
    """
    log = after if isinstance(after, Log) else read_log(after)
    names = "the models", log.path.name
    promise = promised_loops(sources, log)
    flown = review or review_flight(log)
    now = FlightState.of(flown)
    known = now if state is None else state
    return compare_loops(
        promise,
        flown.loops,
        names,
        filters=known.other_filters(now),
        unlike=known.unlike(now),
        promised=True,
        limits=loops_in_doubt(flown),
    )


def _review(flown: Flown) -> FlightReview:
    return flown if isinstance(flown, FlightReview) else review_flight(flown)
