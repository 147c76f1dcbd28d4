"""The stages of a study that read handling qualities off fits and what stands beside them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flightid.dynamics.handling_qualities.handling_qualities import (
    HandlingQualities,
    handling_qualities,
)
from flightid.errors import StudyError
from flightid.identification.uncertain_of import uncertain_of
from flightid.responses import FrequencyResponse
from flightid.study.faults import Faults
from flightid.study.qualities_settings import QualitiesSettings
from flightid.study.stage_runner import StageResult, StageRunner, digest

if TYPE_CHECKING:
    from flightid.control.closed_loop.result import ClosedLoop
    from flightid.study.identified import ModelResults
    from flightid.study.task import Task
    from flightid.study.uses_settings import LoopSettings


def require_pairs(tasks: Iterable[Task], settings: QualitiesSettings) -> None:
    """See before any work that each axis is some model's.

    Raises
    ------
    StudyError
        There is no model with equations, or none with the output and control of an axis.
    """
    models = [task.model for task in tasks if task.model is not None]
    if not models:
        raise StudyError(
            "handling qualities are read off models with equations",
            found="none in the study",
            action="take [handling_qualities] out, or call flightid.handling_qualities",
        )
    for axis, (output, control) in (settings.pairs or {}).items():
        if not any(output in model.outputs and control in model.inputs for model in models):
            raise StudyError(
                f"study file, [handling_qualities.axes]: no model gives {output} from {control}",
                found=f"{axis} = {[output, control]}",
                needed="output and control of one of the models",
            )


def rate_models(
    identified: Iterable[StageResult[ModelResults]],
    loops: Iterable[tuple[LoopSettings, ClosedLoop]],
    settings: QualitiesSettings,
    faults: Faults,
    runner: StageRunner,
) -> dict[str, HandlingQualities]:
    """Handling qualities of every fit and of what the study rates beside it, by name.

    Parameters
    ----------
    identified : iterable of StageResult ModelResults
    loops : iterable of (LoopSettings, ClosedLoop)
        Closed around them.
    settings : QualitiesSettings
    faults : Faults
        Takes what cannot be rated.
    runner : StageRunner

    Returns
    -------
    dict of str to HandlingQualities
    """
    found = {}
    keys = {}
    for each in identified:
        item = each.value
        keys[item.name] = each.key
        if item.fit is None or item.settings.structure is not None:
            continue
        cases = vars(item.settings.qualities).items()
        asked = replace(settings, **{name: case for name, case in cases if case is not None})
        beside = {"fit": item.fit, "reference": item.reference, "response": item.response}
        for kind, source in beside.items():
            if kind in settings.sources and source is not None:
                name = item.name if kind == "fit" else f"{item.name}, {kind}"
                known: StageResult[Any] = StageResult(source, f"{kind} of {each.key}")
                found[name] = faults.spare(
                    f"handling qualities of “{name}”", _staged, None, name, known, asked, runner
                )
    for loop, closed in loops if "loop" in settings.sources else ():
        known = StageResult(closed.uncertain, digest((loop, keys[loop.model])))
        found[loop.name] = faults.spare(
            loop.name, _staged, None, loop.name, known, settings, runner
        )
    return {name: rated for name, rated in found.items() if rated is not None}


def _staged(
    name: str, source: StageResult[Any], settings: QualitiesSettings, runner: StageRunner
) -> HandlingQualities:
    return runner.stage(f"handling qualities: {name}", _rated, source, settings).value


def _rated(source: Any, settings: QualitiesSettings) -> HandlingQualities:  # noqa: ANN401
    axes = settings.pairs
    if axes is not None:
        model = uncertain_of(source).value if not isinstance(source, FrequencyResponse) else source
        axes = {
            axis: pair
            for axis, pair in axes.items()
            if pair[0] in model.outputs and pair[1] in model.inputs
        }
    return handling_qualities(source, **{**settings.of_verb(), "axes": axes})
