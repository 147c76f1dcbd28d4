"""Which file of stepped gains a log flew, which comes next, and which takes it back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from flightid.control.autopilots.parameter_files import ROLLBACK, WRITERS, read_parameters
from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.findings import Finding
from flightid.frozen import dataclass

if TYPE_CHECKING:
    from flightid.review.comparison import FlightComparison

STICK = "{} stick"
SAME = 1e-4
"""Relative difference of gains that went through single precision and a ground station."""
NOTHING: Mapping[str, str] = MappingProxyType({})
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

    def finding(
        self,
        *,
        kept: bool | None,
        to_fly: Mapping[str, str] = NOTHING,
        log: str = "LOG",
        again: str = "compare again",
        swept: bool = False,
        otherwise: Sequence[str] = (),
    ) -> Finding:
        """What to do after this step, and with what command it goes on.

        Parameters
        ----------
        kept : bool or None
            Whether the flight kept its promise; None: in part.
        to_fly : mapping of str to str
            Loops that it left unjudged, with what to fly for each; see `left_to_fly`.
        log : str
        again : str
            Command that compares the promise with the next log.
        swept : bool
            Whether the log holds sweeps that carry models, so that they can be made anew.
        otherwise : sequence of str
            What was set otherwise than the models promised for: no reason to go back.
        """
        said = f"{log} flew {self.flown.name}"
        anew = f"flightid {'tune' if swept else 'plan'} {log}"
        if otherwise and kept is not True:
            names = ", ".join(otherwise)
            said += f" with other settings than were promised for ({names}): not judged"
            action = f"set {names} as before and fly {self.flown} again, then {again}; to keep "
            action += f"what is set, make models anew: {anew}"
            return Finding("step-not-judged", Light.UNKNOWN, said, action)
        if kept is False:
            back = "the gains before it" if self.back is None else str(self.back)
            why = "its sweeps tell" if swept else "further sweeps will tell"
            action = f"load {back}; what the models missed {why}: {anew}"
            return Finding("step-back", Light.AMBER, f"{said}, and not as promised", action)
        if to_fly:
            said += f"; what was judged is as promised, not judged: {', '.join(to_fly)}"
            flights = "; ".join(_joined(to_fly))
            action = f"load {self.flown} and {flights}; then {again}"
            return Finding("step-not-judged", Light.UNKNOWN, said, action)
        if kept is None:
            said += "; nothing of what models promised of it could be judged"
            action = f"{again}, with models whose errors are known"
            return Finding("step-not-judged", Light.UNKNOWN, said, action)
        if self.following is None:
            return Finding("last-step", Light.GREEN, f"{said}, the last step: you have arrived")
        action = f"fly {self.following} next, log, then {again}"
        return Finding("next-step", Light.GREEN, f"{said}, as promised", action)


def left_to_fly(promise: FlightComparison) -> dict[str, str]:
    """Loops that a flight leaves unjudged of what models promised, with what to fly for each.

    Parameters
    ----------
    promise : FlightComparison
        Of `flightid.compare_with_promise`.
    """
    if promise.set_otherwise:
        return {}  # Those settings come first.
    judged = {each.loop for each in promise.changes if each.chance is not None}
    flown = {loop.name: loop.action for loop in promise.after}
    promised = [loop.name for loop in promise.before if loop.name not in judged]
    return {name: flown[name] for name in promised if flown.get(name)}


def _joined(to_fly: Mapping[str, str]) -> Iterator[str]:
    """What to fly, in one sentence of all axes for which it is alike."""
    sticks: dict[str, list[str]] = {}
    for name, action in to_fly.items():
        axis = name.split()[0]
        sticks.setdefault(action.replace(f"{axis} stick", STICK), []).append(axis)
    for action, axes in sticks.items():
        yield action.replace(STICK, f"{' and '.join(dict.fromkeys(axes))} stick")


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
