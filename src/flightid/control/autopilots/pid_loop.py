"""A PID controller of its own, for a rig or a vehicle without an autopilot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    difference_response,
    one_pole_response,
)
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, samples
from flightid.control.autopilots.parameter_table import GainRange
from flightid.control.gyro import Gyro
from flightid.frozen import dataclass
from flightid.table import Column, Table
from flightid.units import DIMENSIONLESS

FORMS = {
    "parallel": "Kp + Ki/s + Kd s/(Tf s + 1)",
    "ideal": "K (1 + 1/(Ti s) + Td s/(Tf s + 1))",
    "series": "K (1 + 1/(Ti s)) (Td s + 1)/(Tf s + 1)",
}


@dataclass(frozen=True, repr=False)
class PidLoop(AxisLoop):
    """One loop u = ±(Kp (b r − y) + Ki ∫(r − y) + Kd d/dt (c r − y)/(Tf s + 1)), limits behind it.

    Sampled: backward differences for integral and derivative; every sample the integral is driven
    back by T/Tt of what the limits took (back calculation), and by nothing where Tt is zero.
    Continuous (`sampled` False): the same law as written, without a recursion.

    Attributes
    ----------
    ranges_by_name : mapping of str to GainRange
        What a search may try.
    sampled : bool
        Whether the controller runs at `loop_rate_hz`.
    direct : bool
        Whether the sign of the error is turned: a plant whose output falls as its input rises.
    low, high, rate_per_s : float or None
        Limits of the output, and of its change per second.
    units : tuple of str
        Of what it measures and of what it moves; empty where nobody knows them.
    time_scale : float
        Of the loop's dynamics over those of a vehicle's rate loop.

    Reference
    ---------
    Åström & Hägglund, *Advanced PID Control* (2006), sections 3.3 (forms), 3.4 (set-point weights),
    3.5 (anti-windup) and 13.4 (sampled).

    Example
    -------
    >>> loop = PidLoop("y", {"p": 2.0, "i": 1.0, "d": 0.5, "b": 1.0, "c": 0.0, "filter_s": 0.1},
    ...     {"p": "Kp", "i": "Ki", "d": "Kd", "b": "b", "c": "c", "filter_s": "Tf"}, 50.0, 50.0)
    >>> loop.form("ideal")
    {'K': 2.0, 'Ti': 2.0, 'Td': 0.25, 'Tf': 0.1}
    """

    ranges_by_name: Mapping[str, GainRange] = field(default_factory=dict)
    sampled: bool = True
    direct: bool = False
    low: float | None = None
    high: float | None = None
    rate_per_s: float | None = None
    time_scale: float = 1.0
    units: tuple[str, ...] = ()
    autopilot: ClassVar[str] = "pid"
    inner: ClassVar[str] = "loop"

    @property
    def has_flown(self) -> bool:
        """Whether it has gains to compare with."""
        return any(self.values.get(role, 0.0) for role in "pid")

    @property
    def ranges(self) -> dict[str, GainRange]:
        """What a search may try, by name."""
        return dict(self.ranges_by_name)

    @property
    def angle_gain_1_s(self) -> float:
        """Zero: there is no loop around this one."""
        return 0.0

    def unit_told(self, role: str) -> str:
        """Unit of a gain by its role: output over measurement, where both are known.

        Example
        -------
        >>> PidLoop("y", {}, {}, 50.0, 50.0, units=("deg", "%")).unit_told("i")
        '%/(deg s)'
        """
        if not {*self.units} - {DIMENSIONLESS}:
            return {"p": "", "i": "1/s", "d": "s"}[role]
        measured, moved = self.units
        over = {"p": measured, "i": f"{measured} s", "d": measured}[role]
        above = moved if role != "d" else "s" if moved == DIMENSIONLESS else f"{moved} s"
        if measured == DIMENSIONLESS:
            return above if role != "i" else f"{moved}/s"
        return f"{above}/({over})" if set(over) & set(" /*") else f"{above}/{over}"

    def form(self, name: str) -> dict[str, float] | None:
        """Gains in one of the usual forms, the same transfer function in each.

        Parameters
        ----------
        name : {"parallel", "ideal", "series"}
            `FORMS` says what each means.

        Returns
        -------
        dict of str to float, or None
            None where the controller has no such form: no proportional part, or (series) zeros
            that are complex.
        """
        p, i, d = (self.values.get(role, 0.0) for role in "pid")
        lag = self.values.get("filter_s", 0.0) if "d" in self.values else 0.0
        tail = {"Tf": lag} if "d" in self.values else {}
        if name == "parallel":
            return {"Kp": p, "Ki": i, "Kd": d} | tail
        if not p > 0.0:
            return None
        if name == "ideal":
            return _without_infinite({"K": p, "Ti": p / i if i else np.inf, "Td": d / p} | tail)
        if not i > 0.0:
            return {"K": p, "Td": d / p + lag} | tail
        # (Kp s + Ki)(Tf s + 1) + Kd s² = Ki (Ti s + 1)(Td s + 1)
        total, product = (p + i * lag) / i, (p * lag + d) / i
        root = total**2 - 4.0 * product
        if root < 0.0:
            return None
        slow = 0.5 * (total + np.sqrt(root))
        return {"K": i * slow, "Ti": float(slow), "Td": float(product / slow)} | tail

    def settings(self) -> dict[str, object]:
        """All numbers that running the controller needs, by name, none that is not there."""
        known: dict[str, object] = {
            "output": self.axis,
            "sample_time_s": 1.0 / self.loop_rate_hz if self.sampled else None,
            "direct_action": self.direct,
            **{self.names[role]: value for role, value in self.values.items()},
            "output_low": self.low,
            "output_high": self.high,
            "output_rate_per_s": self.rate_per_s,
        }
        forms = {name: self.form(name) for name in FORMS}
        return {key: value for key, value in (known | forms).items() if value is not None}

    def form_table(self) -> Table:
        """The gains in every form that there is."""
        rows = []
        for name, law in FORMS.items():
            found = self.form(name)
            words = "none: its zeros are complex" if found is None else _listed(found)
            rows.append((name, law, words))
        columns = (Column("form"), Column("transfer function"), Column("gains"))
        return Table(f"Controller of {self.axis}", columns, tuple(rows), self.remarks())

    def remarks(self) -> tuple[str, ...]:
        """What else is needed to run the controller, one sentence each."""
        b, c = self.values["b"], self.values["c"]
        made = [
            f"Set-point weights: b = {b:.4g} (proportional), c = {c:.4g} (derivative).",
            "Action: direct, the error is y − r." if self.direct else "Action: error is r − y.",
            f"Sampled at {self.loop_rate_hz:g} Hz, backward differences."
            if self.sampled
            else "Continuous: sample at least 30 times as fast as it crosses over.",
        ]
        if {*self.units} - {DIMENSIONLESS}:
            measured, moved = (_unit_words(each) for each in self.units)
            made.insert(0, f"Set-point and measurement {measured}, output {moved}.")
        if self.values.get("tracking_s"):
            made.append(f"Anti-windup: back calculation, Tt = {self.values['tracking_s']:.4g} s.")
        limits = zip(
            ("low", "high", "change per s"), (self.low, self.high, self.rate_per_s), strict=True
        )
        words = [f"{word} {limit:g}" for word, limit in limits if limit is not None]
        if words:
            made.append(f"Limits of the output: {', '.join(words)}; margins are those inside.")
        return tuple(made)

    def run(
        self,
        setpoint_rad_s: ArrayLike,
        rate_rad_s: ArrayLike,
        flags: LoopFlags | None = None,  # noqa: ARG002 — it knows its own limits
        *,
        gyro: Gyro = "filtered",  # noqa: ARG002
        single_precision: bool = False,  # noqa: ARG002
    ) -> LoopRun:
        """Run the recursion from rest on set-points and measurements, in their own units."""
        target, measured = samples(setpoint_rad_s, rate_rad_s, 1)
        step = self._recursion()
        rows = np.array([step(r, y) for r, y in zip(target, measured, strict=True)]).reshape(-1, 4)
        return LoopRun(rows[:, 0], dict(zip("PID", rows.T[1:], strict=True)), measured)

    def runner(self) -> Callable[[float, float], float]:
        """See `AxisLoop.runner`."""
        step = self._recursion()
        return lambda setpoint, measured: step(setpoint, measured)[0]

    def _recursion(self) -> Callable[[float, float], tuple[float, float, float, float]]:
        """From set-point and measurement of a loop to output, P, I and D."""
        step, sense = 1.0 / self.loop_rate_hz, -1.0 if self.direct else 1.0
        p, i, d = (self.values.get(role, 0.0) for role in "pid")
        b, c, lag = self.values["b"], self.values["c"], self.values["filter_s"]
        tracking = self.values.get("tracking_s", 0.0)
        back = min(1.0, step / tracking) if tracking else 0.0
        low, high = (side if each is None else each for side, each in
                     ((-np.inf, self.low), (np.inf, self.high)))  # fmt: skip
        reach = np.inf if self.rate_per_s is None else self.rate_per_s * step
        integral = slope = before = last = 0.0

        def after(setpoint: float, measurement: float) -> tuple[float, float, float, float]:
            nonlocal integral, slope, before, last
            r, y = sense * setpoint, sense * measurement
            slope = (lag * slope + d * ((c * r - y) - before)) / (lag + step)
            before = c * r - y
            integral += i * step * (r - y)
            terms = p * (b * r - y), integral, slope
            asked = sum(terms)
            last = float(np.clip(np.clip(asked, last - reach, last + reach), low, high))
            integral += back * (last - asked) if i else 0.0
            return (last, *terms)

        return after

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        terms = {"p": np.ones(omega.size, complex), "i": self._integral(omega)}
        terms["d"] = self._slope(omega)
        return {role: term for role, term in terms.items() if role in self.names}

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        weights = {"p": self.values["b"], "i": 1.0, "d": self.values["c"]}
        return {r: weights[r] * term for r, term in self._feedback_terms(omega).items()}

    def _integral(self, omega: Omega) -> Response:
        rise = difference_response(omega, self.loop_rate_hz) if self.sampled else 1j * omega
        return np.asarray(1.0 / rise)

    def _slope(self, omega: Omega) -> Response:
        lag = self.values["filter_s"]
        if not self.sampled:
            return np.asarray(1j * omega / (1.0 + 1j * omega * lag))
        corner = 1.0 / (2.0 * np.pi * lag) if lag else 0.0
        pole = one_pole_response(corner, omega, self.loop_rate_hz)
        return difference_response(omega, self.loop_rate_hz) * pole

    def _tables(self) -> tuple[Table, ...]:
        return (self.summary(), self.form_table())


def _without_infinite(values: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in values.items() if np.isfinite(value)}


def _listed(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items() if value)


def _unit_words(unit: str) -> str:
    return "a number without unit" if unit == DIMENSIONLESS else f"in {unit}"
