"""One record or several: what verbs take, as a tuple."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.errors import DataError
from flightid.record.record import Record


def as_records(records: object) -> tuple[Record, ...]:
    """The records that a verb was given: one, or any collection of them.

    Raises
    ------
    DataError
        Something that is no record, such as the model where arguments stand the wrong way round.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.5], outputs={"p": [0.1, 0.3]})
    >>> len(as_records(record)), len(as_records([record, record]))
    (1, 2)
    """
    if isinstance(records, Record):
        return (records,)
    items = tuple(records) if isinstance(records, Iterable) else (records,)
    for item in items:
        if not isinstance(item, Record):
            raise DataError(
                "records were expected here",
                found=type(item).__name__,
                needed="a Record, or several",
                action="give the model or fit first, then the records",
            )
    return items
