"""What a log can carry, as `inspect`, `run` and the page all say it: one verdict for one log."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.thresholds import BAND_LEAST
from flightid.inspection.usable_band import AxisBand


class InspectedLog(Protocol):
    """What is asked of an `Inspection`."""

    @property
    def bands(self) -> tuple[AxisBand, ...]:
        """What each axis supports."""
        ...

    @property
    def excitations(self) -> tuple[FoundExcitation, ...]:
        """What excited the vehicle."""
        ...

    @property
    def phases(self) -> FlightPhases:
        """Airborne spans."""
        ...

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts."""
        ...

    @property
    def verdict(self) -> Light:
        """Worst light."""
        ...


NOT_SWEPT = "nothing was injected, and no sweep was flown"
"""Why most axes of a log carry no model: nobody meant them to."""


def why_no_model(inspection: InspectedLog, band: AxisBand) -> str:
    """Why an axis carries no model; empty where one may be tried."""
    if not band.input:
        return band.reason
    if not is_swept(inspection, band.axis):
        return NOT_SWEPT
    if band.band_rad_s is None:
        return band.reason
    if band.span < BAND_LEAST.value:
        return "the band of its sweep that coherence supports is narrow"
    return ""


def is_swept(inspection: InspectedLog, axis: str) -> bool:
    """Whether anything was flown about an axis that a model may be tried from."""
    return any(e.axis == axis and e.is_sweep for e in inspection.excitations)


def carried_axes(inspection: InspectedLog) -> tuple[str, ...]:
    """Axes of which a model may be tried."""
    return tuple(b.axis for b in inspection.bands if not why_no_model(inspection, b))


def carried_sentence(inspection: InspectedLog) -> str:
    """What a log can carry; a fall and what was at a limit come first, for they come before all.

    Parameters
    ----------
    inspection : Inspection
    """
    return " ".join([*_first(inspection), _carried(inspection)])


def _first(inspection: InspectedLog) -> Iterator[str]:
    fall = inspection.phases.fall
    if not fall:
        return
    yield f"{fall[0].upper()}{fall[1:]}."
    limited = next((f.message for f in inspection.findings if f.code == "saturated"), "")
    if limited:
        yield f"Before that {limited}."


def _carried(inspection: InspectedLog) -> str:
    phases = inspection.phases
    if phases.is_known and not phases.airborne:
        return "This log holds no flight, so it can carry no model."
    able = carried_axes(inspection)
    if able:
        *others, last = able
        listed = f"{', '.join(others)} and {last}" if others else last
        said = f"This log can carry a model of {listed}"
        if inspection.verdict is Light.RED:
            return f"{said}, but not as it is: see what is red."
        return f"{said}{', with reservations' if inspection.verdict is Light.AMBER else ''}."
    reasons: dict[str, list[str]] = {}
    for band in inspection.bands:
        reasons.setdefault(why_no_model(inspection, band), []).append(band.axis)
    told = "; ".join(f"{', '.join(axes)}: {why}" for why, axes in reasons.items())
    return f"This log can carry no model: {told or 'no axis is logged'}."
