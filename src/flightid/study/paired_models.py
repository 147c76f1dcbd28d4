"""Models of several studies that stand for the same, and what differs between two studies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from flightid.control.stepped.controller_files import (
    CONTROLLER,
    controller_of,
    own_rate,
    usual_rate,
)
from flightid.control.stepped.gain_controller import GainController
from flightid.dynamics.conditions.compare_conditions import compare_conditions
from flightid.dynamics.conditions.result import ConditionComparison
from flightid.errors import ModelError
from flightid.models import Model, load_model
from flightid.models.saved_files import models_of
from flightid.review.margin_comparison import MarginComparison, compare_margins


def paired_models(folders: Sequence[str | Path]) -> dict[str, tuple[Model, ...]]:
    """Models that stand for the same in several studies, by the name of the first.

    Those of one name go together; those left over where their inputs and outputs are the same and
    no other of either folder has these.

    Parameters
    ----------
    folders : sequence of path
        Of results of studies, or of models.

    Raises
    ------
    ModelError
        The studies share none: what each holds is said.
    """
    found = [{path.stem: load_model(path) for path in models_of(Path(each))} for each in folders]
    first, *others = found
    pairs: dict[str, tuple[Model, ...]] = {}
    for name, model in first.items():
        beside = [_partner(name, model, first, other) for other in others]
        if all(each is not None for each in beside):
            pairs[name] = (model, *(each for each in beside if each is not None))
    if not pairs:
        held = "; ".join(
            f"{folder}: {', '.join(f'{n} ({_channels(m)})' for n, m in each.items())}"
            for folder, each in zip(folders, found, strict=True)
        )
        raise ModelError(
            "no model of one has its name, or its inputs and outputs, in the other",
            found=held,
            needed="models of the same inputs and outputs",
            action="name the files of two models",
        )
    return pairs


def compare_paired(
    folders: Mapping[str, Path],
) -> tuple[dict[str, ConditionComparison], dict[str, MarginComparison]]:
    """Parameters and modes of the models of two studies, and margins where both tuned a PID.

    By the name of the model in the first of them.

    Parameters
    ----------
    folders : mapping of str to Path
        Results of both studies by what they are called, the base first.

    Raises
    ------
    ModelError
        As `paired_models`.
    """
    names, places = tuple(folders), tuple(folders.values())
    pairs = paired_models(places)
    conditions = {
        model: compare_conditions(dict(zip(names, each, strict=True)))
        for model, each in pairs.items()
    }
    laws = [each / CONTROLLER for each in places]
    if not all(each.is_file() for each in laws):
        return conditions, {}
    margins = {
        model: compare_margins(
            _closed(each[0], laws[0]), _closed(each[-1], laws[-1]), names=(names[0], names[-1])
        )
        for model, each in pairs.items()
    }
    return conditions, margins


def _closed(model: Model, file: Path) -> tuple[Model, GainController]:
    """A model with the controllers of its study around it."""
    return model, controller_of(file, model, own_rate(file) or usual_rate(model))


def _partner(
    name: str, model: Model, own: Mapping[str, Model], other: Mapping[str, Model]
) -> Model | None:
    """The model of another study that stands for the same."""
    same = other.get(name)
    if same is not None and _channels(same) == _channels(model):
        return same
    left = [each for key, each in other.items() if key not in own]
    alike = [each for each in left if _channels(each) == _channels(model)]
    mine = [each for key, each in own.items() if key not in other]
    rivals = [each for each in mine if _channels(each) == _channels(model)]
    if same is None and len(alike) == len(rivals) == 1:
        return alike[0]
    return None


def _channels(model: Model) -> str:
    return f"{', '.join(model.outputs)} of {', '.join(model.inputs)}"
