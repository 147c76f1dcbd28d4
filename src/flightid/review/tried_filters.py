"""Filters tried on a flight: what each axis would lose and gain, and the file that sets them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from flightid.control.autopilots import GainChange, write_parameters
from flightid.control.autopilots.parameter_files import ROLLBACK
from flightid.control.tuning.filter_choice import change_words
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.logs import Log
from flightid.result import Result
from flightid.review.edited_filters import EditedAxis, FilterBench, filter_bench
from flightid.review.filter_costs import filter_costs, unseen_noise
from flightid.table import Cell, Column, Table

NOTE = "flightid: filters tried on the noise of a flight"
BACK = "flightid: the way back; what the log does not hold is what firmware takes"


@dataclass(frozen=True, eq=False, repr=False)
class TriedFilters(Result, schema="flightid.tried_filters/1", untold={"kind": "of the log"}):
    """What edited filters would do to a vehicle that flew with others.

    Attributes
    ----------
    axes : tuple of EditedAxis
    at_hz : float
        Where phase counts.
    changes, back : tuple of GainChange
        Parameters that a file sets, and those of the way back; none where nothing differs.
    findings : tuple of Finding
        Phase and noise that they cost.
    kind : str
        Of the log.
    seen_hz : float
        Up to where the log shows noise; none above it is in these numbers.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                              # doctest: +SKIP
    >>> tried_filters(filter_bench(log), {"INS_GYRO_FILTER": 40.0})   # doctest: +SKIP
    TriedFilters(INS_GYRO_FILTER 80 → 40)
    """

    axes: tuple[EditedAxis, ...]
    at_hz: float
    changes: tuple[GainChange, ...]
    back: tuple[GainChange, ...]
    findings: tuple[Finding, ...]
    kind: str
    seen_hz: float

    def __repr__(self) -> str:
        """Changes on one line."""
        return f"TriedFilters({change_words(self.changes) or 'as flown'})"

    @property
    def is_flyable(self) -> bool:
        """Whether a file is made of them: no loop may be unstable with them."""
        return bool(self.changes) and worst(self.findings) is not Light.RED

    def summary(self) -> Table:
        """Phase and noise of each axis, flown and tried."""
        columns = (
            *(Column("axis"), Column("at", "Hz", 3), Column("phase flown", "deg", 4)),
            *(Column("tried", "deg", 4), Column("noise flown", "%", 3), Column("tried", "%", 3)),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                *(each.axis, self.at_hz, each.phase_flown_deg, each.phase_edited_deg),
                *(100.0 * each.noise_flown, 100.0 * each.noise_edited),
            )
            for each in self.axes
        ]
        note = "Phase of the controller with all of its filters; noise in percent of full command, "
        note += f"up to {self.seen_hz:.4g} Hz: half of the log's rate, beyond which it shows none."
        told = change_words(self.changes) or "As flown."
        return Table("Filters tried", columns, tuple(rows), (told, note))

    def write(self, path: Path) -> tuple[Path, Path]:
        """Write the parameter file and, beside it, the way back.

        Raises
        ------
        DataError
            Nothing differs from what flew, or a loop may be unstable with them.
        OSError
            The folder is missing or cannot be written.
        """
        if not self.is_flyable:
            raise DataError(
                "no file is made of these filters",
                found="; ".join(f.message for f in self.findings if f.light is Light.RED)
                or "the flown ones",
            )
        way_back = path.with_name(path.stem + ROLLBACK + path.suffix)
        # The way back first: a vehicle must never get new values without it.
        write_parameters(self.kind, self.back, way_back, notes=[BACK], overwrite=True)
        alone = [GainChange(each.name, each.value, None, _reason(each)) for each in self.changes]
        write_parameters(self.kind, alone, path, notes=[NOTE], overwrite=True)
        return path, way_back


def tried_filters(bench: FilterBench, values: Mapping[str, float]) -> TriedFilters:
    """Try filters on the bench of a flight.

    Parameters
    ----------
    bench : FilterBench
    values : mapping of str to float
        By the autopilot's names; the others stay as flown.

    Raises
    ------
    OptionError
        A parameter that is no filter of this vehicle, or a value without meaning.
    """
    axes = bench.edited(values)
    costs = filter_costs(axes, bench.at_hz, bench.margins_deg, measured=bench.measured)
    found = (*costs, *unseen_noise(bench.low_passes, values, bench.seen_hz))
    changes, back = bench.changes(values), bench.way_back(values)
    return TriedFilters(axes, bench.at_hz, changes, back, found, bench.kind, bench.seen_hz)


def tried_on(log: Log, values: Mapping[str, float]) -> TriedFilters:
    """Try filters on the noise of a log's flight.

    Raises
    ------
    DataError
        The log tells no controller, or no spectrum of the gyro in the air.
    OptionError
        A parameter that is no filter of this vehicle, or a value without meaning.
    """
    return tried_filters(filter_bench(log), values)


def _reason(change: GainChange) -> str:
    return f"{change.reason}; was {change.old:.7g}" if change.old is not None else change.reason
