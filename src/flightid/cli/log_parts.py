"""Which part of a log a verb takes where nobody names one: the sweep, as ``flightid run`` does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from flightid.cli.output import note

if TYPE_CHECKING:
    from flightid.identification import Fit
    from flightid.inspection import Inspection
    from flightid.logs import Log
    from flightid.record import Record
    from flightid.study.proposal.parts import AxisParts, LogPart

Take = Literal["flown", "unseen"]
"""What a fit takes of a log, or what is left to verify it on."""


def log_records(
    log: Log, names: Sequence[str], inputs: Sequence[str], take: Take
) -> list[Record] | None:
    """Records of the sweeps that moved the axes of some inputs, or of what was kept back.

    Parameters
    ----------
    log : Log
    names : sequence of str
        Channels.
    inputs : sequence of str
        Those among them that drive.
    take : {"flown", "unseen"}

    Returns
    -------
    list of Record, or None
        None where no sweep moved them: nothing tells a part then.
    """
    from flightid.conventions import Role

    made = []
    for parts in _parts(log, inputs):
        injected = dict.fromkeys(parts.excitations, Role.EXCITATION)
        for part in (parts.unseen if take == "unseen" else ()) or parts.flown:
            note(f"{log.path.name}: {_said(part)}; --span-s or --run take another part")
            where = {"span_s": part.span_s} if part.run is None else {"sid_run": part.run}
            wanted = dict.fromkeys((*names, *injected))
            made.append(log.record(names=list(wanted), roles=injected, name=part.name, **where))
    return made or None


def with_instrument(
    given: dict[str, Any], files: Sequence[Path], records: Sequence[Record], inputs: Sequence[str]
) -> dict[str, Any]:
    """Options of a response, with the injection that logs hold as the instrument of their loop.

    What was given stays.
    """
    from flightid.logs import is_log

    injected = {tuple(record.excitations) for record in records}
    if {"estimator", "excitations"} & given.keys() or len(inputs) != 1 or len(injected) != 1:
        return given
    (found,) = injected
    if len(found) != 1 or not all(map(is_log, files)):
        return given
    return {**given, "estimator": "instrument", "excitations": found}


def inspections_of(files: Iterable[Path]) -> list[Inspection]:
    """Inspections of the logs among some files."""
    from flightid import inspect_log
    from flightid.logs import is_log

    return [inspect_log(file) for file in files if is_log(file)]


def with_inspections(fit: Fit, inspections: Iterable[Inspection]) -> Fit:
    """A fit with the verdicts on the logs that its data come from among its evidence."""
    from flightid.evidence import inspection_check, sweep_check

    channels = (*fit.model.inputs, *fit.model.outputs)
    for each in inspections:
        checks = [inspection_check(each, channels), *sweep_check(each, channels)]
        fit = replace(fit, evidence=fit.evidence.with_checks(checks))
    return fit


def _parts(log: Log, inputs: Sequence[str]) -> list[AxisParts]:
    from flightid import inspect_log
    from flightid.inspection.axes import axes_of
    from flightid.study.proposal.parts import axis_parts

    moved = [axis for axis, known in axes_of(log.vehicle).items() if known.command in inputs]
    if not moved:
        return []
    inspection = inspect_log(log)
    return [axis_parts(log, inspection, axis) for axis in moved]


def _said(part: LogPart) -> str:
    start_s, stop_s = part.chirp_span_s
    return f"{part.name}, {start_s:.1f} to {stop_s:.1f} s"
