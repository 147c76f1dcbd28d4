"""Write ArduPilot DataFlash logs from columns: for simulation, tests and examples."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, OptionError, ShapeError, UnknownNameError
from flightid.files import write_atomically
from flightid.logs.dataflash.layout import MessageLayout, standard_tables, stored

STAMP = "TimeUS"


class DataflashWriter:
    """Collect columns and write them as a DataFlash log, merged by time.

    The log is complete: FMT, UNIT, MULT and FMTU rows of every type it holds, then parameters,
    then everything in order of time. Rows with the same stamp keep the order in which they were
    added. Layouts are those of ArduPilot 4.7; `define` adds others.

    Example
    -------
    >>> import tempfile
    >>> import numpy as np
    >>> import flightid as fid
    >>> writer = DataflashWriter()
    >>> writer.message(0, "ArduCopter V4.7.0 (example)")
    >>> writer.parameter("ATC_RAT_RLL_P", 0.135)
    >>> time_us = np.arange(0, 1_000_000, 2500)
    >>> writer.add("RATE", time_us, {"R": np.sin(time_us / 1e6), "ROut": 0.1})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log = fid.read_log(writer.write(f"{folder}/flight.bin"))
    >>> log.vehicle, log.table("RATE"), log.parameters
    ('copter', LogTable(RATE, 400 rows x 14, 400 Hz), {'ATC_RAT_RLL_P': 0.135...})
    """

    def __init__(self) -> None:
        self._units, self._multipliers, layouts = standard_tables()
        self._layouts = dict(layouts)
        self._blocks: list[tuple[NDArray[np.uint64], NDArray[np.void]]] = []
        self._used: dict[str, None] = {}
        self._parameters: list[tuple[int | None, str, float, float]] = []

    def define(self, layout: MessageLayout) -> None:
        """Add a message type, or replace a standard one that holds no rows yet.

        Raises
        ------
        OptionError
            The name holds rows already, or the type number is taken.
        """
        taken = {other.type: name for name, other in self._layouts.items()}
        if layout.name in self._used or taken.get(layout.type, layout.name) != layout.name:
            raise OptionError(
                f"message {layout.name!r} cannot be defined",
                found=f"type {layout.type} of message {taken.get(layout.type, layout.name)}",
                needed="a name without rows and a free type number",
            )
        self._layouts[layout.name] = layout

    def add(self, name: str, time_us: ArrayLike, columns: Mapping[str, object]) -> None:
        """Add rows of one message type.

        Parameters
        ----------
        name : str
            Message, for example ``"RATE"``.
        time_us : array_like of int, shape (n_rows,)
            Stamps on the autopilot's clock, µs.
        columns : mapping of str to array_like
            Values by field, shape (n_rows,) or one value for all rows, in the unit of
            `LogTable` (physical, not stored: multipliers are applied here). Fields left out are 0,
            as the autopilot writes for what it does not measure.

        Raises
        ------
        UnknownNameError
            There is no such message or field.
        ShapeError
            A column does not have one value a row.
        DataError
            Stamps are not whole and non-negative, or a value does not fit its storage.
        """
        layout = self._layout(name)
        stamps = _stamps(time_us)
        rows = layout.empty(stamps.size)
        rows[STAMP] = stamps
        for field, values in columns.items():
            if field not in layout.labels or field == STAMP:
                raise UnknownNameError(
                    f"message {name} has no such field to fill",
                    found=field,
                    needed="one of " + ", ".join(layout.labels[1:]),
                )
            storage = rows.dtype[field]
            divisor = layout.divisor(field, self._multipliers)
            content = stored(values, storage, divisor, f"{name}.{field}")
            try:
                rows[field] = content
            except ValueError as error:
                raise ShapeError(
                    f"column {name}.{field} does not fit its stamps",
                    found=f"shape {content.shape}",
                    needed=f"shape {rows[field].shape} or one value",
                ) from error
        self._blocks.append((stamps, rows))
        self._used[name] = None

    def parameter(
        self, name: str, value: float, *, default: float | None = None, time_us: int | None = None
    ) -> None:
        """Add a parameter value.

        Parameters
        ----------
        name : str
            Parameter, at most 16 characters.
        value : float
            Value; the log keeps single precision.
        default : float, optional
            The firmware's default; default: `value`.
        time_us : int, optional
            Stamp of a change in flight, µs; default: at the beginning of the log.
        """
        self._parameters.append((time_us, name, value, value if default is None else default))

    def message(self, time_us: int, text: str) -> None:
        """Add a text message of at most 64 bytes."""
        self.add("MSG", [time_us], {"Message": [text]})

    def to_bytes(self) -> bytes:
        """The whole log.

        Returns
        -------
        bytes

        Raises
        ------
        DataError
            Nothing was added.
        """
        blocks = self._parameter_blocks() + self._blocks
        if not blocks:
            raise DataError("there is nothing to write", needed="at least one row or parameter")
        first_us = min(int(stamps.min()) for stamps, _ in blocks if stamps.size)
        names = [*self._used, *(["PARM"] if self._parameters else [])]
        return self._head(list(dict.fromkeys(names)), first_us) + _merged(blocks)

    def write(self, path: str | Path) -> Path:
        """Write the log, whole or not at all.

        Returns
        -------
        Path
            `path`.

        Raises
        ------
        DataError
            Nothing was added.
        OSError
            The folder is missing or cannot be written.
        """
        return write_atomically(path, self.to_bytes())

    def _layout(self, name: str) -> MessageLayout:
        layout = self._layouts.get(name)
        if layout is None or layout.labels[0] != STAMP:
            known = [key for key, other in self._layouts.items() if other.labels[0] == STAMP]
            raise UnknownNameError(
                "there is no such message to write",
                found=name,
                needed="one of " + ", ".join(known),
                action="add its layout with DataflashWriter.define",
            )
        return layout

    def _parameter_blocks(self) -> list[tuple[NDArray[np.uint64], NDArray[np.void]]]:
        """Parameters as rows: those without a stamp stand at the beginning."""
        if not self._parameters:
            return []
        layout = self._layouts["PARM"]
        first = min((int(stamps.min()) for stamps, _ in self._blocks if stamps.size), default=0)
        given, names, values, defaults = zip(*self._parameters, strict=True)
        stamps = _stamps([first if stamp is None else stamp for stamp in given])
        rows = layout.empty(stamps.size)
        rows[STAMP] = stamps
        rows["Name"] = stored(names, rows.dtype["Name"], 1.0, "PARM.Name")
        rows["Value"], rows["Default"] = values, defaults
        return [(stamps, rows)]

    def _head(self, used: list[str], first_us: int) -> bytes:
        """FMT of every type, then the unit and multiplier tables and their use by each type."""
        names = [*dict.fromkeys(["FMT", "UNIT", "MULT", "FMTU", *used])]
        layouts = [self._layouts[name] for name in names]
        formats = self._rows(
            "FMT",
            Type=[layout.type for layout in layouts],
            Length=[layout.dtype.itemsize for layout in layouts],
            Name=[layout.name.encode() for layout in layouts],
            Format=[layout.format.encode() for layout in layouts],
            Columns=[layout.columns.encode() for layout in layouts],
        )
        units = self._rows(
            "UNIT",
            TimeUS=first_us,
            Id=[ord(key) for key in self._units],
            Label=[label.encode() for label in self._units.values()],
        )
        multipliers = self._rows(
            "MULT",
            TimeUS=first_us,
            Id=[ord(key) for key in self._multipliers],
            Mult=list(self._multipliers.values()),
        )
        uses = self._rows(
            "FMTU",
            TimeUS=first_us,
            FmtType=[layout.type for layout in layouts],
            UnitIds=[layout.units.encode() for layout in layouts],
            MultIds=[layout.multipliers.encode() for layout in layouts],
        )
        return b"".join(rows.tobytes() for rows in (formats, units, multipliers, uses))

    def _rows(
        self, name: str, **columns: list[int] | list[float] | list[bytes] | int
    ) -> NDArray[np.void]:
        n_rows = max(len(values) for values in columns.values() if isinstance(values, list))
        rows = self._layouts[name].empty(n_rows)
        for label, values in columns.items():
            rows[label] = values
        return rows


def _stamps(time_us: ArrayLike) -> NDArray[np.uint64]:
    given = np.atleast_1d(np.asarray(time_us))
    whole = np.rint(given) if given.dtype.kind == "f" else given
    if (
        given.ndim != 1
        or given.dtype.kind not in "iuf"
        or not np.all((whole == given) & (given >= 0))
    ):
        raise DataError(
            "stamps cannot be logged",
            found=f"{given.dtype} of shape {given.shape}",
            needed="whole, non-negative microseconds, one-dimensional",
        )
    return whole.astype(np.uint64)


def _merged(blocks: list[tuple[NDArray[np.uint64], NDArray[np.void]]]) -> bytes:
    """Rows of all blocks in order of time: each row is copied to its place in the file."""
    stamps = np.concatenate([block for block, _ in blocks])
    sizes = np.concatenate([np.full(rows.size, rows.dtype.itemsize) for _, rows in blocks])
    order = np.argsort(stamps, kind="stable")
    places = np.empty(stamps.size, np.int64)
    ends = np.cumsum(sizes[order])
    places[order] = ends - sizes[order]
    content = np.empty(int(sizes.sum()), np.uint8)
    done = 0
    for _, rows in blocks:
        size = rows.dtype.itemsize
        # Every place at which a row may begin; numpy copies items whole, faster than byte by byte.
        begins = np.ndarray((content.size - size + 1,), f"V{size}", content, strides=(1,))
        begins[places[done : done + rows.size]] = rows.view(f"V{size}")
        done += rows.size
    return content.tobytes()
