"""What a record holds: channels on one uniform time base, read-only, with their history."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.extras import extra_module
from flightid.record.channel import Channel
from flightid.record.history import Step
from flightid.record.hold import InputHold, InputShape
from flightid.record.validation import (
    TIME,
    require_finite,
    uniform_sample_time,
    unknown_channel,
)

if TYPE_CHECKING:
    import xarray as xr

T = TypeVar("T")


class LabelledSamples:
    """Named channels with unit and role along one time; the half of a record that changes nothing.

    Parameters
    ----------
    time_s : ndarray, shape (n_samples,)
        Uniform stamps, s.
    samples : mapping of Channel to ndarray, shape (n_samples,)
        Kept as they are and made read-only: copy before, where the caller keeps them.

    Raises
    ------
    DataError
        Stamps that are not finite, not increasing or not uniform; samples that are not finite.
    """

    __slots__ = (
        "_channels", "_found", "_history", "_input_shape", "_name", "_sample_time_s", "_samples",
        "_time_s", "_trim",
    )  # fmt: skip

    def __init__(
        self,
        time_s: NDArray[np.float64],
        samples: Mapping[Channel, NDArray[np.float64]],
        *,
        name: str = "record",
        trim: Mapping[str, float] | None = None,
        history: Iterable[Step] = (),
        input_shape: InputShape | None = None,
    ) -> None:
        self._sample_time_s = uniform_sample_time(time_s)
        self._channels = {channel.name: channel for channel in samples}
        self._samples = {channel.name: values for channel, values in samples.items()}
        for key, values in self._samples.items():
            require_finite(key, values)
            values.flags.writeable = False
        time_s.flags.writeable = False
        self._time_s = time_s
        self._name = name
        self._trim = dict(trim or {})
        self._history = tuple(history)
        self._input_shape = input_shape or InputShape()
        self._found: dict[Hashable, Any] = {}

    @property
    def name(self) -> str:
        """Name of the manoeuvre."""
        return self._name

    def once(self, name: Hashable, make: Callable[[], T]) -> T:
        """What `make` finds in these samples under a name, found once: they never change.

        Example
        -------
        >>> from flightid.record import Record
        >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [1.0, 2.0]})
        >>> record.once("peak", lambda: 2.0), record.once("peak", lambda: 7.0)
        (2.0, 2.0)
        """
        if name not in self._found:
            self._found[name] = make()
        found: T = self._found[name]
        return found

    @property
    def dataset(self) -> xr.Dataset:
        """The data as an `xarray.Dataset`, with unit, role and note as attributes; read-only.

        Raises
        ------
        OptionError
            xarray is not installed (extra ``tables``).
        """
        module = extra_module("xarray", "an xarray.Dataset")
        variables = {
            key: (TIME, self._samples[key], {"unit": c.unit, "role": str(c.role), "note": c.note})
            for key, c in self._channels.items()
        }
        return cast("xr.Dataset", module.Dataset(variables, coords={TIME: self._time_s}))

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time stamps, s, shape (n_samples,)."""
        return self._time_s

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self._time_s.size)

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

    @property
    def input_shape(self) -> InputShape:
        """How the inputs move between samples, whether they repeat and were fed back."""
        return self._input_shape

    @property
    def hold(self) -> InputHold | None:
        """What inputs do between samples: "zero", "first", "band_limited"; None: not known."""
        return self._input_shape.hold

    @property
    def period_s(self) -> float | None:
        """Time after which the inputs repeat, s; None: not known, or they do not."""
        return self._input_shape.period_s

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
        return self._samples[name]

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

    def _require(self, name: str) -> None:
        if name not in self._channels:
            raise unknown_channel(name, self._channels)
