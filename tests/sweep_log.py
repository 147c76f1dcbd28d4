"""Logs with a known answer for the inspection: a copter that flies sweeps, and its failures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import chirp, lfilter

from flightid.logs.dataflash.writer import DataflashWriter

LETTERS = "RPY"
GYROS = ("GyrX", "GyrY", "GyrZ")


@dataclass(frozen=True)
class SweepFlight:
    """A flight of 5 s on the ground, sweeps about roll, pitch and yaw, 5 s on the ground."""

    rate_hz: float = 200.0
    sweep_s: float = 45.0
    amplitude: float = 0.1
    noise: float = 0.02
    airborne: bool = True
    injected: bool = True
    tips_over: bool = False
    motor_us: float = 1500.0
    imu_late_s: float = 0.0
    log_bitmask: float = 0.0

    def write(self, folder: Path) -> Path:
        time_s = np.arange(0.0, 10.0 + 3 * self.sweep_s, 1.0 / self.rate_hz)
        stamps = (1e7 + 1e6 * time_s).astype(np.int64)
        flying = (time_s >= 5.0) & (time_s < time_s[-1] - 5.0) & self.airborne
        commands, rates = self._motion(time_s, flying)
        writer = DataflashWriter()
        writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
        for name, value in self._parameters().items():
            writer.parameter(name, value)
        columns: dict[str, object] = {}
        for letter, command, rate in zip(LETTERS, commands, rates, strict=True):
            columns |= {f"{letter}Out": command, letter: np.degrees(rate), f"{letter}Des": 0.0}
        writer.add("RATE", stamps, columns)
        late = [np.interp(time_s - self.imu_late_s, time_s, rate) for rate in rates]
        writer.add("IMU", stamps, dict(zip(GYROS, late, strict=True)))
        self._slow(writer, time_s, stamps, flying)
        if self.injected and self.airborne:
            self._runs(writer, time_s, stamps, commands)
        return writer.write(folder / "sweeps.bin")

    def _parameters(self) -> dict[str, float]:
        motors = {f"SERVO{i}_FUNCTION": 32.0 + i for i in (1, 2, 3, 4)}
        return {
            **motors,
            "MOT_PWM_MIN": 1000.0,
            "MOT_PWM_MAX": 2000.0,
            "LOG_BITMASK": self.log_bitmask,
        }

    def _motion(
        self, time_s: NDArray[np.float64], flying: NDArray[np.bool_]
    ) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
        rng = np.random.default_rng(1)
        commands, rates = [], []
        pole = np.exp(-5.0 / self.rate_hz)
        for axis in range(3):
            local = time_s - 5.0 - axis * self.sweep_s
            during = (local >= 0) & (local < self.sweep_s)
            sweep = chirp(local, 0.2, self.sweep_s, 0.06 * self.rate_hz, "logarithmic", phi=-90)
            command = np.where(during & flying, self.amplitude * sweep, 0.0)
            command = command + 0.02 * self.amplitude * rng.standard_normal(time_s.size) * flying
            rate = lfilter([0, 10.0 * (1 - pole)], [1, -pole], command)
            commands.append(command)
            rates.append(rate + self.noise * flying * rng.standard_normal(time_s.size))
        return commands, rates

    def _slow(
        self,
        writer: DataflashWriter,
        time_s: NDArray[np.float64],
        stamps: NDArray[np.int64],
        flying: NDArray[np.bool_],
    ) -> None:
        every = slice(None, None, max(1, int(self.rate_hz / 10)))
        roll = np.zeros_like(time_s)
        if self.tips_over:
            fall = time_s[-1] - 5.0
            roll = np.clip((time_s - fall) * 60.0, 0.0, 70.0)
        writer.add("ATT", stamps[every], {"Roll": roll[every]})
        writer.add("CTUN", stamps[every], {"ThO": np.where(flying, 0.4, 0.0)[every]})
        outputs = np.where(flying, self.motor_us, 1000.0)[every]
        writer.add("RCOU", stamps[every], {f"C{i}": outputs for i in (1, 2, 3, 4)})

    def _runs(
        self,
        writer: DataflashWriter,
        time_s: NDArray[np.float64],
        stamps: NDArray[np.int64],
        commands: list[NDArray[np.float64]],
    ) -> None:
        for axis in range(3):
            start = 5.0 + axis * self.sweep_s
            during = (time_s >= start) & (time_s < start + self.sweep_s)
            settings = {"Ax": 10 + axis, "Mag": self.amplitude, "FSt": 0.2}
            settings |= {"FSp": 0.06 * self.rate_hz, "TC": 10.0, "TR": self.sweep_s - 1.0}
            writer.add("SIDS", stamps[during][:1], settings)
            local = {"Time": time_s[during] - start, "Targ": commands[axis][during]}
            writer.add("SIDD", stamps[during], local)
