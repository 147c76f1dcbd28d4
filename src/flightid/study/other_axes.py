"""Axes of a log that a study has no model of: why, and which of them failed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from flightid.control.tuning.flown_gains import loops_of
from flightid.control.tuning.result import RefusedAxis, Tuning, UntouchedAxis
from flightid.control.tuning.tune_pid import CHANNELS
from flightid.inspection.carried import is_swept, why_no_model

if TYPE_CHECKING:
    from flightid.inspection import Inspection
    from flightid.logs import Log
    from flightid.study.identified import ModelResults
    from flightid.study.stage_runner import StageResult


def untouched_axes(log: Log, tuned: Collection[str]) -> tuple[UntouchedAxis, ...]:
    """Axes whose gains a log holds, beside those that are tuned."""
    loops = (loop for loop in loops_of(log, "", CHANNELS) if loop.has_flown)
    return tuple(UntouchedAxis(e.axis, "no model of it") for e in loops if e.axis not in tuned)


def with_other_axes(
    tuned: StageResult[Tuning | None],
    inspected: StageResult[Inspection] | None,
    models: Sequence[StageResult[ModelResults]],
) -> Tuning | None:
    """Say of each axis without a model why: not swept is no failure, swept in vain is one.

    Parameters
    ----------
    tuned : StageResult Tuning or None
        Whose untouched axes have no model.
    inspected : StageResult Inspection or None
        Of the log that flew.
    models : sequence of StageResult ModelResults
        Of the study, those that could not be fitted among them.
    """
    tuning = tuned.value
    if tuning is None or inspected is None:
        return tuning
    inspection = inspected.value
    bands = {band.axis: band for band in inspection.bands}
    unfitted = [each.value for each in models if each.value.fit is None]
    lost = {each.settings.axis: each.left_out[0] for each in unfitted}
    others: list[UntouchedAxis] = []
    refused: list[RefusedAxis] = []
    for each in tuning.untouched:
        band = bands.get(each.axis)
        if each.axis in lost:
            why = lost[each.axis]
            refused.append(RefusedAxis(each.axis, why.message, why.action))
        elif band is None:
            others.append(each)
        elif not is_swept(inspection, each.axis):
            others.append(UntouchedAxis(each.axis, "not swept"))
        elif reason := why_no_model(inspection, band):
            swept = f"it was swept, but carries no model: {reason}"
            judged = (e for e in inspection.findings if e.code.endswith(f"band-{each.axis}"))
            refused.append(RefusedAxis(each.axis, swept, next((e.action for e in judged), "")))
        else:
            others.append(UntouchedAxis(each.axis, "no model of it in this study"))
    return replace(tuning, refused=(*tuning.refused, *refused), untouched=tuple(others))
