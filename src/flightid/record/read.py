"""`read_records`: a file of samples to records, with declared names, roles, units and time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.errors import OptionError, UnknownNameError
from flightid.files import sha256_of_file
from flightid.reading import of_file
from flightid.record.channel import DECLARED, Channel
from flightid.record.checks import fault_steps
from flightid.record.derived import sources_of, with_derived
from flightid.record.formats import ColumnTable, file_format
from flightid.record.formats.columns import channel_name, is_unit
from flightid.record.history import Step
from flightid.record.hold import InputHold, InputShape, Loop
from flightid.record.interpolation import Interpolation
from flightid.record.joined_files import with_files
from flightid.record.options import RECORD_COLUMN
from flightid.record.record import Record
from flightid.record.row_grids import ChannelColumn, RowGrid, listed
from flightid.record.rows import column_unit
from flightid.record.selection import (
    Names,
    channel_units,
    pairs_of,
    refuse_columns,
    selected_records,
)
from flightid.record.source_rows import SourceRows, moves
from flightid.record.stamps import mean_spacing_s
from flightid.record.tables import read_table
from flightid.record.time_columns import USUAL, row_stamps, with_time, with_time_unit
from flightid.record.validation import require_period
from flightid.table import Cell
from flightid.units import canonical
from flightid.version import VERSION

MOST_UNNAMED = 24
"""Columns with clocks of their own that are taken where none is named."""


def read_records(
    path: str | Path,
    inputs: Names | str | None = None,
    outputs: Names | str | None = None,
    *,
    excitations: Names | str | None = None,
    others: Names | str | None = None,
    time_column: str | None = None,
    time_unit: str | None = None,
    units: Mapping[str, str] | None = None,
    column_names: Sequence[str] = (),
    derive: Mapping[str, str] | None = None,
    sample_time_s: float | None = None,
    resample_to_s: float | None = None,
    max_gap_s: float | None = None,
    join: Sequence[str | Path | Record] = (),
    join_on: str | None = None,
    clock_offset_s: float | None = None,
    join_time_column: str | None = None,
    join_time_unit: str | None = None,
    interpolation: Interpolation | str | Mapping[str, Interpolation | str] | None = None,
    outliers: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    record_column: str | None = RECORD_COLUMN,
    hold: InputHold | None = None,
    period_s: float | None = None,
    loop: Loop | None = None,
) -> list[Record]:
    r"""Read records from CSV, Parquet, MATLAB .mat (level 5 to 7.3), netCDF or ROS bags.

    A file that `write_records` made comes back as it was; naming channels then selects and
    assigns roles. In any other file the time is the column `time_column`, else ``time``, else the
    one that is named as a time (``t_s``, ``TimeUS``, ``Time (s)``, ``elapsed`` …) and rises
    strictly; or `sample_time_s` is stated. Several that tell different times are an error. The
    history says which was taken. Rows fall into several records where the column `record_column`
    changes, where time starts again, or where it has a gap (a spacing above 2.5 median spacings).
    Text with semicolons or tabs may have decimal commas. Units come from
    headings such as ``p [rad/s]`` or ``p (deg/s)``, from a second row of units in CSV, from the
    file's metadata, else from the end of a name where it is certain (``u_mps``, ``q_dps``); `units`
    declares them, over all of those. Values are not converted.

    Columns of a bag (ROS 1 ``.bag``, ROS 2 ``.mcap``, ``.db3`` or their folder) are the numbers of
    its messages, ``/imu/angular_velocity.x``, each topic on its own stamps: those of the headers
    where they rise, else those of the recorder. They always go to one grid, that of the slowest
    input or output unless `resample_to_s` says another; the history tells both. A slash in a
    column's name is a point in its channel's: ``imu.angular_velocity.x``.

    Parameters
    ----------
    path : str or Path
        The file, or the folder of a bag.
    inputs, outputs, excitations, others : names or mapping of str to str, optional
        Columns by role, or one name; a mapping gives new names, channel to column. With none of
        the four, every numeric column becomes a channel of role "other".
    time_column : str, optional
        Column of the time stamps; in s unless its name, its heading, `time_unit` or `units` says
        otherwise.
    time_unit : str, optional
        Unit of the stamps, such as "ms".
    units : mapping of str to str, optional
        Unit by channel, by its column, or by the column of the time. It goes over what a heading
        says, and the channel's note says so; converting is `Record.to_units`.
    column_names : sequence of str
        Names of the columns in their order, in place of those of the file, which then need not have
        any; ``"time,u,y"`` is three. A unit may stand in brackets, as in a heading.
    derive : mapping of str to str, optional
        Further columns as formulas of others, such as ``{"roll": "m1 + m4 - m2 - m3"}``, in the
        grammar of model files; a later one may use those before it. Their units are those that the
        columns' units make, else declared.
    sample_time_s : float, optional
        Sample time of a file without time column, s; the first sample is at 0 s.
    resample_to_s : float, optional
        Sample time, s, of a new uniform grid; for stamps that are not uniform. Channels are
        low-passed where it is coarser than the rows by more than 5 %.
    max_gap_s : float, optional
        Longest spacing of rows that the new grid bridges with straight lines, s; longer ones part
        records. Default: 2.5 median spacings.
    join : sequence of path or Record
        Files with clocks of their own whose columns join those of this one, such as motion capture
        or a flight log's record; all channels then go to one grid, as those of a bag.
    join_on : str, optional
        Column that both files hold, ``"gyro=p"`` where it has two names: the offset of the clocks,
        and their drift where it shows, follow from its correlation, with an interval. A lag of
        either sensor is part of it.
    clock_offset_s : float, optional
        Stamp on this file's clock of zero on the joined one's, in place of `join_on`.
    join_time_column : str, optional
        Time column of the joined files; default: found as that of this one.
    join_time_unit : str, optional
        Unit of its stamps, such as "ms"; default: what its name or heading says, else as those
        here where both columns have one name, else s.
    interpolation : Interpolation or mapping of str to Interpolation, optional
        How samples of the new grid arise, for all channels or by name. Default: of inputs with
        `hold` "zero" the previous value, with "first" straight lines, of all else band-limited;
        inputs that were low-passed are band-limited afterwards, whatever they were.
    outliers : mapping of str to object, or sequence of such, optional
        Options ``deviations``, ``half_width`` and ``channels`` of
        `flightid.conditioning.remove_outliers`, carried out on the rows of each manoeuvre before
        anything is resampled: a filter would spread an outlier. Several, each for its channels, are
        a sequence.
    record_column : str, optional
        Column that tells manoeuvres apart, used if it is there; None: there is none.
    hold : {"zero", "first", "band_limited"}, optional
        What the inputs of the records do between samples: steps, straight lines, smooth. Default:
        what the file says, else unknown.
    period_s : float, optional
        Time after which the inputs repeat exactly, s.
    loop : {"open", "closed"}, optional
        Whether anything moved the inputs after what the outputs did; default: what the file says,
        else unknown.

    Returns
    -------
    list of Record
        One for each manoeuvre, in the order of the file.

    Raises
    ------
    FileFormatError
        The content is of no known format, damaged or too large.
    UnknownNameError
        A column that is not there.
    UnitError
        A unit that is not known, or against what a stored record says of itself.
    OptionError
        Time or its unit stated twice, or not at all; a channel named twice; a hold against the
        file's; not one name for each column; a formula that cannot be computed; names of columns
        or formulas for a file of `write_records`.
    DataError
        Samples that are not finite, stamps that are not uniform.

    Example
    -------
    >>> import tempfile
    >>> from flightid.files import write_atomically
    >>> text = "time,tau,p [deg/s]\n0,0.1,1\n0.5,0.2,2\n1.0,0.1,3\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_atomically(Path(folder) / "roll.csv", text)
    ...     read_records(path, inputs="tau", outputs="p")
    [Record('roll', 3 samples, 2 Hz, 1.5 s, inputs [tau], outputs [p])]
    """
    source = Path(path)
    kind = file_format(source)
    roles, derive = _roles(inputs, outputs, excitations, others), derive or {}
    asked = time_column if sample_time_s is None else time_column or USUAL
    named = _named_units(units, asked or USUAL, time_unit)
    stored = selected_records(source, kind, roles, named)
    if stored is not None:
        refuse_columns(source, column_names, derive)
        return [_declared(item, InputShape(hold, period_s, loop)) for item in stored]
    taken = {each for names in roles.values() for pair in pairs_of(names) for each in pair}
    table = read_table(source, kind, column_names)
    table, time_column = with_time(table, asked, taken, record=record_column)
    units = _named_units(units, time_column, time_unit, table.lengths)
    table = with_files(
        table, join, join_on=join_on, clock_offset_s=clock_offset_s, time_column=time_column,
        join_time_column=join_time_column, join_time_unit=join_time_unit, units=units,
        sample_time_s=sample_time_s,
    )  # fmt: skip
    table = with_derived(table, derive, units)
    shared = row_stamps(table, time_column, units, None if join else sample_time_s)
    wanted = _wanted(
        table, roles, units, time_column, record_column, shared.size,
        set(map(channel_name, sources_of(derive))),
    )  # fmt: skip
    read = SourceRows(table, shared, tuple(wanted))
    rows = read.rows()
    grid = RowGrid(
        read.wanted, resample_to_s, max_gap_s, interpolation, listed(outliers), hold, time_column,
        has_clocks=table.clock is not None,
    )  # fmt: skip
    options: dict[str, Cell] = {
        "file": source.name,
        "sha256": sha256_of_file(source),
        "time": time_column if shared.size and sample_time_s is None else None,
        "sample_time_s": sample_time_s,
        **read.said(join, column_names, derive),
    }
    records: list[Record] = []
    for part, label, beside in read.parts(record_column, split_gaps=resample_to_s is None):
        if shared.size and sample_time_s is None:
            options["time_unit"] = units.get(time_column) or table.units.get(time_column)
            options["row_spacing_s"] = mean_spacing_s(shared[part])
        history = (Step("read_records", dict(options), VERSION), *fault_steps(read.doubts(rows)))
        some = {name: (time_s[part], values[part]) for name, (time_s, values) in rows.items()}
        with of_file(source.name):
            for time_s, samples, more in grid.pieces(some, beside):
                name = label or source.stem
                records.append(_record(time_s, samples, wanted, name, (*history, *more)))
    records = _numbered(records)
    kept = grid.hold_after(rows)
    return [_declared(item, InputShape(kept, period_s, loop)) for item in records]


def _roles(
    inputs: Names | str | None,
    outputs: Names | str | None,
    excitations: Names | str | None,
    others: Names | str | None,
) -> dict[Role, Names | None]:
    """Channels by role."""
    groups = zip(
        (Role.INPUT, Role.OUTPUT, Role.EXCITATION, Role.OTHER),
        (inputs, outputs, excitations, others),
        strict=True,
    )
    return {role: (names,) if isinstance(names, str) else names for role, names in groups}


def _named_units(
    units: Mapping[str, str] | None,
    time_column: str,
    time_unit: str | None,
    columns: Container[str] = (),
) -> Mapping[str, str]:
    """Declared units by name of channel, and that of the time by its column."""
    given = (units or {}).items()
    names = {k if k == time_column else channel_name(k, columns): unit for k, unit in given}
    return with_time_unit(names, time_column, time_unit)


def _numbered(records: Sequence[Record]) -> list[Record]:
    """Records of one name get numbers."""
    total, seen = Counter(item.name for item in records), Counter[str | None]()
    named = []
    for item in records:
        alone = total[item.name] == 1
        named.append(item if alone else item.replace(name=f"{item.name}[{seen[item.name]}]"))
        seen[item.name] += 1
    return named


def _declared(record: Record, given: InputShape) -> Record:
    """The record with what is declared of its inputs; a file must not say otherwise."""
    known = record.input_shape
    if given.hold is not None and known.hold not in (None, given.hold):
        raise OptionError(
            f"the declared hold contradicts the file of record {record.name!r}",
            found=given.hold,
            needed=known.hold,
            action="leave it out, or replace what the file says",
        )
    shape = known.with_known(given)
    inputs = [record[name] for name in record.inputs]
    require_period(inputs, record.sample_time_s, given.period_s)
    return record if shape == known else record.replace(input_shape=shape)


def _note(table: ColumnTable, column: str, name: str, units: Mapping[str, str]) -> str:
    """Where samples and unit come from, where not from a column of that name."""
    notes = [] if name == column else [f"column {column}"]
    stated, declared = table.unit(column), units.get(name)
    by_name = column not in table.units
    if stated is None or not is_unit(stated):
        return ", ".join(notes)
    if declared is not None and canonical(stated) != canonical(declared):
        who = "its name" if by_name else "the file"
        notes.append(f"{DECLARED} {canonical(declared)}; {who} says {canonical(stated)}")
    elif by_name:
        notes.append(f"read as {canonical(stated)} from the heading {column}")
    return ", ".join(notes)


def _wanted(
    table: ColumnTable,
    roles: Mapping[Role, Names | None],
    units: Mapping[str, str],
    time: str,
    record: str | None,
    n_samples: int,
    sources: set[str],
) -> list[ChannelColumn]:
    pairs = [
        (role, *pair) for role, names in roles.items() for pair in pairs_of(names, table.lengths)
    ]
    if not pairs:
        pairs = [
            (Role.OTHER, channel_name(key, table.lengths), key)
            for key, length in table.lengths.items()
            if key not in (time, record)
            and (length == n_samples if table.clock is None else moves(table, key))
        ]
        if table.clock is not None and len(pairs) > MOST_UNNAMED:
            raise OptionError(
                f"{table.path.name} holds {len(pairs)} columns that move, with clocks of their own",
                found=", ".join(key for _, _, key in pairs[:8]) + ", …",
                needed="the channels that are meant, by name",
                action="name inputs and outputs; flightid inspect lists all columns",
            )
    names = [name for _, name, _ in pairs]
    if repeated := {name for name in names if names.count(name) > 1}:
        raise OptionError(
            "a channel is named twice", found=", ".join(sorted(repeated)), needed="one role each"
        )
    by_channel = channel_units(units, [pair[1:] for pair in pairs], table.lengths)
    for name in by_channel:
        if name not in (*names, *sources, time):
            raise UnknownNameError(
                "a unit is declared for no channel", found=name, needed="one of " + ", ".join(names)
            )
    pairs = [(role, name, table.require(column)) for role, name, column in pairs]
    return [
        ChannelColumn(
            Channel(
                name,
                column_unit(table, column, name, by_channel, default="1"),
                role,
                _note(table, column, name, by_channel),
            ),
            column,
        )
        for role, name, column in pairs
    ]


def _record(
    time_s: NDArray[np.float64],
    samples: Mapping[str, NDArray[np.float64]],
    wanted: Iterable[ChannelColumn],
    name: str,
    history: tuple[Step, ...],
) -> Record:
    channels = [item.channel for item in wanted]
    plain = Record.from_arrays(time_s, others=samples, name=name, history=history)
    return plain.replace(channels=channels)
