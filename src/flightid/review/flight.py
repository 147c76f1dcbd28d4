"""The verb of the room: a log in, what its flight tells of the vehicle out."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from flightid.inspection import Inspection, inspect_log
from flightid.inspection.actuators import find_actuators
from flightid.inspection.carried import carried_axes
from flightid.inspection.divergence import divergence_findings
from flightid.inspection.excitation_found import injected_spans
from flightid.inspection.flight_phases import flight_phases
from flightid.inspection.log_end import end_judged
from flightid.inspection.signals import find
from flightid.inspection.stamps import log_span
from flightid.logs import Log, read_log
from flightid.review.filters import filter_review
from flightid.review.flown_range import flown_ranges
from flightid.review.gyro_noise import gyro_noise
from flightid.review.identity import flight_identity
from flightid.review.loops import loop_responses, without
from flightid.review.motors import motor_use, turning, yaw_trim
from flightid.review.result import FlightReview
from flightid.review.verdicts import judge_flight
from flightid.review.vibration import vibrations
from flightid.threads import on_one_thread


@on_one_thread
def review_flight(
    log: Log | str | Path,
    *,
    span_s: tuple[float, float] | None = None,
    inspection: Inspection | None = None,
) -> FlightReview:
    """Say what one flight tells of its vehicle; no sweep is needed.

    Steps and bandwidths of the closed loops from ordinary flying, tracking errors, motors at their
    limits and out of balance, vibration, gyro noise, battery, modes, flown gains. What a flight
    does not tell it says, with what to fly or log for it.

    Parameters
    ----------
    log : Log or path-like
        An opened log or its file.
    span_s : tuple of float, optional
        Part of the flight to look at, s on the autopilot's clock; default: all of it.
    inspection : Inspection, optional
        Of the same log, where it is known; default: made of one that flew sweeps.

    Raises
    ------
    LogFormatError
        The file is not a log that flightid reads.
    OSError
        The file cannot be read.

    Notes
    -----
    Assumes linear loops that stay the same in the whole flight: limits of rates and motors bend
    the steps. Loops of the controller are as logged; set-points move smoothly between samples.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4; see `closed_loop`.

    Example
    -------
    >>> import flightid as fid
    >>> review = fid.review_flight("flight.bin")                     # doctest: +SKIP
    >>> print(review.to_text())                                      # doctest: +SKIP
    """
    opened = log if isinstance(log, Log) else read_log(log)
    actuators = find_actuators(opened)
    start_s, stop_s = log_span(opened)
    phases = flight_phases(opened, actuators)
    until_s = math.inf if span_s is None else span_s[1]
    of_log = end_judged(opened, phases, opened.findings, until_s)
    if span_s is not None:
        cuts = [(-math.inf, span_s[0]), (span_s[1], math.inf)]
        phases = replace(phases, airborne=without(phases.airborne, cuts))
    ways = None if actuators is None else turning(opened, len(actuators.names))
    loops = loop_responses(opened, phases.airborne)
    noise = gyro_noise(opened, phases.airborne)
    swept = bool(injected_spans(opened))
    found = FlightReview(
        name=opened.path.name,
        kind=opened.kind,
        firmware=opened.firmware,
        vehicle=opened.vehicle,
        start_s=start_s,
        duration_s=stop_s - start_s,
        phases=phases,
        identity=flight_identity(opened, phases),
        loops=loops,
        motors=motor_use(actuators, phases.airborne),
        yaw_trim=yaw_trim(actuators, phases.airborne, ways),
        vibrations=vibrations(opened, phases.airborne),
        noise=noise,
        filters=filter_review(opened, phases.airborne, noise, loops),
        throttle=find(opened, "thrust"),
        swept=swept,
        carried=carried_axes(inspection or inspect_log(opened)) if swept else (),
        ranges=flown_ranges(opened, loops),
    )
    of_log += tuple(divergence_findings(opened, phases.airborne))
    return replace(found, findings=judge_flight(found, of_log))
