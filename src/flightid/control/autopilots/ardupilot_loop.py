"""ArduPilot's rate PID as a loop: what multicopters, helicopters and planes share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from flightid import _native
from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.filter_stages import (
    FilterPath,
    FilterStage,
    notch_stage,
    pole_stage,
)
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    difference_response,
    one_pole_response,
    sections_response,
)
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, LoopState, samples
from flightid.control.gyro import Gyro
from flightid.frozen import dataclass

NOTCH_OFF = (0.0, 0.0, 0.0)
PID_COLUMNS = ("Tar", "Err", "P", "I", "D", "FF", "DFF", "Dmod", "SRate")
"""Columns of the native PID, under the names of the PIDR message."""


@dataclass(frozen=True, repr=False)
class ArduPilotLoop(AxisLoop):
    """An axis whose rate controller is AC_PID.

    Attributes
    ----------
    target_notch, error_notch : tuple of float
        Notches that NTF and NEF name: centre (Hz), quality, attenuation (dB); zeros are off.
    """

    target_notch: tuple[float, float, float] = NOTCH_OFF
    error_notch: tuple[float, float, float] = NOTCH_OFF

    def _notch(self, settings: tuple[float, float, float], omega: Omega) -> Response:
        section = _native.ardupilot_notch_section(self.loop_rate_hz, *settings)
        return sections_response([section] if section else [], omega, self.loop_rate_hz)

    def _pole(self, role: str, omega: Omega) -> Response:
        return one_pole_response(self.values[role], omega, self.loop_rate_hz)

    def _stages(self) -> tuple[FilterStage, ...]:
        rate, names, values = self.loop_rate_hz, self.names, self.values

        def notch(role: str, path: FilterPath, at: tuple[float, float, float]) -> FilterStage:
            section = _native.ardupilot_notch_section(rate, *at)
            return notch_stage(names[role], path, rate, [section])

        return (
            *self._gyro_stages(),
            notch("nef", "error", self.error_notch),
            pole_stage(names["flte"], values["flte"], "error", rate),
            pole_stage(names["fltd"], values["fltd"], "derivative", rate),
            notch("ntf", "target", self.target_notch),
            pole_stage(names["fltt"], values["fltt"], "target", rate),
        )

    def _target_filter(self, omega: Omega) -> Response:
        return self._notch(self.target_notch, omega) * self._pole("fltt", omega)

    def _integrator(self, omega: Omega) -> Response:
        return np.asarray(1 / difference_response(omega, self.loop_rate_hz))

    def _pid_terms(self, omega: Omega) -> dict[str, Response]:
        """P, I and D from the error, per unit of the gain."""
        error = self._notch(self.error_notch, omega) * self._pole("flte", omega)
        slope = difference_response(omega, self.loop_rate_hz) * self._pole("fltd", omega)
        return {"p": error, "i": error * self._integrator(omega), "d": error * slope}

    def _filtered(self, raw: ArrayLike, single_precision: bool) -> np.ndarray:
        rate, _ = _native.gyro_filters(
            np.ascontiguousarray(raw, dtype=np.float64),
            self.gyro_rate_hz,
            list(self.gyro_notches),
            self.values["gyro_filter"],
            0.0,
            self._samples_per_loop,
            single_precision,
        )
        return rate

    def _pid(
        self,
        target: np.ndarray,
        rate: np.ndarray,
        flags: LoopFlags,
        single_precision: bool,
        *,
        leak: tuple[float, float] | None = None,
        slew_scale: float = 1.0,
    ) -> dict[str, np.ndarray]:
        roles = ("p", "i", "d", "ff", "d_ff", "imax", "pdmx", "fltt", "flte", "fltd", "smax")
        gains: dict[str, object] = {role: self.values[role] for role in roles}
        gains |= {"target_notch": self.target_notch, "error_notch": self.error_notch}
        limited = np.zeros(target.size, dtype=bool) if flags.limited is None else flags.limited
        rows = _native.ardupilot_pid(
            gains,
            1 / self.loop_rate_hz,
            target,
            rate,
            np.ascontiguousarray(np.atleast_2d(limited.T).any(axis=0)),
            leak,
            slew_scale,
            _start(flags),
            single_precision,
        )
        return dict(zip(PID_COLUMNS, rows.T, strict=True))

    def run(
        self,
        setpoint_rad_s: ArrayLike,
        rate_rad_s: ArrayLike,
        flags: LoopFlags | None = None,
        *,
        gyro: Gyro = "filtered",
        single_precision: bool = True,
    ) -> LoopRun:
        """See `AxisLoop.run`."""
        per_loop = self._samples_per_loop if gyro == "raw" else 1
        setpoint, rate = samples(setpoint_rad_s, rate_rad_s, per_loop)
        if gyro == "raw":
            rate = self._filtered(rate, single_precision)
        terms = self._terms(setpoint, rate, flags or LoopFlags(), single_precision)
        output = sum(
            (terms[name] for name in ("P", "I", "D", "FF", "DFF")), np.zeros(setpoint.size)
        )
        return LoopRun(output, terms, rate)

    def runner(self) -> Callable[[float, float], float]:
        """See `AxisLoop.runner`; goes on from the last loop's state where that is all there is."""
        if self.values["smax"] or {self.target_notch, self.error_notch} != {NOTCH_OFF}:
            return super().runner()
        state: LoopState | None = None

        def step(setpoint_rad_s: float, rate_rad_s: float) -> float:
            nonlocal state
            made = self.run([setpoint_rad_s], [rate_rad_s], LoopFlags(start=state))
            last = {name: float(row[0]) for name, row in made.terms.items()}
            state = self.state(last, setpoint_rad_s)
            return float(made.output[0])

        return step

    def without_target_filter(self) -> Self:
        """Copy for set-points that were logged behind the target's filters."""
        off = {self.names["fltt"]: 0.0}
        return replace(self.with_gains(off), target_notch=NOTCH_OFF)

    def state(self, logged: Mapping[str, float], setpoint_rad_s: float) -> LoopState:
        """State of the loop from its logged terms, those of PIDR by name."""
        d = self.values["d"]
        return LoopState(
            target=logged.get("Tar", setpoint_rad_s),
            error=logged.get("Err", 0.0),
            derivative=logged["D"] / d if d else 0.0,
            integrator=logged["I"],
        )

    @abstractmethod
    def _terms(
        self, setpoint: np.ndarray, rate: np.ndarray, flags: LoopFlags, single_precision: bool
    ) -> dict[str, np.ndarray]:
        """Terms of every loop under the names of PIDR."""


def _start(flags: LoopFlags) -> tuple[float, float, float, float] | None:
    start = flags.start
    if start is None:
        return None
    return start.target, start.error, start.derivative, start.integrator
