"""What a study file may say about the use of its models: files, rotor physics, closed loops."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from flightid.control.closed_loop.close_loop import DRAWS
from flightid.control.laws.augmentation import augmentation_law
from flightid.dynamics.rotor.options import RotorOptions
from flightid.errors import OptionError, StudyError
from flightid.export.options import FORMATS
from flightid.export.to_file import format_of
from flightid.frozen import dataclass
from flightid.option_forms import NOTHING, SPAN
from flightid.options import Options, option
from flightid.study.loop_blocks import made_block
from flightid.study.reading import TableReader, read_own, read_table

LONGEST_NAME = 255


@dataclass(frozen=True)
class ExportSettings(Options):
    """One file of another tool: a table ``[[export]]``; see `flightid.export`."""

    model: str = option(doc="Name of the study's model.")
    path: str | None = option(
        None, doc="File in the folder 'export' of the output; default: the model's name, as C."
    )
    format: str | None = option(None, choices=FORMATS, doc="Default: by the file's suffix.")
    options: Options = field(default_factory=Options)

    def __post_init__(self) -> None:
        """Refuse a path that names no file before anything is computed."""
        super().__post_init__()
        parts = [""] if self.path is None else self.path.split("/")
        longest = max(len(part.encode()) for part in parts)
        if self.path == "" or longest > LONGEST_NAME or "\0" in "".join(parts):
            raise OptionError(
                "path of an export names no file",
                found=repr(self.path)[:60],
                needed=f"a name of 1 to {LONGEST_NAME} bytes, without NUL",
            )

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.path or f"{re.sub(r'[^0-9A-Za-z]+', '_', self.model)}.c"


@dataclass(frozen=True, kw_only=True)
class RotorSettings(RotorOptions):
    """Rotor physics of one model: the table ``[rotor]``; see `flightid.rotor_physics`."""

    model: str = option(doc="Name of the study's model.")


@dataclass(frozen=True)
class LoopSettings(Options):
    """Feedback closed around one model: a table ``[[loop]]``; see `flightid.close_loop`."""

    name: str = option(doc="Title in the report.")
    model: str = option(doc="Name of the study's model.")
    gains: Mapping[str, Mapping[str, float]] = option(
        default_factory=dict, doc="Negative feedback by input and output; or blocks."
    )
    block: tuple[Mapping[str, Any], ...] = option(
        (), doc="Blocks of the controller: kind, a function of flightid.loops, and its arguments."
    )
    augmentation: str | None = option(
        None, doc="Law in place of blocks: dase, or a TOML file of [[axis]] tables."
    )
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", forms=(SPAN, NOTHING), above=0.0, doc="Where margins are looked for."
    )
    outside: tuple[str, ...] = option((), doc="Set-points that the gains read.")
    draws: int = option(DRAWS, minimum=1, doc="Vehicles drawn from the fit's uncertainty.")
    seed: int = option(0, minimum=0, doc="Seed of the draws.")


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
    rotor = root.table("rotor")
    made = UsesSettings(
        tuple(map(_export, root.tables("export"))),
        read_table(RotorSettings, rotor) if "rotor" in root else None,
        tuple(map(_loop, root.tables("loop"))),
    )
    around = () if made.rotor is None else (made.rotor,)
    for each in (*made.exports, *around, *made.loops):
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
    made = read_own(ExportSettings, reader)
    file = made.file
    if "/" in file or "\\" in file or file.startswith("."):
        raise reader.error("path", "does not fit", found=file, needed="a name without a folder")
    format = format_of(Path(file), made.format)
    return replace(made, format=format, options=read_table(FORMATS[format], reader))


def _loop(reader: TableReader) -> LoopSettings:
    made = read_table(LoopSettings, reader)
    if made.augmentation is not None and not (made.gains or made.block):
        return replace(made, block=tuple(augmentation_law(made.augmentation).tables()))
    for each in made.block:
        made_block(each)
    if made.augmentation is not None or bool(made.gains) == bool(made.block):
        needed = "gains by input and output, or [[loop.block]]s, or augmentation"
        both = bool(made.gains and made.block)
        beside = made.augmentation is not None
        problem = "stands beside blocks" if both else "is missing"
        problem = "stands beside an augmentation" if beside and not both else problem
        found = "both" if both or beside else "none"
        raise reader.error("gains", problem, found=found, needed=needed)
    return made
