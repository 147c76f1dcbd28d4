"""Options of taking a part of a flight log as a record; see `Log.record`."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class PartOptions(Options):
    """Which part of a log or of a record is used.

    Example
    -------
    >>> PartOptions(sid_run=0).to_dict()
    {'span_s': None, 'sid_run': 0}
    """

    span_s: tuple[float, float] | None = option(
        None, unit="s", doc="First and last instant, on the clock of the log or record."
    )
    sid_run: int | None = option(
        None, minimum=0, doc="Number of the system-identification run in a log."
    )
