"""A vehicle in a pilot's loop: stick, sweep, law, failed sensors, actuators and air."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flightid.app.fly_vehicles import FlyVehicle
from flightid.excitation import Excitation
from flightid.frozen import dataclass
from flightid.models import LinearSystem
from flightid.simulation.stepper import Controller, Stepper
from flightid.study.loop_blocks import law_controller

Failure = Literal["frozen", "zero", "biased"]
MOST_DELAY_S = 0.5


@dataclass(frozen=True)
class PilotSeat:
    """What stands between a hand and the vehicle, and between the vehicle and the eye.

    Attributes
    ----------
    actuator_delay_s, display_delay_s : float
        In whole frames, s.
    stick_rad_s : float, optional
        Second-order stick of this natural frequency, rad/s; left out: a hand moves it at once.
    stick_damping : float
    """

    actuator_delay_s: float = 0.0
    display_delay_s: float = 0.0
    stick_rad_s: float | None = None
    stick_damping: float = 0.7


@dataclass
class FlySwitches:
    """What a pilot may switch in flight.

    Attributes
    ----------
    law, gusts : bool
        Whether they act; the law's filters run on where it does not.
    failures : dict of str to str
        By sensor what the law hears of it: its last value, nothing, or too much.
    bias : float
        Of a biased sensor, in its unit.
    """

    law: bool = True
    gusts: bool = False
    failures: dict[str, Failure] = field(default_factory=dict)
    bias: float = 0.1


class FailedSensors:
    """What a law hears of a vehicle whose sensors fail; the vehicle itself and its record do not.

    Example
    -------
    >>> switches = FlySwitches(failures={"q": "zero"})
    >>> FailedSensors(switches).heard({"p": 0.1, "q": 0.2})
    {'p': 0.1, 'q': 0.0}
    """

    def __init__(self, switches: FlySwitches) -> None:
        self._switches = switches
        self._frozen: dict[str, float] = {}

    def heard(self, outputs: Mapping[str, float]) -> dict[str, float]:
        """Outputs as the law hears them."""
        found, failures = dict(outputs), self._switches.failures
        self._frozen = {n: v for n, v in self._frozen.items() if failures.get(n) == "frozen"}
        for name, kind in failures.items():
            if name not in found:
                continue
            if kind == "frozen":
                found[name] = self._frozen.setdefault(name, found[name])
            else:
                found[name] = 0.0 if kind == "zero" else found[name] + self._switches.bias
        return found


class DelayLine:
    """Inputs late by whole frames.

    Example
    -------
    >>> line = DelayLine(1, {"u": 0.0})
    >>> line.passed({"u": 1.0}), line.passed({"u": 2.0})
    ({'u': 0.0}, {'u': 1.0})
    """

    def __init__(self, frames: int, rest: Mapping[str, float]) -> None:
        self._row = deque([dict(rest) for _ in range(frames)])

    def passed(self, values: Mapping[str, float]) -> dict[str, float]:
        """What went in so many frames ago."""
        self._row.append(dict(values))
        return self._row.popleft()


class PilotedVehicle(Stepper):
    """A vehicle with all that stands around it, stepped as `Stepper` steps a model.

    Parameters
    ----------
    vehicle : FlyVehicle
    sample_time_s : float
        s.
    switches : FlySwitches
        Read each frame; whoever holds them moves them.
    seat : PilotSeat
    seed : int
        Of gusts and sensors.

    Attributes
    ----------
    driven : dict of str to float
        What has reached the vehicle's inputs in the last frame.
    added : dict of str to float
        What the law has added.
    swept : dict of str to float
        What the sweep has added; the instrument of an identification.
    swept_s : dict of str to float
        How long each input that a hand moves was swept so far, s.
    """

    def __init__(
        self,
        vehicle: FlyVehicle,
        sample_time_s: float,
        *,
        switches: FlySwitches,
        seat: PilotSeat | None = None,
        seed: int = 0,
    ) -> None:
        made = seat or PilotSeat()
        model = vehicle.model
        super().__init__(model, sample_time_s, noise=vehicle.noise(seed))
        self._switches, self._sensors = switches, FailedSensors(switches)
        self._law: Controller | None = None
        if vehicle.law:
            self._law = law_controller(vehicle.law, model, sample_time_s)
        late = round(made.actuator_delay_s / sample_time_s)
        self._late = DelayLine(late, self.rest)
        self._hands = _hands(self.inputs, sample_time_s, made)
        self._reach = vehicle.reach
        self._sweep: dict[str, NDArray[np.float64]] = {}
        self._swept_frames = 0
        self._step_s, self.swept_s = sample_time_s, dict.fromkeys(vehicle.reach, 0.0)
        self._seen = dict.fromkeys(self.outputs, 0.0)
        self.driven = dict(self.rest)
        self.swept, self.added = (dict.fromkeys(self.inputs, 0.0) for _ in range(2))

    @property
    def sweeping(self) -> bool:
        """Whether a sweep runs."""
        return bool(self._sweep)

    def sweep(self, excitation: Excitation | None) -> None:
        """Begin to add an excitation to its input, or end what is added."""
        signals = {} if excitation is None else dict(
            zip(excitation.names, excitation.signals, strict=True)
        )  # fmt: skip
        self._swept_frames, self._sweep = 0, signals

    def step(self, inputs: Mapping[str, float]) -> dict[str, float]:
        """Advance one sample; as `Stepper.step`."""
        stick = {name: inputs.get(name, 0.0) for name in self.inputs}
        for name, hand in self._hands.items():
            stick[name] = hand.step({"hand": stick[name]})["stick"]
        self.swept = self._excitation()
        moved = {name: stick[name] + self.swept[name] for name in self.inputs}
        self.added = dict.fromkeys(self.inputs, 0.0)
        if self._law is not None:
            # A law that is off hears on, so that it comes back without a jump of its filters.
            told = self._law.step(moved, self._sensors.heard(self._seen))
            if self._switches.law:
                self.added |= told
        # A hand moves from trim; what it does not reach rests there.
        wanted = dict(self.rest)
        for name, reach in self._reach.items():
            wanted[name] += min(reach, max(-reach, moved[name] + self.added[name]))
        self.driven = self._late.passed(wanted)
        self.calm = not self._switches.gusts
        self._seen = super().step(self.driven)
        return self._seen

    def _excitation(self) -> dict[str, float]:
        found = dict.fromkeys(self.inputs, 0.0)
        for name, row in list(self._sweep.items()):
            if self._swept_frames < len(row):
                found[name] = float(row[self._swept_frames])
                self.swept_s[name] = self.swept_s.get(name, 0.0) + self._step_s
            else:
                self._sweep = {}
        self._swept_frames += bool(self._sweep)
        return found


def _hands(inputs: tuple[str, ...], step_s: float, seat: PilotSeat) -> dict[str, Stepper]:
    """A second-order stick for each input: ω² / (s² + 2ζω s + ω²)."""
    if seat.stick_rad_s is None:
        return {}
    w = seat.stick_rad_s
    if not (math.isfinite(w) and w > 0.0):
        return {}
    system = LinearSystem(
        [[0.0, 1.0], [-w * w, -2.0 * seat.stick_damping * w]], [[0.0], [w * w]],
        [[1.0, 0.0]], [[0.0]], ("hand",), ("stick",),
    )  # fmt: skip
    return {name: Stepper(system, step_s) for name in inputs}
