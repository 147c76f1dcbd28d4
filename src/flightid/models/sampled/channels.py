"""Records as the arrays that sampled models run on, after their checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.record.hold import SAME_SAMPLE_TIME
from flightid.record.workable import require_workable
from flightid.units import clash, match

Array = NDArray[np.float64]
OFFSETS = ("mean", "mean_as_trim", "trim", "none")
LARGEST = 1e100
"""A run beyond this is held at the last sample before it: its squares still are numbers."""


class SampledModel(Protocol):
    """What a record must agree with."""

    @property
    def sample_time_s(self) -> float:
        """Sample time, s."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Unit by channel."""
        ...


@dataclass(frozen=True, eq=False)
class SampledChannels:
    """Channels of all records end to end, their offsets taken off.

    Attributes
    ----------
    output : ndarray, shape (n_samples,)
    inputs : ndarray, shape (n_inputs, n_samples)
    lengths : tuple of int
        Samples of each record.
    offsets : tuple of mapping
        What was taken off, by channel, for each record.
    units : mapping of str to str
    sample_time_s : float
    levels : bool
        Whether a constant of each record is left to be fitted: a mean is no trim.
    excitations : ndarray, shape (n_excitations, n_samples), or None
        What was injected into a closed loop, without its mean, where a fit goes by way of it.
    ends_s : tuple of tuple of float
        Time of the first and the last sample of each record.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1, 0.2], inputs={"u": [0.0, 1.0, 2.0]},
    ...                             outputs={"y": [4.0, 4.0, 7.0]})
    >>> gather_channels([record], "y", ("u",), "mean").output
    array([-1., -1.,  2.])
    """

    output: Array
    inputs: Array
    lengths: tuple[int, ...]
    offsets: tuple[Mapping[str, float], ...]
    units: Mapping[str, str]
    sample_time_s: float
    levels: bool = False
    excitations: Array | None = None
    ends_s: tuple[tuple[float, float], ...] = ()

    @property
    def external(self) -> Array:
        """What errors must not go with: the excitations, or without them the inputs."""
        return self.inputs if self.excitations is None else self.excitations

    @property
    def spans(self) -> tuple[slice, ...]:
        """Place of each record in the arrays."""
        ends = np.cumsum([0, *self.lengths])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def operating_point(self) -> dict[str, float]:
        """What was taken off each channel, averaged over all samples."""
        weights = np.array(self.lengths) / sum(self.lengths)
        return {
            name: float(weights @ [record[name] for record in self.offsets]) for name in self.units
        }

    def require_change(self) -> None:
        """Refuse channels that are constant within every record.

        Raises
        ------
        DataError
            A channel does not change.
        """
        for name, row in zip(list(self.units), (self.output, *self.inputs), strict=True):
            moved = max(float(np.ptp(row[span])) for span in self.spans)
            if moved <= 1e-14 * np.max(np.abs(row)):
                values = [
                    still_words(row[span.start] + offset[name], ends)
                    for span, offset, ends in zip(
                        self.spans, self.offsets, self.ends_s, strict=True
                    )
                ]
                raise DataError(
                    f"channel {name!r} is constant",
                    found=" and ".join(dict.fromkeys(values)),
                    needed="a channel that changes within a record",
                    action="leave the channel out or choose another record",
                )


def gather_channels(
    records: Sequence[Record], output: str, inputs: Sequence[str], offsets: str
) -> SampledChannels:
    """Channels of records with one sample time and one set of units.

    Raises
    ------
    DataError
        No record, sample times that differ, or samples too large or too small to be worked with.
    UnitError
        A channel has another unit in a later record.
    OptionError
        Offsets ``"trim"`` without a declared trim value.
    UnknownNameError
        A channel is missing.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1], inputs={"u": [0.0, 1.0]}, outputs={"y": [2.0, 4.0]})
    >>> gather_channels([record, record], "y", ["u"], "none").lengths
    (2, 2)
    """
    if not records:
        raise DataError("there is no record", needed="one or more")
    names = (output, *inputs)
    first = records[0]
    units = {name: first.unit(name) for name in names}
    for record in records[1:]:
        if abs(record.sample_time_s / first.sample_time_s - 1.0) > SAME_SAMPLE_TIME:
            raise DataError(
                "records have different sample times",
                found=f"{first.sample_time_s:.6g} and {record.sample_time_s:.6g} s",
                needed="one: a lag is a number of samples",
                action="resample them with conditioning.resample",
            )
        for name in names:
            if record.unit(name) != units[name]:
                raise clash(name, record.unit(name), units[name], where="in another record")
    for record in records:
        require_workable(record, names)
    removed = tuple(_offsets(record, names, offsets) for record in records)
    rows = [
        np.concatenate([r[name] - o[name] for r, o in zip(records, removed, strict=True)])
        for name in names
    ]
    stacked = np.array(rows[1:]).reshape(len(inputs), rows[0].size)
    lengths = tuple(record.n_samples for record in records)
    return SampledChannels(
        rows[0],
        stacked,
        lengths,
        removed,
        units,
        first.sample_time_s,
        offsets == "mean",
        ends_s=tuple(map(record_ends, records)),
    )


def record_ends(record: Record) -> tuple[float, float]:
    """Time of the first and the last sample, s."""
    return float(record.time_s[0]), float(record.time_s[-1])


def still_words(value: float, ends_s: tuple[float, float]) -> str:
    """What a channel stays at, and from when to when: a record may be a part of what was read.

    Example
    -------
    >>> still_words(-3.1, (20.0, 59.99))
    '-3.1 from 20 to 59.99 s'
    """
    return f"{value:.6g} from {ends_s[0]:.6g} to {ends_s[1]:.6g} s"


def require_same(model: SampledModel, units: Mapping[str, str], sample_time_s: float) -> None:
    """Refuse records with another sample time or other units than the model's.

    Raises
    ------
    DataError
        Another sample time.
    UnitError
        A channel in another unit.
    """
    if abs(sample_time_s / model.sample_time_s - 1.0) > SAME_SAMPLE_TIME:
        raise DataError(
            "the record has another sample time than the model",
            found=f"{sample_time_s:.6g} s",
            needed=f"{model.sample_time_s:.6g} s",
            action="resample it with conditioning.resample",
        )
    for name, unit in units.items():
        if not match(unit, model.units.get(name, unit)):
            raise clash(name, unit, model.units[name], where="than the model")


def _offsets(record: Record, names: Sequence[str], kind: str) -> dict[str, float]:
    if kind == "none":
        return dict.fromkeys(names, 0.0)
    if kind in ("mean", "mean_as_trim"):
        return {name: float(np.mean(record[name])) for name in names}
    missing = [name for name in names if name not in record.trim]
    if missing:
        raise OptionError(
            "a record has no trim value for a channel",
            found=", ".join(missing),
            needed="trim values of all channels",
            action="declare them with the record, or take offsets='mean'",
        )
    return {name: float(record.trim[name]) for name in names}


def hold_diverged(run: Array) -> int | None:
    """Hold a run that leaves the range of numbers, in place; the sample at which it did.

    Parameters
    ----------
    run : ndarray, shape (p, n_samples)
    """
    usable = np.all(np.abs(run) < LARGEST, axis=0)
    if np.all(usable):
        return None
    first = int(np.argmin(usable))
    run[:, first:] = run[:, first - 1 : first] if first else 0.0
    return first
