"""The record: one manoeuvre on one uniform time base, immutable, labelled, with its history."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from flightid.conventions import Role
from flightid.excitation.excitation import Excitation
from flightid.record.channel import Channel
from flightid.record.display import one_line, plain_values, summary_table
from flightid.record.history import Step
from flightid.record.hold import InputHold, InputShape, Loop
from flightid.record.samples import LabelledSamples
from flightid.record.unit_change import in_units
from flightid.record.unit_changes import unit_changes
from flightid.record.validation import (
    inside_span,
    labelled_samples,
    own_samples,
    require_period,
    unknown_channel,
)
from flightid.result import Result
from flightid.table import Cell, Table
from flightid.version import VERSION


class HasUnits(Protocol):
    """A model, or whatever else tells units by channel."""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each channel."""
        ...


class Record(LabelledSamples, Result, schema="flightid.record/1"):
    """One manoeuvre: named channels with unit and role on one uniform time base.

    Records are immutable: every operation returns a new one and appends to `history`. Time runs
    along the last axis of every array. There is no default sample time: it is read from the stamps
    and refused where they are not uniform.

    Parameters
    ----------
    time_s : ndarray, shape (n_samples,)
        Uniform stamps, s.
    samples : mapping of Channel to ndarray, shape (n_samples,)
        Kept as they are and made read-only; `Record.from_arrays` copies.

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

    __slots__ = ()

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
        notes: Mapping[str, str] | None = None,
        trim: Mapping[str, float] | None = None,
        name: str = "record",
        history: Iterable[Step] = (),
        hold: InputHold | None = None,
        period_s: float | None = None,
        loop: Loop | None = None,
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
        notes : mapping of str to str, optional
            Where a channel came from, by channel name.
        trim : mapping of str to float, optional
            Trim value by channel name, in the channel's unit.
        name : str
            Name of the manoeuvre.
        history : iterable of Step
            What was done before.
        hold, period_s, loop : optional
            How inputs move between samples, repeat and are fed back; see `InputShape`.

        Raises
        ------
        ShapeError
            An array is not as long as `time_s`.
        DataError
            Stamps not uniform, or a sample not finite.
        UnknownNameError
            A unit, note or trim value for a channel that is not there.
        """
        stamps = np.array(time_s, dtype=np.float64)
        groups = {
            Role.INPUT: inputs or {},
            Role.OUTPUT: outputs or {},
            Role.EXCITATION: excitations or {},
            Role.OTHER: others or {},
        }
        samples = labelled_samples(groups, stamps, units or {}, notes or {}, trim or {})
        known = InputShape(hold, period_s, loop)
        made = cls(stamps, samples, name=name, trim=trim, history=history, input_shape=known)
        require_period([made[name] for name in made.inputs], made.sample_time_s, period_s)
        return made

    @classmethod
    def from_excitation(cls, excitation: Excitation) -> Record:
        """Designed inputs as a record: their unit, held between samples as an autopilot does.

        Example
        -------
        >>> from flightid.excitation import doublet
        >>> made = doublet(amplitude=2.0, step_s=0.5, sample_rate_hz=10.0, unit="deg", name="da")
        >>> Record.from_excitation(made).unit("da")
        'deg'
        """
        return cls.from_arrays(
            excitation.time_s,
            inputs=excitation.by_name,
            units=dict.fromkeys(excitation.names, excitation.unit),
            name=excitation.kind,
            history=[Step("design", {"kind": excitation.kind, **excitation.options})],
            hold="zero",
        )

    def replace(
        self,
        samples: Mapping[str, ArrayLike] | None = None,
        *,
        step: Step | None = None,
        time_s: ArrayLike | None = None,
        channels: Iterable[Channel] | None = None,
        name: str | None = None,
        trim: Mapping[str, float] | None = None,
        input_shape: InputShape | None = None,
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
        input_shape : InputShape, optional
            What is known of the inputs now; default: what was known, as far as new stamps leave it.
        """
        stamps = self.time_s if time_s is None else np.array(time_s, dtype=np.float64)
        kept = list(self._channels.values()) if channels is None else list(channels)
        given = samples or {}
        for label in given:
            if label not in {channel.name for channel in kept}:
                raise unknown_channel(label, [channel.name for channel in kept])
        # Arrays of a record are read-only, so copies share what they do not exchange.
        columns = {}
        for channel in kept:
            key = channel.name
            whole = key in given or time_s is not None
            value = given[key] if key in given else self[key]
            columns[channel] = own_samples(channel, value, stamps) if whole else self[key]
        done = () if step is None else (Step(step.operation, step.options, VERSION),)
        values = self._trim if trim is None else trim
        made = Record(
            stamps,
            columns,
            name=self._name if name is None else name,
            trim={key: values[key] for key in values if key in {each.name for each in kept}},
            history=(*self._history, *done),
        )
        bases = self._sample_time_s, made.sample_time_s
        made._input_shape = input_shape or self._input_shape.on_another_base(*bases)
        return made

    def declare(
        self,
        *,
        hold: InputHold | None = None,
        period_s: float | None = None,
        loop: Loop | None = None,
    ) -> Record:
        """Copy that knows more of its inputs, see `InputShape`; what is left out stays."""
        shape = self._input_shape.with_known(InputShape(hold, period_s, loop))
        require_period([self[name] for name in self.inputs], self._sample_time_s, period_s)
        return self.replace(step=Step("Record.declare", shape.to_dict()), input_shape=shape)

    def with_roles(self, **roles: Role | str) -> Record:
        """Copy in which the named channels have other roles."""
        for label in roles:
            self._require(label)
        present = self._channels.items()
        channels = [channel.with_role(Role(roles.get(k, channel.role))) for k, channel in present]
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
        for key in units:
            self._require(key)
        samples, channels, trim = in_units(self, units)
        step = Step("Record.to_units", dict(units))
        return self.replace(samples, channels=channels, trim=trim, step=step)

    def to_units_of(self, model: HasUnits) -> Record:
        """Copy with all channels that a model has in its units, US ones too, trim values included.

        Channels that the model lacks, or whose unit nothing tells, stay as they are.

        Parameters
        ----------
        model : HasUnits
            Anything with `units` by channel.

        Example
        -------
        >>> import flightid as fid
        >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [0.0, 180.0], "u": [50.0, 60.0]},
        ...                             units={"p": "deg/s", "u": "kt"})
        >>> flown = record.to_units_of(fid.load_model("rate_first_order"))
        >>> flown.unit("p"), flown.unit("u")
        ('rad/s', 'kt')
        """
        return self.to_units(**unit_changes(self, model.units))

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
        inside = inside_span(self.time_s, start_s, stop_s, self._sample_time_s)
        samples = {key: self[key][inside] for key in self._channels}
        step = Step("Record.segment", {"start_s": start_s, "stop_s": stop_s})
        return self.replace(samples, time_s=self.time_s[inside], step=step, name=name)

    def summary(self) -> Table:
        """Table of the channels with unit, role, mean, deviation and range."""
        return summary_table(self)

    def to_dict(self) -> dict[str, object]:
        """Plain values: ``schema``, ``name``, ``time_s``, ``channels``, ``trim``, ``history``."""
        return plain_values(self)

    def __repr__(self) -> str:
        """Size, rate and channel names on one line."""
        return one_line(self)
