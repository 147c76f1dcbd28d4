"""Parts of a log that a fit of an axis takes, those that it keeps back, and the instrument."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.inspection import Inspection
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.study.proposal.manoeuvres import liveliest

CHIRP = "chirp"
"""Channel of the maps: the chirp of Betaflight, of whichever axis."""
SEARCHED = ("chirp", "sweep", "autotune")
"""Excitations without a logged injection from which a model may be tried."""


@dataclass(frozen=True)
class LogPart:
    """A stretch of a log: a run of the system-identification mode, or a span.

    Attributes
    ----------
    name : str
    run : SidRun or None
    number : int
        Of the run, among those of its SID_AXIS.
    span_s : tuple of float or None
        On the autopilot's clock, s.
    """

    name: str
    run: SidRun | None = None
    number: int = 0
    span_s: Span | None = None

    @property
    def chirp_span_s(self) -> Span:
        """From where to where it moved the vehicle, s."""
        return self.run.chirp_span_s if self.run is not None else self.span_s or (0.0, 0.0)


@dataclass(frozen=True)
class AxisParts:
    """What a log holds of an axis for a model.

    Attributes
    ----------
    flown, unseen : tuple of LogPart
        Of the fit, and kept back from it.
    estimator : str
        Of the responses.
    excitations : tuple of str
        Channels that are instruments, besides the injection that a run brings along.
    """

    flown: tuple[LogPart, ...]
    unseen: tuple[LogPart, ...]
    estimator: str
    excitations: tuple[str, ...] = ()


def axis_parts(log: Log, inspection: Inspection, axis: str) -> AxisParts:
    """Which parts of a log a fit of an axis takes, and which it keeps back; none of no sweep.

    Parameters
    ----------
    log : Log
    inspection : Inspection
        Of that log.
    axis : str
    """
    runs = _runs(log, axis)
    others = [e for e in inspection.excitations if e.axis == axis and e.kind in SEARCHED]
    flown, unseen = _flown(log, axis, runs, others)
    if flown and not unseen:
        avoid = [(e.start_s, e.stop_s) for e in inspection.excitations if e.is_injected]
        sid = [(run.start_s - 1.0, run.stop_s + 1.0) for run in log.sid_runs]
        spans = tuple(each.chirp_span_s for each in flown)
        airborne = inspection.phases.airborne
        quiet = liveliest(log, axis, airborne, [*avoid, *sid, *spans], spans)
        unseen = tuple(LogPart(f"{axis} flying", span_s=each) for each in quiet)
    estimator = "instrument" if runs else "composite"
    chirped = not runs and bool(_chirped(others))
    return AxisParts(flown, unseen, estimator, (CHIRP,) if chirped else ())


def _runs(log: Log, axis: str) -> list[SidRun]:
    """Sweeps of an axis that ran to their end; of none, what was flown of those broken off."""
    made = [run for run in log.sid_runs if str(run.body_axis) == axis]
    return [run for run in made if run.is_complete] or made


def _flown(
    log: Log, axis: str, runs: list[SidRun], others: list[FoundExcitation]
) -> tuple[tuple[LogPart, ...], tuple[LogPart, ...]]:
    """Stretches of the fit, and a run kept back where there are several."""
    if not runs:
        # A chirp is told from what else moved the axis, which is no part of its fit.
        told = _chirped(others) or others
        numbered = enumerate(((each.start_s, each.stop_s) for each in told), 1)
        made = [LogPart(f"{axis} {k}", span_s=span) for k, span in numbered]
        kept = made[-1:] if len(made) > 1 and _chirped(others) else []
        return tuple(made[: len(made) - len(kept)]), tuple(kept)
    stretches = []
    for k, run in enumerate(runs, 1):
        alike = [each for each in log.sid_runs if each.axis == run.axis]
        name = f"{axis} sweep" + (f" {k}" if len(runs) > 1 else "")
        stretches.append(LogPart(name, run, alike.index(run)))
    kept = stretches[-1:] if len(stretches) > 1 else []
    return tuple(stretches[: len(stretches) - len(kept)]), tuple(kept)


def _chirped(others: list[FoundExcitation]) -> list[FoundExcitation]:
    """Chirps, whose set-point is an instrument."""
    return [each for each in others if each.kind == "chirp"]
