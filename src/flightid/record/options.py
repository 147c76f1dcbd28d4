"""Options of reading records from tables; see `flightid.read_records`."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.record.hold import HOLDS, InputHold
from flightid.record.interpolation import Interpolation

RECORD_COLUMN = "record"
"""Column that tells records of one file apart, where none is named."""


@dataclass(frozen=True)
class ComparedOptions(Options):
    """Which outputs of records are compared.

    Example
    -------
    >>> ComparedOptions(outputs=("p",)).to_dict()
    {'outputs': ['p']}
    """

    outputs: tuple[str, ...] | None = option(None, doc="Channels that answer; default: all.")


@dataclass(frozen=True)
class ChannelOptions(ComparedOptions):
    """Which channels of records are used.

    Example
    -------
    >>> ChannelOptions(inputs=("lat",)).to_dict()["inputs"]
    ['lat']
    """

    inputs: tuple[str, ...] | None = option(None, doc="Channels that drive; default: all.")


@dataclass(frozen=True)
class InputOptions(Options):
    """What is known of the inputs of records; see `Record.declare`.

    Example
    -------
    >>> InputOptions(hold="zero").to_dict()
    {'hold': 'zero'}
    """

    hold: InputHold | None = option(
        None,
        choices=HOLDS,
        doc="What inputs do between samples; default: what the records know. Kept with results.",
    )


@dataclass(frozen=True, kw_only=True)
class TableOptions(Options):
    """How a table (CSV, Parquet, MATLAB, netCDF) becomes channels on one time base.

    Example
    -------
    >>> TableOptions(sample_time_s=0.01).to_dict()["sample_time_s"]
    0.01
    """

    time_column: str | None = option(
        None, doc="Column of the time stamps; default: time, else the one named so that rises."
    )
    time_unit: str | None = option(None, doc="Unit of the stamps, where the file does not say.")
    units: Mapping[str, str] = option(
        default_factory=dict, doc="Unit of a channel or column where the file says none: p=rad/s."
    )
    column_names: tuple[str, ...] = option(
        (), doc="Columns in their order, such as time,u,y, where the file has no headings."
    )
    derive: Mapping[str, str] = option(
        default_factory=dict, doc="Formula of a further channel, such as roll=m1+m4-m2-m3."
    )
    interpolation: str | Mapping[str, str] | None = option(
        None, choices=[each.value for each in Interpolation],
        doc="Between samples of a new grid, for all channels or by channel.",
    )  # fmt: skip
    sample_time_s: float | None = option(
        None, unit="s", above=0.0, doc="Sample time of a table without time column."
    )
    resample_to_s: float | None = option(
        None, unit="s", above=0.0, doc="Sample time of a new uniform grid."
    )
    max_gap_s: float | None = option(
        None, unit="s", above=0.0, doc="Longest gap that the new grid bridges with straight lines."
    )
    join: tuple[str, ...] = option(
        (), doc="File with a clock of its own, a flight log too, whose channels join those here."
    )
    join_on: str | None = option(
        None, doc="Column of both files, or HERE=THERE, whose correlation tells the clocks' offset."
    )
    clock_offset_s: float | None = option(
        None, unit="s", doc="Stamp here of zero on the clock of the joined file."
    )
    join_time_column: str | None = option(
        None, doc="Column of the stamps in the joined file; default: found as that of this one."
    )
    join_time_unit: str | None = option(
        None, doc="Unit of the joined file's stamps, where their name does not say."
    )


@dataclass(frozen=True, kw_only=True)
class ReadOptions(TableOptions):
    """How tables are read, those of several records too.

    Example
    -------
    >>> ReadOptions().to_dict()["record_column"]
    'record'
    """

    record_column: str | None = option(
        RECORD_COLUMN, doc="Column that tells records of one table apart."
    )
