"""What a study file may say about the reduction of its models' structures."""

from __future__ import annotations

from dataclasses import dataclass, fields

from flightid.identification.reduction.reduce import AFTER_RISE
from flightid.identification.reduction.rules import ReductionLimits
from flightid.study.reading import TableReader


@dataclass(frozen=True)
class ReduceSettings:
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

    limits: ReductionLimits
    after_rise: str
    rough: bool = False
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()


def read_reduce(reader: TableReader) -> ReduceSettings:
    """Read the table ``[reduce]``.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    """
    usual = ReductionLimits()
    limits = ReductionLimits(
        **{
            each.name: reader.positive(each.name, getattr(usual, each.name))
            for each in fields(usual)
        }
    )
    after_rise = reader.choice("after_rise", AFTER_RISE, AFTER_RISE[0])
    rough = reader.flag("rough", False)
    reader.finish()
    return ReduceSettings(limits, after_rise, rough)
