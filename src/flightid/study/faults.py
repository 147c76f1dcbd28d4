"""What fails after the fits: it is named, and all that was found before it stands."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field
from typing import Any, TypeVar

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.report.content import Block, Lights, Section

Value = TypeVar("Value")
CODE = "part-failed"
TUNING = "tuning"
"""The part that the answer of a study tells itself."""
FAILED = " could not be made: "


@dataclass
class Faults:
    """Parts of a study that could not be made, with the reason for each.

    Attributes
    ----------
    findings : list of Finding
        One for each part, in the order of the work.

    Example
    -------
    >>> faults = Faults()
    >>> faults.spare("the ratio", lambda: 1 / 0, 0.0)
    0.0
    >>> print(faults.findings[0].message)
    the ratio could not be made: ZeroDivisionError: division by zero
    """

    findings: list[Finding] = field(default_factory=list)

    def spare(
        self,
        what: str,
        work: Callable[..., Value],
        instead: Value,
        *inputs: Any,  # noqa: ANN401 - whatever the work takes
    ) -> Value:
        """Result of a part of the work, or what stands in its place.

        Parameters
        ----------
        what : str
            Name of the part.
        work : callable
        instead : object
            In place of a part that fails.
        *inputs
            Of `work`.

        Returns
        -------
        object
        """
        try:
            return work(*inputs)
        except Exception as error:
            self.findings.append(_named(what, error))
            return instead


def tuning_fault(faults: Iterable[Finding]) -> Finding | None:
    """Why there are no gains, with what to do, where they were asked for and could not be made."""
    start = TUNING + FAILED
    for each in faults:
        if each.message.startswith(start):
            why, _, action = each.message.removeprefix(start).partition(". Next: ")
            action = each.action or action.removesuffix(".")
            return Finding("gains", Light.RED, f"no gains: {why}", action)
    return None


def other_faults(faults: Iterable[Finding]) -> tuple[Finding, ...]:
    """What failed besides the gains."""
    return tuple(each for each in faults if not each.message.startswith(TUNING + FAILED))


def blocks_until(
    title: str,
    make: Callable[..., Iterable[Block]],
    *inputs: Any,  # noqa: ANN401 - whatever the page takes
) -> tuple[Block, ...]:
    """Blocks of a page up to one that cannot be made, which is named in its place.

    Parameters
    ----------
    title : str
        Of the section that holds them.
    make : callable
        Gives the blocks.
    *inputs
        Of `make`.

    Returns
    -------
    tuple of Block
    """
    made: list[Block] = []
    try:
        made.extend(make(*inputs))
    except Exception as error:
        made.append(Lights((_named(f"“{title}”", error),)))
    return tuple(made)


def section_of(
    title: str,
    make: Callable[..., Iterable[Block]],
    *inputs: Any,  # noqa: ANN401 - whatever the page takes
) -> Section:
    """A section of a report with the blocks that can be made; see `blocks_until`."""
    return Section(title, blocks_until(title, make, *inputs))


def whole_section(
    title: str,
    make: Callable[..., Section],
    *inputs: Any,  # noqa: ANN401 - whatever the page takes
) -> Section:
    """A section that another page makes whole, or one of this title that names what failed."""
    try:
        return make(*inputs)
    except Exception as error:
        return Section(title, (Lights((_named(f"“{title}”", error),)),))


def _named(what: str, error: Exception) -> Finding:
    known = isinstance(error, FlightidError)
    reason = str(error) if known else f"{type(error).__name__}: {error}"
    action = "" if known else "report this fault of flightid; the rest of the study stands"
    return Finding(CODE, Light.RED, f"{what}{FAILED}{reason}", action)
