"""The verb of the stage: look through a log and say what it is good for."""

from __future__ import annotations

from pathlib import Path

from flightid.inspection.actuators import find_actuators
from flightid.inspection.excitation_found import excitations
from flightid.inspection.flight_phases import flight_phases
from flightid.inspection.inspection import Inspection
from flightid.inspection.rates import stream_rates
from flightid.inspection.saturation import saturations
from flightid.inspection.skew import stream_skews
from flightid.inspection.stamps import log_span
from flightid.inspection.usable_band import axis_bands
from flightid.inspection.verdicts import judge
from flightid.logs import Log, read_log
from flightid.threads import on_one_thread


@on_one_thread
def inspect_log(log: Log | str | Path) -> Inspection:
    """Say what a log holds and whether it can support identification.

    Looks for time in the air, logging rates, gaps and skew, saturation, excitation, and the band
    in which commands explain the body rates; each shortcoming has its own code and says what to
    log or fly instead.

    Parameters
    ----------
    log : Log or path-like
        An opened log or its file.

    Raises
    ------
    LogFormatError
        The file is not a log that flightid reads.
    OSError
        The file cannot be read.

    Notes
    -----
    Assumes that the mixer commands are the inputs and the body rates the outputs. The coherence is
    that of a direct estimate: under closed loops it says how much is explained, not that the
    estimate is free of bias.

    Example
    -------
    >>> import flightid as fid
    >>> inspection = fid.inspect_log("flight.bin")                   # doctest: +SKIP
    >>> print(inspection.verdict)                                    # doctest: +SKIP
    red
    """
    opened = log if isinstance(log, Log) else read_log(log)
    actuators = find_actuators(opened)
    start_s, stop_s = log_span(opened)
    phases = flight_phases(opened, actuators)
    excited = excitations(opened, phases.airborne)
    found = Inspection(
        name=opened.path.name,
        kind=opened.kind,
        firmware=opened.firmware,
        vehicle=opened.vehicle,
        duration_s=stop_s - start_s,
        rates=stream_rates(opened),
        phases=phases,
        excitations=excited,
        saturations=saturations(opened, phases.airborne, actuators),
        skews=stream_skews(opened, phases.airborne),
        bands=axis_bands(opened, phases.airborne, excited),
        start_s=start_s,
    )
    return found.with_findings(judge(opened, found))
