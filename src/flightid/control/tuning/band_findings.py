"""Verdicts on loops that light modes outside the band may reach, with what to do about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flightid.control.margins.mode_slack import MOST_MOVED_DB, TAKEN
from flightid.control.margins.outside_band import beyond_findings
from flightid.control.margins.rigid_vehicle import RIGID, rigid_declared
from flightid.control.tuning.axis_tuning import AxisResult
from flightid.control.tuning.modes_outside import BELOW_BAND, OF_ABOVE
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.findings import Finding

Band = tuple[float, float]


def band_findings(
    result: AxisResult, band_rad_s: Band | None, wider: tuple[str, str]
) -> Iterator[Finding]:
    """All that is to be said of what lies outside the band.

    Parameters
    ----------
    result : AxisResult
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    wider : tuple of str
        What brings its low end, and its high end, so far that all is promised.
    """
    yield from rigid_declared(result.problem.rigid, band_rad_s)
    yield from beyond_findings(result.beyond, band_rad_s)
    yield from below_band(result, band_rad_s, wider[0])


def below_band(result: AxisResult, band_rad_s: Band | None, sweep: str) -> Iterator[Finding]:
    """Amber where a loop is at one below the band, or a light mode there may take what was asked.

    Parameters
    ----------
    result : AxisResult
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s; nothing is said where that is not known.
    sweep : str
        What brings the band's low end so far that all is promised; see `wider_band`.
    """
    if band_rad_s is None:
        return
    if found := at_one_below(result.worst_cases):
        taken = "a light mode there, such as a pendulum, may take margins and stability, and "
        if result.problem.rigid:
            taken = "what stands there is the model's word alone, and "
        yield Finding(
            "margin-below-band",
            Light.AMBER,
            f"{' and '.join(found)}: the gain is at one below the {band_rad_s[0]:.3g} rad/s from "
            f"which the model was shown to hold, or nearer to it there than is asked: {taken}"
            "no margin, peak or bandwidth is promised",
            sweep,
        )
    lowered = _named(result.worst_cases, TAKEN["below"])
    if rest := [name for name in lowered if name not in found]:
        asked = asked_below([e for e in result.worst_cases if e.loop in rest])
        yield Finding(
            "mode-below-band",
            # What was asked and is not known to hold is a check that was not made.
            Light.AMBER if asked else Light.GREEN,
            f"{' and '.join(rest)}: nothing is known below {band_rad_s[0]:.3g} rad/s: a light mode "
            f"there that lowers the response by up to {MOST_MOVED_DB:g} dB may take "
            f"{taken_words(result.worst_cases, rest)}, and none is promised",
            f"{sweep}; {RIGID}",
        )


def at_one_below(cases: Sequence[WorstCase]) -> list[str]:
    """Loops that are at one below the band, or nearer to it than is asked."""
    return _named(cases, BELOW_BAND)


def asked_below(cases: Sequence[WorstCase]) -> bool:
    """Whether what lies below the band may take what was asked of a loop."""
    return any(e.required and e.estimate.reason in (BELOW_BAND, TAKEN["below"]) for e in cases)


def asked_above(cases: Sequence[WorstCase]) -> bool:
    """Whether what lies above the band may take what was asked of a loop."""
    return any(e.required and e.estimate.reason in OF_ABOVE for e in cases)


def by_modes_alone(cases: Sequence[WorstCase]) -> bool:
    """Whether all that was asked and is not promised is what light modes may take."""
    asked = [each.estimate.reason for each in cases if each.required]
    return not {BELOW_BAND, *OF_ABOVE}.difference(TAKEN.values()).intersection(asked)


def _named(cases: Sequence[WorstCase], reason: str) -> list[str]:
    return [*dict.fromkeys(each.loop for each in cases if each.estimate.reason == reason)]


def taken_words(cases: Sequence[WorstCase], loops: Sequence[str]) -> str:
    """Numbers that a mode below the band may take, of which loop where loops lose unlike ones."""
    alike: dict[tuple[str, ...], list[str]] = {}
    for loop in loops:
        lost = [e.name for e in cases if (e.loop, e.estimate.reason) == (loop, TAKEN["below"])]
        alike.setdefault(tuple(lost), []).append(loop)
    if len(alike) == 1:
        return ", ".join(*alike)
    return "; ".join(f"of {' and '.join(of)} {', '.join(lost)}" for lost, of in alike.items())
