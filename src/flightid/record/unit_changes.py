"""Which channels of a record are to be converted to the units of a model."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.record.samples import LabelledSamples
from flightid.units import canonical, is_convertible


def unit_changes(record: LabelledSamples, units: Mapping[str, str]) -> dict[str, str]:
    """Channels in another unit of the same dimension than is wanted, and that unit.

    Parameters
    ----------
    record : Record
    units : mapping of str to str
        Unit that is wanted, by channel; channels that the record lacks are passed over.

    Example
    -------
    >>> from flightid.record.record import Record
    >>> record = Record.from_arrays([0.0, 0.1], outputs={"w": [0.0, 1.0], "p": [0.0, 1.0]},
    ...                             units={"w": "kt", "p": "rad/s"})
    >>> unit_changes(record, {"w": "ft/s", "p": "rad/s"})
    {'w': 'ft/s'}
    """
    wanted = {name: canonical(unit) for name, unit in units.items() if name in record.channels}
    return {
        name: unit
        for name, unit in wanted.items()
        if record.unit(name) != unit and is_convertible(record.unit(name), unit)
    }
