"""The record: one manoeuvre on one uniform time base, immutable, labelled, with its history."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Role
from flightid.errors import DataError, OptionError, ShapeError, UnknownNameError
from flightid.record.channel import Channel
from flightid.record.history import Step
from flightid.table import Cell, Column, Table
from flightid.units import DIMENSIONLESS, convert
from flightid.version import VERSION

TIME = "time_s"
MAXIMUM_JITTER = 1e-3
"""Largest departure of a stamp from the uniform grid, in sample times, that counts as rounding."""


class Record:
    """One manoeuvre: named channels with unit and role on one uniform time base.

    Records are immutable: every operation returns a new one and appends to `history`. Time runs
    along the last axis of every array. There is no default sample time: it is read from the stamps
    and refused where they are not uniform.

    Parameters
    ----------
    dataset : xarray.Dataset
        Data variables along the dimension ``time_s`` with attributes ``unit``, ``role``, ``note``.
        Use `Record.from_arrays` rather than this.

    Raises
    ------
    DataError
        Stamps that are not finite, not increasing or not uniform; samples that are not finite.

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(200) / 100
    >>> record = Record.from_arrays(time_s, inputs={"tau": np.sin(time_s)},
    ...                             outputs={"p": np.cos(time_s)}, units={"p": "rad/s"})
    >>> record
    Record('record', 200 samples, 100 Hz, 2 s, inputs [tau], outputs [p])
    """

    __slots__ = ("_channels", "_dataset", "_history", "_name", "_sample_time_s", "_trim")

    def __init__(
        self,
        dataset: xr.Dataset,
        *,
        name: str = "record",
        trim: Mapping[str, float] | None = None,
        history: Iterable[Step] = (),
    ) -> None:
        self._sample_time_s = _uniform_sample_time(np.asarray(dataset[TIME].values))
        self._channels = {
            str(key): Channel(
                str(key),
                str(variable.attrs.get("unit", DIMENSIONLESS)),
                Role(variable.attrs.get("role", Role.OTHER)),
                str(variable.attrs.get("note", "")),
            )
            for key, variable in dataset.data_vars.items()
        }
        for key in self._channels:
            _require_finite(key, np.asarray(dataset[key].values))
        frozen = dataset.copy(deep=True)
        for variable in frozen.variables.values():
            variable.values.flags.writeable = False
        self._dataset = frozen
        self._name = name
        self._trim = dict(trim or {})
        self._history = tuple(history)

    @classmethod
    def from_arrays(
        cls,
        time_s: ArrayLike,
        *,
        inputs: Mapping[str, ArrayLike] | None = None,
        outputs: Mapping[str, ArrayLike] | None = None,
        excitations: Mapping[str, ArrayLike] | None = None,
        others: Mapping[str, ArrayLike] | None = None,
        units: Mapping[str, str] | None = None,
        trim: Mapping[str, float] | None = None,
        name: str = "record",
        history: Iterable[Step] = (),
    ) -> Record:
        """Build a record from stamps and named arrays.

        Parameters
        ----------
        time_s : array_like, shape (n_samples,)
            Uniform stamps, s.
        inputs, outputs, excitations, others : mapping of str to array_like, shape (n_samples,)
            Samples by channel name; the argument decides the role.
        units : mapping of str to str, optional
            Unit by channel name; a channel left out is dimensionless.
        trim : mapping of str to float, optional
            Trim value by channel name, in the channel's unit.
        name : str
            Name of the manoeuvre.
        history : iterable of Step
            What was done before.

        Returns
        -------
        Record

        Raises
        ------
        ShapeError
            An array is not as long as `time_s`.
        DataError
            Stamps not uniform, or a sample not finite.
        UnknownNameError
            A unit or trim value for a channel that is not there.
        """
        stamps = np.array(time_s, dtype=np.float64)
        groups = {
            Role.INPUT: inputs or {},
            Role.OUTPUT: outputs or {},
            Role.EXCITATION: excitations or {},
            Role.OTHER: others or {},
        }
        variables: dict[str, Any] = {}
        for role, group in groups.items():
            for key, samples in group.items():
                values = np.array(samples, dtype=np.float64)
                if values.shape != stamps.shape or stamps.ndim != 1:
                    raise ShapeError(
                        f"channel {key!r} does not fit the time base",
                        found=f"shape {values.shape}",
                        needed=f"shape {stamps.shape}, one-dimensional",
                    )
                if key in variables:
                    raise OptionError(
                        "a channel is named twice", found=key, needed="one role for each channel"
                    )
                unit = (units or {}).get(key, DIMENSIONLESS)
                channel = Channel(key, unit, role)
                variables[key] = ((TIME,), values, {"unit": channel.unit, "role": str(role)})
        for label in (*(units or {}), *(trim or {})):
            if label not in variables:
                raise _unknown_channel(label, variables)
        dataset = xr.Dataset(variables, coords={TIME: stamps})
        return cls(dataset, name=name, trim=trim, history=history)

    @property
    def name(self) -> str:
        """Name of the manoeuvre."""
        return self._name

    @property
    def dataset(self) -> xr.Dataset:
        """The data as an `xarray.Dataset`; its arrays are read-only."""
        return self._dataset

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time stamps, s, shape (n_samples,)."""
        return np.asarray(self._dataset[TIME].values)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self._dataset.sizes[TIME])

    @property
    def sample_time_s(self) -> float:
        """Time between samples, s."""
        return self._sample_time_s

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second, Hz."""
        return 1.0 / self._sample_time_s

    @property
    def duration_s(self) -> float:
        """Number of samples times sample time, s."""
        return self.n_samples * self._sample_time_s

    @property
    def channels(self) -> dict[str, Channel]:
        """Channels by name, in order."""
        return dict(self._channels)

    @property
    def trim(self) -> dict[str, float]:
        """Trim value by channel name, in the channel's unit; empty where none was declared."""
        return dict(self._trim)

    @property
    def history(self) -> tuple[Step, ...]:
        """What was done to the data, oldest first."""
        return self._history

    def names(self, role: Role) -> tuple[str, ...]:
        """Names of the channels of one role, in order."""
        return tuple(key for key, channel in self._channels.items() if channel.role == role)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.names(Role.INPUT)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.names(Role.OUTPUT)

    @property
    def excitations(self) -> tuple[str, ...]:
        """Names of the excitations."""
        return self.names(Role.EXCITATION)

    def unit(self, name: str) -> str:
        """Unit of a channel.

        Raises
        ------
        UnknownNameError
            There is no such channel.
        """
        self._require(name)
        return self._channels[name].unit

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Samples of a channel, read-only, shape (n_samples,), in the channel's unit."""
        self._require(name)
        return np.asarray(self._dataset[name].values)

    def __contains__(self, name: object) -> bool:
        """Tell whether a channel of this name exists."""
        return name in self._channels

    def matrix(self, names: Iterable[str]) -> NDArray[np.float64]:
        """Samples of several channels, shape (n_channels, n_samples).

        Raises
        ------
        UnknownNameError
            There is no such channel.
        """
        rows = [self[name] for name in names]
        return np.array(rows, dtype=np.float64).reshape(len(rows), self.n_samples)

    def replace(
        self,
        samples: Mapping[str, ArrayLike] | None = None,
        *,
        step: Step | None = None,
        time_s: ArrayLike | None = None,
        channels: Iterable[Channel] | None = None,
        name: str | None = None,
        trim: Mapping[str, float] | None = None,
    ) -> Record:
        """Copy with some samples, stamps or labels exchanged, and one step appended to history.

        Parameters
        ----------
        samples : mapping of str to array_like, shape (n_samples,), optional
            New samples by channel name; other channels keep theirs.
        step : Step, optional
            What was done; its version is filled in.
        time_s : array_like, optional
            New stamps; then `samples` must hold every channel.
        channels : iterable of Channel, optional
            The channels of the copy, with units and roles; default: the present ones. A name
            that is left out is dropped.
        name, trim : optional
            New name or trim values.

        Returns
        -------
        Record
        """
        stamps = self.time_s if time_s is None else np.array(time_s, dtype=np.float64)
        kept = list(self._channels.values()) if channels is None else list(channels)
        given = samples or {}
        for label in given:
            if label not in {channel.name for channel in kept}:
                raise _unknown_channel(label, {channel.name: None for channel in kept})
        variables: dict[str, Any] = {}
        for channel in kept:
            values = given[channel.name] if channel.name in given else self[channel.name]
            array = np.array(values, dtype=np.float64)
            if array.shape != stamps.shape:
                raise ShapeError(
                    f"channel {channel.name!r} does not fit the time base",
                    found=f"shape {array.shape}",
                    needed=f"shape {stamps.shape}",
                )
            attributes = {"unit": channel.unit, "role": str(channel.role), "note": channel.note}
            variables[channel.name] = ((TIME,), array, attributes)
        done = () if step is None else (Step(step.operation, step.options, VERSION),)
        kept_trim = {
            key: value
            for key, value in (self._trim if trim is None else dict(trim)).items()
            if key in variables
        }
        return Record(
            xr.Dataset(variables, coords={TIME: stamps}),
            name=self._name if name is None else name,
            trim=kept_trim,
            history=(*self._history, *done),
        )

    def with_roles(self, **roles: Role | str) -> Record:
        """Copy in which the named channels have other roles."""
        for label in roles:
            self._require(label)
        channels = [
            channel.with_role(Role(roles.get(key, channel.role)))
            for key, channel in self._channels.items()
        ]
        options: dict[str, Cell] = {key: str(role) for key, role in roles.items()}
        return self.replace(channels=channels, step=Step("Record.with_roles", options))

    def to_units(self, **units: str) -> Record:
        """Copy with channels converted to other units, trim values included.

        Raises
        ------
        UnitError
            A dimension differs.
        UnknownNameError
            There is no such channel.

        Example
        -------
        >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [0.0, 180.0]},
        ...                             units={"p": "deg/s"})
        >>> record.to_units(p="rad/s")["p"]
        array([0.        , 3.14159265])
        """
        samples: dict[str, NDArray[np.float64]] = {}
        trim = self.trim
        channels = self.channels
        for key, unit in units.items():
            self._require(key)
            samples[key] = convert(self[key], self.unit(key), unit)
            if key in trim:
                trim[key] = float(convert(trim[key], self.unit(key), unit))
            old = channels[key]
            channels[key] = Channel(key, unit, old.role, old.note)
        step = Step("Record.to_units", dict(units))
        return self.replace(samples, channels=channels.values(), trim=trim, step=step)

    def select(self, names: Iterable[str]) -> Record:
        """Copy with only the named channels, in that order."""
        wanted = list(names)
        for label in wanted:
            self._require(label)
        step = Step("Record.select", {"names": ", ".join(wanted)})
        return self.replace(channels=[self._channels[label] for label in wanted], step=step)

    def segment(self, start_s: float, stop_s: float, *, name: str | None = None) -> Record:
        """Copy of the samples with ``start_s <= time < stop_s``; stamps are kept.

        Raises
        ------
        DataError
            Fewer than two samples lie in the span.
        """
        time_s = self.time_s
        slack = self._sample_time_s * MAXIMUM_JITTER
        inside = (time_s >= start_s - slack) & (time_s < stop_s - slack)
        if np.count_nonzero(inside) < 2:
            raise DataError(
                "the segment holds fewer than two samples",
                found=f"{start_s} s to {stop_s} s",
                needed=f"a span inside {time_s[0]:.3f} s to {time_s[-1]:.3f} s",
            )
        samples = {key: self[key][inside] for key in self._channels}
        step = Step("Record.segment", {"start_s": start_s, "stop_s": stop_s})
        return self.replace(samples, time_s=time_s[inside], step=step, name=name)

    def summary(self) -> Table:
        """Table of the channels with unit, role, mean, deviation and range."""
        columns = (
            Column("channel"),
            Column("unit"),
            Column("role"),
            Column("mean"),
            Column("standard deviation"),
            Column("minimum"),
            Column("maximum"),
        )
        rows = tuple(
            (
                key,
                channel.unit,
                str(channel.role),
                float(np.mean(self[key])),
                float(np.std(self[key])),
                float(np.min(self[key])),
                float(np.max(self[key])),
            )
            for key, channel in self._channels.items()
        )
        return Table(repr(self), columns, rows, tuple(str(step) for step in self._history))

    def to_dict(self) -> dict[str, object]:
        """Plain values, samples included.

        Returns
        -------
        dict
            Keys ``schema``, ``name``, ``time_s``, ``channels``, ``trim``, ``history``.
        """
        return {
            "schema": "flightid.record/1",
            "name": self._name,
            "time_s": self.time_s.tolist(),
            "channels": {
                key: {
                    "unit": channel.unit,
                    "role": str(channel.role),
                    "note": channel.note,
                    "samples": self[key].tolist(),
                }
                for key, channel in self._channels.items()
            },
            "trim": dict(self._trim),
            "history": [
                {
                    "operation": step.operation,
                    "options": dict(step.options),
                    "version": step.version,
                }
                for step in self._history
            ],
        }

    def __repr__(self) -> str:
        """Size, rate and channel names on one line."""
        return (
            f"Record({self._name!r}, {self.n_samples} samples, {self.sample_rate_hz:.6g} Hz, "
            f"{self.duration_s:.6g} s, inputs [{', '.join(self.inputs)}], "
            f"outputs [{', '.join(self.outputs)}])"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()

    def _require(self, name: str) -> None:
        if name not in self._channels:
            raise _unknown_channel(name, self._channels)


def _unknown_channel(name: str, channels: Iterable[str]) -> UnknownNameError:
    return UnknownNameError(
        "there is no such channel", found=name, needed="one of " + ", ".join(channels)
    )


def _require_finite(name: str, samples: NDArray[np.float64]) -> None:
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        raise DataError(
            f"channel {name!r} holds samples that are not finite",
            found=f"{bad.size} of {samples.size}, the first at index {bad[0]}",
            needed="finite numbers",
            action="cut the segment, or fill gaps with a stated policy when resampling",
        )


def _uniform_sample_time(time_s: NDArray[np.float64]) -> float:
    if time_s.ndim != 1 or time_s.size < 2:
        raise DataError("a record needs a time base", found=f"{time_s.size} stamps", needed="2")
    if not np.all(np.isfinite(time_s)):
        raise DataError("time stamps are not finite", needed="finite stamps in seconds")
    sample_time_s = float(time_s[-1] - time_s[0]) / (time_s.size - 1)
    if sample_time_s <= 0:
        raise DataError("time stamps do not increase", needed="increasing stamps in seconds")
    grid = time_s[0] + sample_time_s * np.arange(time_s.size)
    worst = float(np.max(np.abs(time_s - grid))) / sample_time_s
    if worst > MAXIMUM_JITTER:
        raise DataError(
            "time stamps are not uniform",
            found=f"a stamp {100 * worst:.3g} % of a sample time off the grid",
            needed=f"at most {100 * MAXIMUM_JITTER:g} %",
            action="bring the channels to one time base with conditioning.resample",
        )
    return sample_time_s
