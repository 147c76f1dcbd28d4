"""Columns of a file that become no channel, and still tell the units of those that do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.record.channel import Channel
from flightid.record.formats import ColumnTable
from flightid.record.formats.columns import is_unit
from flightid.units import is_convertible

TURNS = ("rad", "rad/s")


def turning_columns(
    table: ColumnTable, taken: Mapping[str, Channel], n_samples: int
) -> list[tuple[Channel, NDArray[np.float64]]]:
    """Angles and rates that nobody takes, where an angle or a rate is taken.

    Parameters
    ----------
    table : ColumnTable
    taken : mapping of str to Channel
        Channels that become a record, by column.
    n_samples : int
        Rows; columns of another length are passed over.
    """
    if not any(_turns(channel.unit) for channel in taken.values()):
        return []
    names = {*taken, *(channel.name for channel in taken.values())}
    return [
        (Channel(column, unit, Role.OTHER), table.column(column))
        for column, length in table.lengths.items()
        if column not in names
        and length == n_samples
        and (unit := table.unit(column)) is not None
        and _turns(unit)
    ]


def _turns(unit: str) -> bool:
    return is_unit(unit) and any(is_convertible(unit, turn) for turn in TURNS)
