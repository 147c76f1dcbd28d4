"""Verdicts on the filters of a flight, with what to set."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.control.tuning.filter_choice import FilterChoice
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.review.filters import FilterReview
from flightid.review.thresholds import OUTPUT_NOISE, PHASE_TO_WIN

AFTER_THE_FALL = "find the cause of the fall first; filters by the noise of the next flight"


def filter_findings(
    filters: FilterReview, log: str, kind: str, *, fallen: bool
) -> Iterator[Finding]:
    """Noise in the outputs, notches beside the peaks, and what better filters would do.

    `log` is the name of its file, `kind` who wrote it, as `Log.kind` has it; of a flight that ended
    in a fall, `fallen`, none are proposed.
    """
    for text in filters.missed:
        yield Finding(
            "notches-miss",
            Light.AMBER,
            text,
            "let the notches follow throttle or the ESCs (INS_HNTCH_MODE 1 or 3), or mend their "
            "FREQ; they cost phase where they are",
        )
    limit = OUTPUT_NOISE.value
    noisy = [
        use for use in filters.axes if use.noise is not None and use.noise.total > limit * use.full
    ]
    choice = filters.choice
    told = "" if choice is None else ", ".join(f"{c.name} {c.value:g}" for c in choice.changes)
    words = _phase(choice)
    file = f"filters{parameter_suffix(kind)}" if choice is not None else ""
    way = f"flightid flight {log} --write {file} writes them with the way back"
    for use in noisy:
        assert use.noise is not None
        share = 100.0 * use.noise.total / use.full
        yield Finding(
            f"output-noise-{use.axis}",
            Light.AMBER,
            f"noise of the gyroscope moves the {use.axis} output by {share:.2g} % of full command, "
            f"rms; {100.0 * limit:g} % is fine",
            AFTER_THE_FALL if fallen else _advice(told, words, choice, way, log),
        )
    if noisy or fallen or choice is None or not choice.changes:
        return
    most = max(each.phase_gained_deg for each in choice.axes)
    if most >= PHASE_TO_WIN.value:
        yield Finding(
            "filters-slow",
            Light.GREEN,
            f"the filters may be faster: {told} ({words})",
            way,
        )


def _phase(choice: FilterChoice | None) -> str:
    """The most that filters save of phase, or cost; of each axis their table says it."""
    if choice is None or not choice.axes:
        return ""
    most = max(choice.axes, key=lambda each: abs(each.phase_gained_deg))
    word = "saves" if most.phase_gained_deg >= 0.0 else "costs"
    hertz = most.crossover_rad_s / math.tau
    return f"{word} up to {abs(most.phase_gained_deg):.2g} deg at {hertz:.3g} Hz"


def _advice(told: str, words: str, choice: FilterChoice | None, way: str, log: str) -> str:
    if choice is None or not told:
        return "balance propellers and damp the mount: no cut-off within its range does better"
    rest = "" if choice.within_limit else "; it is not enough: balance propellers, damp the mount"
    if min(each.phase_gained_deg for each in choice.axes) < -PHASE_TO_WIN.value:
        rest += f"; sweep with them and tune the gains (flightid plan {log}), or lower D instead"
    return f"set {told} ({words}){rest}; {way}"
