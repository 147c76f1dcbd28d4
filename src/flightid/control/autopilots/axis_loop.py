"""One axis of an autopilot's rate and angle controllers: exact linear view and exact recursion."""

from __future__ import annotations

from abc import abstractmethod
from array import array
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from flightid import _native
from flightid.control.autopilots.filter_stages import FilterStage, gyro_stages
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    Section,
    hold_response,
    sections_response,
)
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun
from flightid.control.autopilots.parameter_files import GainChange
from flightid.control.autopilots.parameter_table import GainRange, gain_ranges
from flightid.control.gyro import Gyro
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table


@dataclass(frozen=True)
class AxisLoop(Result, schema="flightid.axis_loop/1"):
    """One axis of an autopilot. Made by `axis_loop` or `axis_loop_of`.

    Signs and units: rates in rad/s, outputs in `output_unit`. `feedback` is positive for negative
    feedback, so the loop transfer is L = feedback · plant and 1 + L = 0 is the stability limit.

    Attributes
    ----------
    axis : str
        ``"roll"``, ``"pitch"`` or ``"yaw"``; of a plain PID the output that it holds.
    values, names : mapping of str to float and to str
        Parameter values and the autopilot's names, by role.
    loop_rate_hz : float
        Rate of the controller, Hz.
    gyro_rate_hz : float
        Rate of the gyro filters, Hz; the controller takes their latest output.
    computation_delay_s : float
        From the gyro sample to the output, s. No parameter holds it; a plant identified from logged
        outputs already includes it, and it stays zero then.
    gyro_notches : tuple of Section
        Notches on the gyro, at `gyro_rate_hz`; those that move at the middle of where they were.
    unknown_notches : tuple of str
        Sentences on notches whose place nothing tells, or that moved far. A plant that ends at
        the filtered rate holds them.
    plant_gyro : tuple of Section, or None
        Filters of the gyro that a plant identified from the filtered rate holds, where they are
        not those of the parameters any more; see `with_filters`.
    assumed : tuple of str
        Parameters that the vehicle's firmware did not have.
    unmodelled : tuple of str
        What of the vehicle's settings this view leaves out, one sentence each.
    beside_gains : tuple of GainChange
        What else is to be set with new gains so that the vehicle flies this loop.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    >>> loop.ranges["ATC_RAT_RLL_D"]
    GainRange(0 to 0.05 1/(rad/s^2) by 0.0005, default 0.0036)
    >>> abs(loop.feedback([50.0])).round(3)
    array([0.247])
    """

    axis: str
    values: Mapping[str, float]
    names: Mapping[str, str]
    loop_rate_hz: float
    gyro_rate_hz: float
    computation_delay_s: float = 0.0
    gyro_notches: tuple[Section, ...] = ()
    unknown_notches: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    unmodelled: tuple[str, ...] = ()
    plant_gyro: tuple[Section, ...] | None = field(default=None, kw_only=True)
    beside_gains: tuple[GainChange, ...] = field(default=(), kw_only=True)
    autopilot: ClassVar[str] = ""
    output_unit: ClassVar[str] = "1"
    full_output: ClassVar[float] = 1.0
    """Output of a full command, in its unit."""
    set_point_delay_loops: ClassVar[int] = 0
    """Loops between a rate set-point, as it is logged, and the rate loop that acts on it."""
    inner: ClassVar[str] = "rate loop"
    """What the innermost loop is called."""
    gains_are_whole: ClassVar[bool] = False
    _units: ClassVar[Mapping[str, float]] = {}

    def __post_init__(self) -> None:
        if not (self.loop_rate_hz > 0 and self.gyro_rate_hz >= self.loop_rate_hz * (1 - 1e-9)):
            raise OptionError(
                "the rates of loop and gyro do not fit",
                found=f"loop {self.loop_rate_hz} Hz, gyro {self.gyro_rate_hz} Hz",
                needed="a positive loop rate and a gyro at least as fast",
            )
        if not all(np.isfinite(value) for value in self.values.values()):
            raise DataError("a parameter is not a finite number", found=dict(self.gains))

    def __repr__(self) -> str:
        """Autopilot, axis, rate and gains on one line."""
        shown = {"p", "i", "d", "ff"} & set(self.values)
        gains = ", ".join(
            f"{r.upper()} {self.values[r]:.4g}" for r in sorted(shown, key="pidff".find)
        )
        return f"AxisLoop({self.autopilot} {self.axis}, {self.loop_rate_hz:g} Hz, {gains})"

    @property
    def has_flown(self) -> bool:
        """Whether its gains have flown, so that new ones are compared with them."""
        return True

    @property
    def time_scale(self) -> float:
        """Of its dynamics over those of a vehicle's rate loop, which a search begins from."""
        return 1.0

    def unit_of(self, role: str) -> float:
        """What one of a gain is worth in the controller's own units."""
        return self._units.get(role, 1.0)

    def written(self, value: float) -> float:
        """A gain as the autopilot keeps it: rounded to four digits."""
        return float(f"{value:.4g}")

    @property
    def gains(self) -> dict[str, float]:
        """Values by the autopilot's own parameter names, filters included."""
        return {self.names[role]: value for role, value in self.values.items()}

    @property
    def ranges(self) -> dict[str, GainRange]:
        """What a designer may move, by parameter name."""
        return gain_ranges(self.autopilot, self.axis)

    def with_gains(self, gains: Mapping[str, float] | None = None, **named: float) -> Self:
        """Copy with other parameter values, by the autopilot's names.

        Raises
        ------
        UnknownNameError
            The controller has no such parameter.
        """
        roles = {name: role for role, name in self.names.items()}
        changed = {**(gains or {}), **named}
        for name in changed:
            if name not in roles:
                raise UnknownNameError(
                    f"the {self.axis} controller has no such parameter",
                    found=name,
                    needed="one of " + ", ".join(roles),
                )
        values = {**self.values, **{roles[n]: float(v) for n, v in changed.items()}}
        return replace(self, values=values)

    def with_filters(self, values: Mapping[str, float]) -> Self:
        """Copy with other filters around a plant that was identified behind those of this loop.

        Raises
        ------
        UnknownNameError
            The controller has no such parameter.
        """
        return self.with_gains(values).around_plant_of(self)

    def around_plant_of(self, flown: AxisLoop) -> Self:
        """Copy around a plant that was identified behind the gyro filters of another loop."""
        held = flown._gyro_sections() if flown.plant_gyro is None else flown.plant_gyro
        return replace(self, plant_gyro=held)

    def with_notes(self, notes: tuple[str, ...]) -> Self:
        """Copy with more sentences in `unmodelled`."""
        return replace(self, unmodelled=self.unmodelled + notes)

    def feedback(
        self, omega_rad_s: ArrayLike, *, gyro: Gyro = "raw", with_hold: bool = True
    ) -> Response:
        """From measured rate to output, positive for negative feedback.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_f,)
            Frequencies above zero, rad/s.
        gyro : {"raw", "filtered"}
            Where the loop is entered: ahead of the gyro filters, or behind them for a plant that
            was identified from the filtered rate.
        with_hold : bool
            Whether the output is held for a loop and delayed by `computation_delay_s`; False for a
            plant that holds both already, as one identified from logged outputs does.

        Returns
        -------
        ndarray of complex, shape (n_f,)
            `output_unit` per rad/s.
        """
        terms, names = self.basis(omega_rad_s, gyro=gyro, with_hold=with_hold)
        gains = self.gains
        return np.asarray(np.array([gains[name] for name in names]) @ terms)

    def forward(self, omega_rad_s: ArrayLike, *, with_hold: bool = True) -> Response:
        """From rate set-point to output, target filter and feed-forward included."""
        terms, names = self.forward_basis(omega_rad_s, with_hold=with_hold)
        gains = self.gains
        return np.asarray(np.array([gains[name] for name in names]) @ terms)

    def angle(self, omega_rad_s: ArrayLike) -> Response:
        """From angle error (rad) to rate set-point (rad/s), with the loops it waits."""
        return np.asarray(self.angle_gain_1_s * self.set_point_delay(omega_rad_s))

    def set_point_delay(self, omega_rad_s: ArrayLike) -> Response:
        """From a rate set-point, as angle controller and log have it, to the loop that acts on it.

        Example
        -------
        >>> import flightid as fid
        >>> loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
        >>> loop.set_point_delay([10.0]).round(3)
        array([1.-0.025j])
        """
        omega = _frequencies(omega_rad_s)
        delay_s = self.set_point_delay_loops / self.loop_rate_hz
        return np.asarray(np.exp(-1j * omega * delay_s))

    def basis(
        self, omega_rad_s: ArrayLike, *, gyro: Gyro = "raw", with_hold: bool = True
    ) -> tuple[Response, tuple[str, ...]]:
        """Feedback per unit of each gain in which it is linear: shape (n_terms, n_f), and names."""
        omega = _frequencies(omega_rad_s)
        common = self.gyro_response(omega) if gyro == "raw" else self._beyond_plant(omega)
        return self._shared(self._feedback_terms(omega), common, omega, with_hold)

    def forward_basis(
        self, omega_rad_s: ArrayLike, *, with_hold: bool = True
    ) -> tuple[Response, tuple[str, ...]]:
        """Path from the rate set-point per unit of each gain: shape (n_terms, n_f), and names."""
        omega = _frequencies(omega_rad_s)
        return self._shared(
            self._forward_terms(omega), np.ones(omega.size, complex), omega, with_hold
        )

    def gyro_response(self, omega_rad_s: ArrayLike) -> Response:
        """Filters between the gyro's samples and the rate that the controller takes."""
        omega = _frequencies(omega_rad_s)
        return sections_response(self._gyro_sections(), omega, self.gyro_rate_hz)

    def plant_gyro_response(self, omega_rad_s: ArrayLike) -> Response:
        """Filters of the gyro that a plant identified from the filtered rate holds."""
        held = self._gyro_sections() if self.plant_gyro is None else self.plant_gyro
        return sections_response(held, _frequencies(omega_rad_s), self.gyro_rate_hz)

    def _beyond_plant(self, omega: Omega) -> Response:
        """What the gyro's filters do more than those that a filtered plant holds."""
        if self.plant_gyro is None:
            return np.ones(omega.size, dtype=np.complex128)
        own, held = list(self._gyro_sections()), list(self.plant_gyro)
        for section in [each for each in own if each in held]:
            if section in held:
                own.remove(section)
                held.remove(section)
        parts = (sections_response(each, omega, self.gyro_rate_hz) for each in (own, held))
        return np.asarray(np.divide(*parts))

    @property
    @abstractmethod
    def angle_gain_1_s(self) -> float:
        """Gain of the angle controller, 1/s."""

    @abstractmethod
    def run(
        self,
        setpoint_rad_s: ArrayLike,
        rate_rad_s: ArrayLike,
        flags: LoopFlags | None = None,
        *,
        gyro: Gyro = "filtered",
        single_precision: bool = True,
    ) -> LoopRun:
        """Run the controller's own recursion, at rest before the first sample.

        Parameters
        ----------
        setpoint_rad_s : array_like, shape (n,)
            Rate set-point of each loop, rad/s.
        rate_rad_s : array_like
            Rate of each loop, shape (n,), as the controller takes it; with ``gyro="raw"`` the
            gyro's samples at `gyro_rate_hz`, as many for each loop as the rates tell.
        flags : LoopFlags, optional
            Limits, landing, thrust.
        gyro : {"raw", "filtered"}
            What `rate_rad_s` is.
        single_precision : bool
            True: the firmware's arithmetic. False: double precision.
        """

    def runner(self) -> Callable[[float, float], float]:
        """The recursion one loop at a time, set-point and rate in: runs anew over all so far."""
        wanted, measured = array("d"), array("d")

        def step(setpoint_rad_s: float, rate_rad_s: float) -> float:
            wanted.append(setpoint_rad_s)
            measured.append(rate_rad_s)
            return float(self.run(np.array(wanted), np.array(measured)).output[-1])

        return step

    @abstractmethod
    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        """From the filtered rate, by role, per unit of the gain."""

    @abstractmethod
    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        """From the rate set-point, by role, per unit of the gain."""

    def filter_stages(self) -> tuple[FilterStage, ...]:
        """Filters that are on, from the gyro to the output."""
        return tuple(stage for stage in self._stages() if stage.sections)

    def _stages(self) -> tuple[FilterStage, ...]:
        """Filters; those that are off have no sections."""
        return ()

    def _gyro_sections(self) -> tuple[Section, ...]:
        """Second-order sections on the gyro: notches, then the low-pass."""
        return tuple(section for stage in self._gyro_stages() for section in stage.sections)

    def _gyro_stages(self) -> tuple[FilterStage, ...]:
        if "gyro_filter" not in self.values:
            return ()
        cutoff = self.values["gyro_filter"]
        low_pass = _native.gyro_low_pass_section(self.gyro_rate_hz, cutoff)
        name = self.names["gyro_filter"]
        return gyro_stages(self.gyro_notches, low_pass, name, cutoff, self.gyro_rate_hz)

    def _shared(
        self, terms: dict[str, Response], common: Response, omega: Omega, hold: bool
    ) -> tuple[Response, tuple[str, ...]]:
        shared = common * self._output_response(omega)
        if hold:
            delay = np.exp(-1j * omega * self.computation_delay_s)
            shared = shared * hold_response(omega, self.loop_rate_hz) * delay
        stacked = np.array(list(terms.values())) * shared
        return stacked, tuple(self.names[role] for role in terms)

    def _output_response(self, omega: Omega) -> Response:
        return np.ones(omega.size, dtype=np.complex128)

    @property
    def _samples_per_loop(self) -> int:
        ratio = self.gyro_rate_hz / self.loop_rate_hz
        if abs(ratio - round(ratio)) > 1e-6:
            raise OptionError(
                "raw gyro samples cannot be run",
                found=f"{ratio:.4g} samples in a loop",
                needed="a whole number",
                action="run the filtered rate instead",
            )
        return round(ratio)

    def summary(self) -> Table:
        """Parameters with their ranges."""
        ranges = self.ranges
        rows = tuple(
            (name, value, *_range_cells(ranges.get(name))) for name, value in self.gains.items()
        )
        columns = tuple(map(Column, ("parameter", "value", "low", "high", "unit", "note")))
        return Table(repr(self), columns, rows, self.unmodelled + self.unknown_notches)

    def _computed(self) -> dict[str, object]:
        return {
            "autopilot": self.autopilot,
            "gains": self.gains,
        }


def _range_cells(found: GainRange | None) -> tuple[float | None, float | None, str, str]:
    return (
        (None, None, "", "") if found is None else (found.low, found.high, found.unit, found.note)
    )


def _frequencies(omega_rad_s: ArrayLike) -> Omega:
    omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
    if omega.ndim != 1 or not np.all(omega > 0):
        raise OptionError(
            "the integrator has no response at these frequencies",
            found=f"shape {omega.shape}, lowest {omega.min() if omega.size else None} rad/s",
            needed="one axis of frequencies above zero",
        )
    return omega
