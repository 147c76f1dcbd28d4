"""Rows of a table on the grid of a record: without outliers, each channel from its own stamps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.record.channel import Channel
from flightid.record.checks import REMOVE_OUTLIERS, entry_steps, fault_steps
from flightid.record.folded_power import folded_power
from flightid.record.history import Step
from flightid.record.hold import InputHold
from flightid.record.interpolation import SAME_RATE, Interpolation, is_coarser, usual_method
from flightid.record.outlying import bridge_outliers
from flightid.record.repeats import is_switched
from flightid.record.rows import require_sensible_base
from flightid.record.slow_channels import said_of_slow, slow_channels
from flightid.record.stamps import mean_spacing_s
from flightid.record.step_instants import clock_step_s, moves_on, span_of_steps
from flightid.record.timebase import to_uniform
from flightid.record.validation import unknown_channel
from flightid.table import Cell
from flightid.version import VERSION

Array = NDArray[np.float64]
Rows = Mapping[str, tuple[Array, Array]]
"""Stamps, s, and samples by channel; those of a table share their stamps."""


@dataclass(frozen=True)
class ChannelColumn:
    """A channel of the record and the column it comes from."""

    channel: Channel
    column: str


def listed(
    outliers: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None,
) -> tuple[Mapping[str, Any], ...]:
    """One set of options or several, as several."""
    if outliers is None:
        return ()
    return (outliers,) if isinstance(outliers, Mapping) else tuple(outliers)


@dataclass(frozen=True)
class RowGrid:
    """What is done to the rows of a manoeuvre before they are a record.

    Attributes
    ----------
    wanted : tuple of ChannelColumn
    resample_to_s, max_gap_s, interpolation, outliers, hold, time_column
        As in `read_records`.
    has_clocks : bool
        Channels have stamps of their own: they always go to one grid, that of the slowest input or
        output where none is stated.
    """

    wanted: tuple[ChannelColumn, ...]
    resample_to_s: float | None
    max_gap_s: float | None
    interpolation: Interpolation | str | Mapping[str, Interpolation | str] | None
    outliers: tuple[Mapping[str, Any], ...]
    hold: InputHold | None
    time_column: str
    has_clocks: bool = False

    def step_s(self, rows: Rows) -> float | None:
        """Spacing of the grid, s; None: the rows are the grid."""
        if self.resample_to_s is not None or not self.has_clocks:
            return self.resample_to_s
        roles = {item.channel.name: item.channel.role for item in self.wanted}
        for name, (time_s, _) in rows.items():
            if time_s.size < 2:
                raise DataError(
                    f"{name!r} has too few samples for a grid", found=time_s.size, needed="two"
                )
        decide = [name for name, role in roles.items() if role in (Role.INPUT, Role.OUTPUT)]
        return max(clock_step_s(rows[name][0]) for name in decide or roles)

    @property
    def driving(self) -> list[str]:
        """Names of the inputs."""
        return [each.channel.name for each in self.wanted if each.channel.role is Role.INPUT]

    def methods(self, rows: Rows, step_s: float) -> dict[str, Interpolation | str]:
        """Interpolation by channel: what was asked for, else what the inputs call for.

        Where the grid is the inputs' own, outputs are read at its instants: a low-pass without
        phase would put what an input does later into them, as a closed loop puts noise of the past
        into inputs.
        """
        given = self.interpolation
        if isinstance(given, str):
            return {item.channel.name: given for item in self.wanted}
        found: dict[str, Interpolation | str] = {}
        holds = self.holds(rows)
        for name in self.driving:
            hold = holds.get(name)
            if hold == "zero" and moves_on(rows[name], step_s):
                found[name] = Interpolation.PREVIOUS
            else:
                found[name] = usual_method(hold, mean_spacing_s(rows[name][0]), step_s)
        own = bool(found) and not self._low_passed(rows, step_s, found)
        for item in self.wanted:
            name = item.channel.name
            is_dense = mean_spacing_s(rows[name][0]) <= step_s * (1 + SAME_RATE)
            if own and is_dense and item.channel.role is Role.OUTPUT:
                found[name] = Interpolation.POINT
        return {**dict.fromkeys(rows, Interpolation.BAND_LIMITED), **found, **(given or {})}

    def holds(self, rows: Rows) -> dict[str, InputHold]:
        """What is known of inputs between their stamps: it was declared, or two levels show it."""
        if self.hold is not None:
            return dict.fromkeys(self.driving, self.hold)
        return {name: "zero" for name in self.driving if is_switched(rows[name][1])}

    def _low_passed(self, rows: Rows, step_s: float, ways: Mapping[str, str]) -> bool:
        """Whether an input is low-passed on its way to the grid."""
        return any(
            is_coarser(step_s, mean_spacing_s(rows[name][0])) and ways[name] != "previous"
            for name in self.driving
        )

    def hold_after(self, rows: Rows) -> InputHold | None:
        """What is still true of the inputs: what was low-passed is smooth."""
        step_s = self.step_s(rows)
        if step_s is None or set(self.holds(rows)) != set(self.driving):
            return self.hold
        ways = self.methods(rows, step_s)
        filtered = self._low_passed(rows, step_s, ways)
        return "band_limited" if filtered else self.hold

    def pieces(
        self, rows: Rows, beside: Sequence[tuple[Channel, Array, Array]]
    ) -> list[tuple[Array, Mapping[str, Array], tuple[Step, ...]]]:
        """Stamps, samples and history of each piece between gaps.

        Raises
        ------
        DataError
            There is no channel, or gaps leave no span.
        """
        if not rows:
            raise DataError(
                "there is nothing to read beside the time",
                needed="columns of numbers as long as the time"
                if not self.has_clocks
                else "a column that moves",
            )
        steps: tuple[Step, ...] = ()
        for asked in self.outliers:
            rows, step = self._without_outliers(rows, asked)
            steps = (*steps, step)
        entering = [(c.channel, *rows[c.channel.name]) for c in self.wanted]
        steps += entry_steps(entering, beside)
        step_s = self.step_s(rows)
        if step_s is None:
            stamps = next(iter(rows.values()))[0]
            return [(stamps, {name: values for name, (_, values) in rows.items()}, steps)]
        fastest = min((time_s for time_s, _ in rows.values()), key=mean_spacing_s)
        require_sensible_base(fastest, step_s, self.time_column)
        ways = self.methods(rows, step_s)
        steps += fault_steps(
            fault
            for name, way in ways.items()
            if way == Interpolation.POINT
            and (fault := folded_power(name, *rows[name], step_s)) is not None
        )
        held = [name for name in self.driving if ways[name] == "previous"]
        outputs = [c.channel.name for c in self.wanted if c.channel.role is Role.OUTPUT]
        slow = slow_channels(rows, outputs, step_s, self.max_gap_s)
        rows = {**rows, **slow}
        made = to_uniform(
            rows,
            sample_time_s=step_s,
            span_s=span_of_steps(rows, held, step_s),
            gaps="split",
            max_gap_s=self.max_gap_s,
            interpolation=ways,
            hold=self.holds(rows),
        )
        said = said_of_slow(made.options, slow, step_s)
        steps = (*steps, Step("conditioning.to_uniform", said, VERSION))
        return [(span.time_s, span.samples, steps) for span in made.spans]

    def _without_outliers(self, rows: Rows, asked: Mapping[str, Any]) -> tuple[Rows, Step]:
        limits = {"deviations": 6.0, "half_width": 3, **asked}
        outputs = [item.channel.name for item in self.wanted if item.channel.role is Role.OUTPUT]
        names = outputs if limits.pop("channels", None) is None else list(asked["channels"])
        counts: dict[str, Cell] = {}
        for name in names:
            if name not in rows:
                raise unknown_channel(name, rows)
            time_s = rows[name][0]
            samples, count = bridge_outliers(name, *rows[name], **limits)
            if count:
                rows, counts = {**rows, name: (time_s, samples)}, {**counts, name: count}
        return rows, Step(REMOVE_OUTLIERS, {**limits, **counts}, VERSION)
