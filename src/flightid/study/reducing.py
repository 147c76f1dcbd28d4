"""What a study file may say about the reduction of its models' structures."""

from __future__ import annotations

from dataclasses import field, replace
from typing import cast

from flightid.frozen import dataclass
from flightid.identification.reduction.reduce import AFTER_RISE
from flightid.identification.reduction.rules import ReductionLimits
from flightid.options import Options, option
from flightid.study.reading import TableReader, read_each


@dataclass(frozen=True)
class ReduceSettings(Options):
    """How structures are reduced; see `flightid.reduce`.

    Attributes
    ----------
    limits : ReductionLimits
        Guides that a parameter must meet to stay.
    after_rise : {"stop", "next"}
        What follows a step whose cost rises markedly.
    rough : bool
        The path needs neither intervals nor corrections of bias: the reduced structure is fitted
        once more with both.
    keep, drop : tuple of str
        Parameters that stay, or go first; each model says its own.
    """

    limits: ReductionLimits = field(default_factory=ReductionLimits)
    after_rise: str = option(
        AFTER_RISE[0], choices=AFTER_RISE, doc="What follows a step whose cost rises markedly."
    )
    rough: bool = option(False, doc="Steps without intervals, one full fit at the end.")
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()


def read_reduce(reader: TableReader) -> ReduceSettings:
    """Read the table ``[reduce]``.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    """
    limits, made = read_each((ReductionLimits, ReduceSettings), reader)
    return replace(cast("ReduceSettings", made), limits=limits)
