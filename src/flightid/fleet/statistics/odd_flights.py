"""Flights far off those beside them, which do not count in what a type has in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flightid.fleet.statistics.days import shared_by_day
from flightid.fleet.statistics.events import FleetEvent, without_events
from flightid.fleet.statistics.flight_errors import error_scale
from flightid.fleet.statistics.flight_estimates import Flags, FlightEstimates
from flightid.fleet.statistics.neighbours import variances_with_odd_ones

MOST_ODD = 0.25
"""Share of a vehicle's flights, above which they differ and none is odd: two of two are."""


def without_odd_flights(
    data: FlightEstimates, events: Sequence[FleetEvent] = ()
) -> tuple[FlightEstimates, dict[str, tuple[str, ...]]]:
    """Estimates without odd flights, parameter by parameter, and which these are.

    One flight whose fit went astray would else spread a whole type, in which every vehicle then
    looks alike.

    Parameters
    ----------
    data : FlightEstimates
        Flights of one type; without dates they are taken in the order in which they stand.
    events : sequence of FleetEvent
        What was done to vehicles: a flight behind one is not odd for the step that it made.

    Returns
    -------
    data : FlightEstimates
    odd : dict of str to tuple of str
        Parameters that have any, and their flights.

    Notes
    -----
    Odd is what `variances_with_odd_ones` calls so, beside the errors of `error_scale` and what days
    differ by, of a quarter of a vehicle's flights at most: with fewer than four flights a wild
    estimate stands.
    """
    known, odd = data.known.copy(), dict[str, tuple[str, ...]]()
    for i, name in enumerate(data.names):
        stated = np.where(data.known[:, i], data.covariances[:, i, i], 1.0)
        usual = error_scale(data, i, None).variances(stated)
        level = without_events(data, i, usual, events) if events else data
        usual = usual + shared_by_day(level, i, usual, events).variances
        _, off = variances_with_odd_ones(level, i, usual)
        off &= _few_of_vehicle(data, i, off)
        if off.any():
            known[off, i] = False
            odd[name] = tuple(data.flights[row] for row in np.flatnonzero(off))
    if not odd:
        return data, odd
    return replace(data, known=known).chosen(np.flatnonzero(known.any(axis=1))), odd


def _few_of_vehicle(data: FlightEstimates, i: int, off: Flags) -> Flags:
    """Flights of vehicles of which few are odd."""
    every = np.bincount(data.member_of[data.known[:, i]], minlength=len(data.members))
    odd = np.bincount(data.member_of[off], minlength=len(data.members))
    return np.asarray((odd <= MOST_ODD * every)[data.member_of])
