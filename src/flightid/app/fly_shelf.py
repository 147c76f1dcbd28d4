"""What a folder has to fly: models that its studies have identified, and files of models."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import field
from pathlib import Path

from flightid.app.fly_schemas import FlyChoice, FlyInput
from flightid.app.fly_seat import vehicle_of
from flightid.app.fly_vehicles import FlyVehicle
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import is_link, own_folder, shown_name
from flightid.app.run_schemas import RunPart
from flightid.app.workspace import ID, Workspace
from flightid.control.laws.augmentation import augmentation_law
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.models import load_model

MODELS = "models"
MOST_FILES = 60
"""Models of a folder that are tried; what lies behind them is not."""
MARK = re.compile(r"^[0-9a-f]{16}-|-[0-9a-f]{8}$")
"""What the page puts around the name of a model of its own: its log, and its content."""


@dataclass(frozen=True)
class ModelFile:
    """A file that may hold a vehicle."""

    name: str
    title: str
    path: str


@dataclass
class FlyShelf:
    """Models of a folder as vehicles.

    Attributes
    ----------
    vehicles : list of FlyVehicle
    choices : list of FlyChoice
        The same as the page is told them.
    left_out : dict of str to str
        Why a model of the folder cannot be flown.
    """

    vehicles: list[FlyVehicle] = field(default_factory=list)
    choices: list[FlyChoice] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)


def model_files(workspace: Workspace) -> list[ModelFile]:
    """Models of the folder: those of the last run of each study, then files under ``models/``."""
    files = [*_identified(workspace), *_files(workspace.folder)]
    return files[:MOST_FILES]


def _identified(workspace: Workspace) -> Iterator[ModelFile]:
    results = own_folder(workspace.folder, ".flightid", "results")
    for entry in sorted(results.iterdir()):
        if not ID.fullmatch(entry.name) or is_link(entry):
            continue
        run = kept_part(workspace, entry.name, "run")
        if not isinstance(run, RunPart):
            continue
        folder = entry / run.folder
        if is_link(folder) or is_link(folder / MODELS):
            continue
        for path in _plain(folder / MODELS):
            title = f"{path.stem.replace('_', ' ').capitalize()}, identified: {run.title}"
            yield _file(workspace.folder, path, title)


def _files(folder: Path) -> Iterator[ModelFile]:
    for path in _plain(own_folder(folder, MODELS)):
        stem = MARK.sub("", MARK.sub("", path.stem))
        yield _file(folder, path, f"{stem.replace('-', ' ').capitalize()}, {MODELS}/")


def _plain(folder: Path) -> list[Path]:
    return [each for each in sorted(folder.glob("*.toml")) if each.is_file() and not is_link(each)]


def _file(folder: Path, path: Path, title: str) -> ModelFile:
    name = shown_name(path.relative_to(folder).as_posix())
    return ModelFile(name, shown_name(title), str(path))


def make_shelf(files: Sequence[ModelFile]) -> FlyShelf:
    """Try each file: what it takes to fly it, or why it cannot be flown."""
    shelf = FlyShelf()
    for each in files:
        try:
            model = load_model(Path(each.path))
            vehicle = vehicle_of(model, each.name, each.title, each.path)
            shelf.choices.append(choice_of(vehicle, own=True))
            shelf.vehicles.append(vehicle)
        except (FlightidError, OSError) as error:
            shelf.left_out[each.title] = str(error)
    return shelf


def choice_of(vehicle: FlyVehicle, *, own: bool = False) -> FlyChoice:
    """What the page is told of a vehicle."""
    model = vehicle.model
    units = {name: str(unit) for name, unit in model.units.items()}
    law = augmentation_law(vehicle.law) if vehicle.law else None
    limits = {axis.input: axis.limit for axis in law.axes} if law else {}
    return FlyChoice(
        name=vehicle.name,
        title=vehicle.title,
        note=vehicle.note,
        own=own,
        gusts=bool(vehicle.gusts),
        inputs=[
            FlyInput(
                hand=hand,  # type: ignore[arg-type]
                name=name,
                unit=units[name],
                reach=abs(most),
                law_limit=limits.get(name),
            )
            for hand, (name, most) in vehicle.travel.items()
        ],
        outputs={name: units[name] for name in model.outputs},
        law=vehicle.law,
        law_sensors=list(law.sensors) if law else [],
        rate_hz=vehicle.rate_hz,
    )
