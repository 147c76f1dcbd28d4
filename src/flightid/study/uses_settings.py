"""What a study file may say about the use of its models: files, rotor physics, closed loops."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flightid.control.closed_loop.close_loop import DRAWS
from flightid.dynamics.rotor.options import RotorOptions
from flightid.errors import StudyError
from flightid.export.options import FORMATS
from flightid.export.to_file import format_of
from flightid.options import Options
from flightid.study.loop_blocks import made_block
from flightid.study.reading import TableReader, read_each


@dataclass(frozen=True)
class ExportSettings:
    """One file of another tool; see `flightid.export`.

    Attributes
    ----------
    model : str
        Name of the study's model.
    file : str
        Name of the file, in the folder ``export`` of the output; left out: the model's, as C.
    format : str
    options : Options
        Of the format.
    """

    model: str
    file: str
    format: str = "c"
    options: Options = field(default_factory=Options)


@dataclass(frozen=True)
class RotorSettings:
    """Rotor physics of one model; see `flightid.rotor_physics`.

    Attributes
    ----------
    model : str
    options : RotorOptions
    """

    model: str
    options: RotorOptions


@dataclass(frozen=True)
class LoopSettings:
    """Feedback closed around one model; see `flightid.close_loop`.

    Attributes
    ----------
    name : str
        Title in the report.
    model : str
    gains : mapping of str to mapping of str to float
        Negative feedback by input and output; empty where the controller is made of blocks.
    blocks : tuple of mapping
        Blocks of the controller: ``kind``, a function of `flightid.loops`, and its arguments.
    band_rad_s : tuple of float or None
        Where margins are looked for.
    outside : tuple of str
        Set-points that the gains read.
    draws, seed : int
        Vehicles drawn from the fit's uncertainty.
    """

    name: str
    model: str
    gains: Mapping[str, Mapping[str, float]]
    blocks: tuple[Mapping[str, Any], ...] = ()
    band_rad_s: tuple[float, float] | None = None
    outside: tuple[str, ...] = ()
    draws: int = DRAWS
    seed: int = 0


@dataclass(frozen=True)
class UsesSettings:
    """Everything that is done with fitted models.

    Attributes
    ----------
    exports : tuple of ExportSettings
    rotor : RotorSettings or None
    loops : tuple of LoopSettings
    """

    exports: tuple[ExportSettings, ...] = ()
    rotor: RotorSettings | None = None
    loops: tuple[LoopSettings, ...] = ()


def read_uses(root: TableReader, models: Sequence[str]) -> UsesSettings:
    """Check the tables ``[[export]]``, ``[rotor]`` and ``[[loop]]``.

    Parameters
    ----------
    root : TableReader
        The whole study file.
    models : sequence of str
        Names of its models.

    Raises
    ------
    StudyError
        A key is unknown, a value does not fit, or there is no such model.
    """
    made = UsesSettings(
        tuple(map(_export, root.tables("export"))),
        root.maybe(lambda key: _rotor(root.table(key)), "rotor"),
        tuple(map(_loop, root.tables("loop"))),
    )
    rotor = () if made.rotor is None else (made.rotor,)
    for each in (*made.exports, *rotor, *made.loops):
        if each.model not in models:
            raise StudyError(
                "study file: there is no such model to use",
                found=repr(each.model),
                needed="one of " + ", ".join(map(repr, models)),
            )
    for what, names in (
        ("[[export]]s write one file", [each.file for each in made.exports]),
        ("[[loop]]s have one name", [each.name for each in made.loops]),
    ):
        if len(set(names)) < len(names):
            raise StudyError(f"study file: two {what}", found=", ".join(names))
    return made


def _export(reader: TableReader) -> ExportSettings:
    model = reader.text("model")
    file = reader.maybe(reader.text, "path") or f"{re.sub(r'[^0-9A-Za-z]+', '_', model)}.c"
    if "/" in file or "\\" in file or file.startswith("."):
        raise reader.error("path", "does not fit", found=file, needed="a name without a folder")
    format = format_of(Path(file), reader.maybe(reader.text, "format"))
    (options,) = read_each([FORMATS[format]], reader)
    return ExportSettings(model, file, format, options)


def _rotor(reader: TableReader) -> RotorSettings:
    model = reader.text("model")
    (options,) = read_each((RotorOptions,), reader)
    return RotorSettings(model, options)


def _loop(reader: TableReader) -> LoopSettings:
    gains = reader.table("gains")
    by_input: dict[str, dict[str, float]] = {}
    for name, row in reader.values("gains").items():
        of_input = gains.table(name)
        by_input[name] = {output: of_input.number(output) for output in dict(row)}
    blocks = tuple(each.rest() for each in reader.tables("block"))
    for each in blocks:
        made_block(each)
    if bool(by_input) == bool(blocks):
        needed = "gains by input and output, or [[loop.block]]s"
        problem = "stands beside blocks" if blocks else "is missing"
        found = "both" if blocks else "none"
        raise reader.error("gains", problem, found=found, needed=needed)
    made = LoopSettings(
        reader.text("name"),
        reader.text("model"),
        by_input,
        blocks,
        reader.maybe(reader.interval, "band_rad_s"),
        reader.names("outside", ()),
        reader.integer("draws", DRAWS, minimum=1),
        reader.integer("seed", 0),
    )
    reader.finish()
    return made
