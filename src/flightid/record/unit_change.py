"""Channels of a record in other units, trim values included."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.errors import UnitError
from flightid.record.channel import Channel
from flightid.record.samples import LabelledSamples
from flightid.units import convert

Converted = tuple[dict[str, NDArray[np.float64]], list[Channel], dict[str, float]]


def in_units(record: LabelledSamples, units: Mapping[str, str]) -> Converted:
    """Samples of the named channels, all channels, and trim values, in other units.

    Raises
    ------
    UnitError
        A dimension differs; the message names channel and record.
    """
    samples: dict[str, NDArray[np.float64]] = {}
    trim, channels = record.trim, record.channels
    for key, unit in units.items():
        old = channels[key]
        try:
            samples[key] = convert(record[key], old.unit, unit)
        except UnitError as error:
            raise UnitError(
                f"channel {key} of record {record.name!r} cannot be converted: {error.problem}",
                found=error.found,
                needed=error.needed,
                action=error.action or "say what the channel holds by units where it is read",
            ) from error
        if key in trim:
            trim[key] = float(convert(trim[key], old.unit, unit))
        channels[key] = Channel(key, unit, old.role, old.note)
    return samples, list(channels.values()), trim
