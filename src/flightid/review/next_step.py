"""Which file of stepped gains a log flew, which comes next, and which takes it back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from flightid.control.autopilots.parameter_files import ROLLBACK, WRITERS, read_parameters
from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.findings import Finding
from flightid.frozen import dataclass

SAME = 1e-4
"""Relative difference of gains that went through single precision and a ground station."""
SUFFIXES = tuple(suffix for suffix, _ in WRITERS.values())


@dataclass(frozen=True)
class FlownStep:
    """A step that a log flew.

    Attributes
    ----------
    flown : Path
    following, back : Path or None
        The next step, and what takes this one back; None where there is no such file.
    """

    flown: Path
    following: Path | None
    back: Path | None

    def finding(self, *, kept: bool | None, log: str = "this log") -> Finding:
        """What to do after this step, by whether the flight kept its promise; None: in part."""
        said = f"{log} flew {self.flown.name}"
        if kept is None:
            return Finding(
                "step-not-judged", Light.UNKNOWN, f"{said}; not all that it promised was judged",
                "fly these gains again as asked for above before the next step",
            )  # fmt: skip
        if not kept:
            back = "the gains before it" if self.back is None else str(self.back)
            return Finding("step-back", Light.AMBER, f"{said}, and not as promised", f"load {back}")
        if self.following is None:
            return Finding("last-step", Light.GREEN, f"{said}, the last step: you have arrived")
        action = f"fly {self.following} next, log, and compare again"
        return Finding("next-step", Light.GREEN, said, action)

    def unjudged(self, log: str) -> Finding:
        """That two flights do not say whether a step kept its promise, and what does."""
        said = f"{log} flew {self.flown.name}; what models promised of it is not held against it"
        action = f"flightid compare STUDY-output {log}, of the study that made these gains"
        return Finding("step-not-judged", Light.UNKNOWN, said, action)


def flown_step(folders: Iterable[Path], parameters: Mapping[str, float]) -> FlownStep | None:
    """The file of gains in these folders whose values a log holds, the latest step first.

    Parameters
    ----------
    folders : iterable of Path
    parameters : mapping of str to float
        Of the log.

    Returns
    -------
    FlownStep or None
        None where no file beside its rollback holds what flew.

    Example
    -------
    >>> flown_step([], {}) is None
    True
    """
    for folder in dict.fromkeys(folders):
        files = [path for path in folder.iterdir() if path.suffix in SUFFIXES]
        for path in sorted(files, key=_number, reverse=True):
            back = path.with_name(path.stem + ROLLBACK + path.suffix)
            if back.exists() and _holds(path, parameters):
                named = re.fullmatch(r"(.*)-(\d+)", path.stem)
                after = named and path.with_name(f"{named[1]}-{int(named[2]) + 1}{path.suffix}")
                return FlownStep(path, after if after and after.exists() else None, back)
    return None


def _number(path: Path) -> int:
    digits = re.search(r"-(\d+)$", path.stem)
    return int(digits[1]) if digits else 0


def _holds(path: Path, parameters: Mapping[str, float]) -> bool:
    try:
        wanted = read_parameters(path)
    except (FileFormatError, OSError):
        return False
    return bool(wanted) and all(
        name in parameters and math.isclose(parameters[name], value, rel_tol=SAME, abs_tol=1e-9)
        for name, value in wanted.items()
    )
