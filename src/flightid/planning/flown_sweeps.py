"""What a log holds of sweeps already, and of which axes it needs no further flight."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field
from weakref import WeakKeyDictionary

from flightid.conventions import Light
from flightid.evidence.part_checks import AGAIN, ONCE, needs_another
from flightid.excitation import Excitation, ardupilot_chirp
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.inspection import Inspection, inspect_log
from flightid.inspection.carried import carried_axes, why_no_model
from flightid.inspection.excitation_found import excitations
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.usable_band import AxisBand
from flightid.logs import Log

FLOWN_ONCE = "flown-once"
"""Code: an axis that is carried has one manoeuvre alone."""
UNTOLD = "the log does not tell why"


@dataclass(frozen=True)
class FlownSweeps:
    """Sweeps of a log.

    Attributes
    ----------
    injected : tuple of str
        Axis of each run that the autopilot injected.
    carried : tuple of str
        Axes of which the log can carry a model as it is; none where anything about it is red.
    moved : tuple of str
        Axis of each manoeuvre that a model may be tried from, injected or not.
    unfit : mapping of str to str
        Why the log carries no model of an axis, by axis.
    """

    injected: tuple[str, ...] = ()
    carried: tuple[str, ...] = ()
    moved: tuple[str, ...] = ()
    unfit: Mapping[str, str] = field(default_factory=dict)

    def findings(self, log: Log, planned: Collection[str]) -> Iterator[Finding]:
        """What needs no flight, and what is swept again although it was swept."""
        name = log.path.name
        done = [axis for axis in self.carried if axis not in planned]
        if done:
            yield Finding(
                "identified-already", Light.GREEN,
                f"this log can carry a model of {_listed(done)} already",
                f"next is flightid tune {name}",
            )  # fmt: skip
        once = [axis for axis in done if needs_another(self.moved.count(axis))]
        if once:
            yield Finding(
                FLOWN_ONCE, Light.UNKNOWN, f"{_listed(once)}: {ONCE}",
                f"{AGAIN}: flightid plan {name} --axes {','.join(once)}",
            )  # fmt: skip
        again = Counter(axis for axis in self.injected if axis in planned)
        second = [axis for axis in again if axis in self.carried]
        if second:
            yield Finding(
                "swept-again", Light.GREEN,
                f"{_listed(second)}: swept already, and the log can carry a model: further runs "
                "show whether flights agree",
            )  # fmt: skip
        by_reason: dict[str, list[str]] = {}
        for axis in again:
            if axis not in self.carried:
                by_reason.setdefault(self.unfit.get(axis, UNTOLD), []).append(axis)
        for reason, axes in by_reason.items():
            yield Finding(
                "swept-already", Light.AMBER,
                f"{_listed(axes)}: swept already, and no model rests on that: {reason}",
                "see that it does not happen again before you fly this plan",
            )  # fmt: skip


def sweep_again(log: Log, axis: str) -> Excitation | None:
    """The sweep that a log's autopilot injected at the mixer about an axis, to be flown once more.

    Returns
    -------
    Excitation or None
        None where no such sweep ran to its end.
    """
    for run in log.sid_runs:
        if run.point == "mixer" and run.body_axis == axis and run.is_complete:
            return ardupilot_chirp(
                magnitude=run.magnitude, start_hz=run.f_start_hz, stop_hz=run.f_stop_hz,
                record_s=run.record_s, fade_in_s=run.fade_in_s, fade_out_s=run.fade_out_s,
                axis=run.axis, name=axis,
            )  # fmt: skip
    return None


_KNOWN: WeakKeyDictionary[Log, FlownSweeps] = WeakKeyDictionary()


def flown_sweeps(log: Log, phases: FlightPhases) -> FlownSweeps:
    """Look for sweeps in a log, once for each log that is held.

    Parameters
    ----------
    log : Log
    phases : FlightPhases
        Airborne spans.
    """
    if log not in _KNOWN:
        found = excitations(log, phases.airborne)
        carried: tuple[str, ...] = ()
        unfit: dict[str, str] = {}
        if any(each.is_sweep for each in found):
            inspection = inspect_log(log)
            carried = () if inspection.verdict is Light.RED else carried_axes(inspection)
            unfit = {band.axis: _why(inspection, band) for band in inspection.bands}
        injected = tuple(each.axis for each in found if each.is_injected)
        moved = tuple(each.axis for each in found if each.is_sweep)
        _KNOWN[log] = FlownSweeps(injected, carried, moved, unfit)
    return _KNOWN[log]


def _why(inspection: Inspection, band: AxisBand) -> str:
    """Why an axis carries no model: its band, else what is red of the whole log."""
    red = (each.message for each in inspection.findings if each.light is Light.RED)
    return why_no_model(inspection, band) or next(red, UNTOLD)


def _listed(axes: list[str]) -> str:
    return axes[0] if len(axes) == 1 else f"{', '.join(axes[:-1])} and {axes[-1]}"
