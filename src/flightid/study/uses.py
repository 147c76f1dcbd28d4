"""What a study does with its fitted models: files, conditions side by side, rotor, loops."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, TypeVar

from flightid.control.closed_loop.close_loop import close_loop
from flightid.control.closed_loop.result import ClosedLoop
from flightid.dynamics.conditions.compare_conditions import compare_conditions
from flightid.dynamics.conditions.result import ConditionComparison
from flightid.dynamics.rotor.options import RotorOptions
from flightid.dynamics.rotor.result import RotorPhysics
from flightid.dynamics.rotor.rotor_physics import rotor_physics
from flightid.errors import StudyError
from flightid.export import ExportFiles
from flightid.export.to_file import export
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.models import GreyBoxModel, write_model
from flightid.models.saved_files import MODELS
from flightid.options import options_of
from flightid.study.faults import Faults
from flightid.study.identified import ModelResults
from flightid.study.loop_blocks import made_block
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.uses_settings import (
    ExportSettings,
    LoopSettings,
    RotorSettings,
    UsesSettings,
)

Item = TypeVar("Item")
EXPORTS = "export"
"""Folders of the output."""


@dataclass(frozen=True, eq=False)
class Uses:
    """What was made with the fitted models.

    Attributes
    ----------
    files : mapping of str to str
        Model file in the output, by name of the model: estimates with covariance and evidence.
    conditions : ConditionComparison or None
        Flight conditions side by side, where two models or more name one.
    rotor : RotorPhysics or None
    loops : tuple of (LoopSettings, ClosedLoop)
    exported : tuple of ExportFiles
    """

    files: Mapping[str, str] = field(default_factory=dict)
    conditions: ConditionComparison | None = None
    rotor: RotorPhysics | None = None
    loops: tuple[tuple[LoopSettings, ClosedLoop], ...] = ()
    exported: tuple[ExportFiles, ...] = ()

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "files": dict(self.files),
            "conditions": None if self.conditions is None else self.conditions.to_dict(),
            "rotor": None if self.rotor is None else self.rotor.to_dict(),
            "loops": {asked.name: closed.to_dict() for asked, closed in self.loops},
            "exported": [each.to_dict() for each in self.exported],
        }


def use_models(
    identified: Sequence[StageResult[ModelResults]],
    settings: UsesSettings,
    folder: Path,
    faults: Faults,
    runner: StageRunner,
) -> Uses:
    """Write every fitted model, and do with them what the study asks.

    Parameters
    ----------
    identified : sequence of StageResult ModelResults
    settings : UsesSettings
    folder : Path
        Output of the study.
    faults : Faults
        Takes what fails: a model that was left out, or that does not fit its use.
    runner : StageRunner
    """
    items = [each.value for each in identified]
    fits = {item.name: item.fit for item in items if item.fit is not None}
    staged = {
        each.value.name: StageResult(each.value.fit, each.key)
        for each in identified
        if each.value.fit is not None
    }
    files: dict[str, str] = {}
    files = faults.spare("the model files", _written, files, fits, folder)
    conditions = faults.spare("the flight conditions", _conditions, None, items)
    rotor = None
    if settings.rotor is not None:
        rotor = faults.spare("rotor physics", _rotor, None, fits, settings.rotor)
    loops = [
        (loop, closed)
        for loop in settings.loops
        if (closed := faults.spare(f"loop “{loop.name}”", _closed, None, staged, loop, runner))
        is not None
    ]
    exported = [
        made
        for each in settings.exports
        if (made := faults.spare(f"export {each.file}", _exported, None, fits, each, folder))
        is not None
    ]
    return Uses(files, conditions, rotor, tuple(loops), tuple(exported))


def _rotor(fits: Mapping[str, Fit], asked: RotorSettings) -> RotorPhysics:
    return rotor_physics(
        _fit(fits, asked.model),
        **{each.name: getattr(asked, each.name) for each in options_of(RotorOptions)},
    )


def _closed(
    fits: Mapping[str, StageResult[Fit]], loop: LoopSettings, runner: StageRunner
) -> ClosedLoop:
    return runner.stage(f"loop: {loop.name}", _around, _fit(fits, loop.model), loop).value


def _around(fit: Fit, loop: LoopSettings) -> ClosedLoop:
    return close_loop(
        fit,
        loop.gains or list(map(made_block, loop.block)),
        outside=loop.outside,
        draws=loop.draws,
        seed=loop.seed,
        name=loop.name,
    )


def _exported(fits: Mapping[str, Fit], asked: ExportSettings, folder: Path) -> ExportFiles:
    (folder / EXPORTS).mkdir(exist_ok=True)
    options: dict[str, Any] = asked.options.to_dict()
    place = folder / EXPORTS / asked.file
    made = export(_fit(fits, asked.model), place, asked.format, **options)
    # The folder gets its own name when the study is whole: paths are told from there.
    return replace(made, files=tuple(path.relative_to(folder) for path in made.files))


def _fit(fits: Mapping[str, Item], name: str) -> Item:
    if name not in fits:
        raise StudyError(
            f"model {name!r} cannot be used: it was left out",
            needed="inputs with coherence",
            action="lower [response] minimum_coherence, or fly the inputs harder",
        )
    return fits[name]


def _written(fits: Mapping[str, Fit], folder: Path) -> dict[str, str]:
    """Every fit as a model file, under a name that any file system takes."""
    written: dict[str, str] = {}
    for name, fit in fits.items():
        (folder / MODELS).mkdir(exist_ok=True)
        stem = re.sub(r"\W+", "_", name.lower()).strip("_") or "model"
        if f"{MODELS}/{stem}.toml" in written.values():
            stem = f"{stem}_{len(written) + 1}"
        if isinstance(fit.model, GreyBoxModel):
            # Two fits of one template are told apart by their names in the study.
            fit = replace(fit, model=replace(fit.model, name=name))  # noqa: PLW2901
        write_model(fit, folder / MODELS / f"{stem}.toml")
        written[name] = f"{MODELS}/{stem}.toml"
    return written


def _conditions(identified: Sequence[ModelResults]) -> ConditionComparison | None:
    named = [(item.settings.condition, item.fit) for item in identified if item.settings.condition]
    held = {str(word): fit for word, fit in named if fit is not None}
    return compare_conditions(held) if len(held) > 1 else None
