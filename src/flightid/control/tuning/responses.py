"""Step and disturbance responses of the sampled loops, exact at the samples, for many plants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.gyro import Gyro
from flightid.control.tuning.controller_paths import (
    ControllerPaths,
    has_angle_loop,
    loop_responses,
    standing,
)
from flightid.control.tuning.loop_problem import Plants
from flightid.control.tuning.sampled_plants import (
    BELOW_NYQUIST,
    AxisLoops,
    SampledPlants,
    plants_of_axis,
)
from flightid.frozen import dataclass
from flightid.units import DIMENSIONLESS

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
CONTROL = "controller output"
"""What a controller of its own puts out at a step of the set-point."""
SHOWN_S = {
    "rate step": 1.0,
    "angle step": 2.0,
    "disturbance to rate": 2.0,
    "disturbance to angle": 4.0,
    "step": 2.0,
    "disturbance": 4.0,
    CONTROL: 2.0,
}
"""Time of a response that charts show, s."""
PLAIN = {"rate step": "step", "disturbance to rate": "disturbance", CONTROL: CONTROL}
"""The same of a loop that holds no rate."""
UNITS = {
    "rate step": "rad/s",
    "angle step": "rad",
    "disturbance to rate": "rad/s",
    "disturbance to angle": "rad",
    "step": "",
    "disturbance": "",
    CONTROL: "",
}
SETTLED_SHARE = 1e-3
"""Of a step: what an end that is settled may still miss."""
AT_A_TIME = 16
"""Plants whose pulses are held at once."""
FIRST_S, LONGEST = 8.0, 1 << 16
"""First length of a pulse response, s, and the most samples of one."""
LONGER, LAST_PART = 4, 16
"""Times as long as a response that has not settled the next one is; its last part of so many."""
LIKE_ZERO = 1e-4
"""Share of the lowest frequency at which the limit towards zero is taken."""
MOST_KEPT = 3
"""Grids whose plants are kept."""


@dataclass(frozen=True, eq=False)
class ResponseBand:
    """A time response of all plants.

    Attributes
    ----------
    name, unit : str
        What it is; a disturbance is one unit of output.
    time_s : ndarray, shape (n_t,)
    estimate, low, high : ndarray, shape (n_t,)
        Of the estimate, and the pointwise extremes of all plants.
    flown : ndarray, shape (n_t,), or None
        Of the estimate with the flown gains; None where they are unstable.
    """

    name: str
    unit: str
    time_s: Array
    estimate: Array
    low: Array
    high: Array
    flown: Array | None

    @property
    def overshoot(self) -> float:
        """Of a step of the estimate, share of the step."""
        return float(self.estimate.max() - 1.0)


@dataclass(frozen=True, eq=False)
class ClosedPlants:
    """Plants of one axis of several, asked for the time responses of one set of gains or more.

    Attributes
    ----------
    plants : SampledPlants
        The estimate first.
    place : int
        Which axis.
    gyro : {"raw", "filtered"}
        Which rate the plants end at.
    """

    plants: SampledPlants
    place: int
    gyro: Gyro
    _seen: dict[tuple[object, ...], Plants] = field(default_factory=dict)

    @cached_property
    def first(self) -> ClosedPlants:
        """The estimate alone."""
        return ClosedPlants(self.plants.take([0]), self.place, self.gyro)

    def axis(self, omega_rad_s: Array, loops: list[AxisLoop]) -> Plants:
        """The axis with the other loops closed: kept, as gains of this one do not change it."""
        others = (each.gains for k, each in enumerate(loops) if k != self.place)
        key = (len(omega_rad_s), *(tuple(each.items()) for each in others))
        if key not in self._seen:
            pairs = [standing(loop, omega_rad_s, self.gyro) for loop in loops]
            closed = AxisLoops(*(np.array(each) for each in zip(*pairs, strict=True)))
            seen = loop_responses(self.plants, omega_rad_s, loops, self.gyro)
            if len(self._seen) >= MOST_KEPT:
                self._seen.clear()
            self._seen[key] = plants_of_axis(
                *seen, omega_rad_s, self.plants.unstable, self.place, closed
            )
        return self._seen[key]


def responses(
    plants: SampledPlants,
    loops: list[AxisLoop],
    place: int,
    gyro: Gyro,
    *,
    shown_s: float | None = None,
) -> dict[str, tuple[Array, Array]]:
    """Responses of one axis to steps, for each plant, with all loops closed.

    The closed loop's pulse response is the inverse discrete Fourier transform of its exact
    response at e^(jωT), over a span in which it dies away; steps are its sums.

    Parameters
    ----------
    plants : SampledPlants
    loops : list of AxisLoop
        Controllers of all axes.
    place : int
        Which axis.
    gyro : {"raw", "filtered"}
        Which rate the plants end at.
    shown_s : float, optional
        Length, s; by default each response's own.

    Returns
    -------
    dict of str to tuple of ndarray
        Times (n_t,), s, and values (n_plants, n_t).

    Reference
    ---------
    Oppenheim & Schafer, *Discrete-Time Signal Processing*, 3rd ed., section 8.4 (sampling of the
    transform is aliasing in time, which vanishes where the response has died away).
    """
    return closed_responses(ClosedPlants(plants, place, gyro), loops, shown_s=shown_s)


def closed_responses(
    closed: ClosedPlants, loops: list[AxisLoop], *, shown_s: float | None = None
) -> dict[str, tuple[Array, Array]]:
    """The same of plants that are kept: other gains of the axis cost no new plants.

    Parameters
    ----------
    closed : ClosedPlants
    loops : list of AxisLoop
        Controllers of all axes.
    shown_s : float, optional
        Length, s; by default each response's own.
    """
    step, loop = closed.plants.sample_time_s, loops[closed.place]
    count = 1 << int(np.ceil(np.log2(FIRST_S * loop.time_scale / step)))

    def shown(told: str) -> tuple[str, int]:
        name = told if loop.inner == AxisLoop.inner else PLAIN[told]
        return name, 1 + round((shown_s or SHOWN_S[name] * loop.time_scale) / step)

    # The estimate alone says at little cost how long it takes; then all plants are asked.
    for some in ([closed.first] if len(closed.plants) > 1 else []) + [closed]:
        while True:
            steps: dict[str, list[Array]] = {}
            sizes: dict[str, list[tuple[float, float]]] = {}
            for told, pulse in _pulses(some, loops, count):
                steps.setdefault(told, []).append(np.cumsum(pulse[:, : shown(told)[1]], axis=1))
                size = np.abs(pulse)
                sizes.setdefault(told, []).append(
                    (size[:, -count // LAST_PART :].max(), size.max())
                )
            # What has not died away at the end stands in each sample that is summed and shown.
            ends = {told: np.max(each, axis=0) for told, each in sizes.items()}
            errors = [min(count, shown(told)[1]) * left / top for told, (left, top) in ends.items()]
            if max(errors) < SETTLED_SHARE or count >= LONGEST:
                break
            count *= LONGER
    found = {}
    for told, parts in steps.items():
        values = np.concatenate(parts)
        found[shown(told)[0]] = (np.arange(values.shape[1], dtype=np.float64) * step, values)
    return found


def _pulses(closed: ClosedPlants, loops: list[AxisLoop], count: int) -> Iterator[tuple[str, Array]]:
    """Pulse responses, (n, count) of some plants at a time: those of all are a gigabyte."""
    place, gyro, step = closed.place, closed.gyro, closed.plants.sample_time_s
    omega = np.pi / step * np.arange(count // 2 + 1) / (count // 2)
    omega[0], omega[-1] = LIKE_ZERO * omega[1], BELOW_NYQUIST * omega[-1]
    axis = closed.axis(omega, loops)
    feedback, outer = standing(loops[place], omega, gyro)
    paths = ControllerPaths(loops[place], gyro, has_angle_loop(loops[place]))
    terms = paths.forward(omega)
    gains = paths.gains_of(loops[place])
    forward = (gains[:-1] if paths.with_angle else gains) @ terms[:-1] + terms[-1]

    def pulse(response: Complex) -> Array:
        return np.asarray(np.fft.irfft(response, count, axis=-1))

    own = loops[place] if isinstance(loops[place], PidLoop) else None
    # The plants are in the controller's sense; what it puts out and what disturbs that are not.
    sense = -1.0 if isinstance(own, PidLoop) and own.direct else 1.0
    for start in range(0, len(axis.rate), AT_A_TIME):
        rate, angle = (each[start : start + AT_A_TIME] for each in (axis.rate, axis.angle))
        inner = feedback * rate
        opened, whole = 1.0 + inner, 1.0 + (inner + outer * angle)
        yield "rate step", pulse(forward * rate / opened)
        yield "disturbance to rate", pulse(sense * rate / whole)
        if own is not None:
            yield CONTROL, pulse(sense * forward / opened)
        if paths.with_angle:
            yield "angle step", pulse(outer * angle / whole)
            yield "disturbance to angle", pulse(angle / whole)


def response_bands(
    closed: ClosedPlants, new: list[AxisLoop], flown: list[AxisLoop] | None
) -> tuple[ResponseBand, ...]:
    """Responses of all plants as bands, beside the flown gains.

    Parameters
    ----------
    closed : ClosedPlants
        The estimate first.
    new, flown : list of AxisLoop
        Controllers of all axes; `flown` is None where they are not stable.

    Returns
    -------
    tuple of ResponseBand
    """
    made = closed_responses(closed, new)
    before = {} if flown is None else closed_responses(closed.first, flown)
    return tuple(
        ResponseBand(
            name,
            _unit(name, new[closed.place]),
            time_s,
            values[0],
            values.min(axis=0),
            values.max(axis=0),
            before[name][1][0] if name in before else None,
        )
        for name, (time_s, values) in sorted(made.items(), reverse=True)
    )


def _unit(name: str, loop: AxisLoop) -> str:
    """Of a response; of a controller of its own that of what it measures or moves."""
    if not isinstance(loop, PidLoop) or not loop.units:
        return UNITS[name]
    measured, moved = ("" if each == DIMENSIONLESS else each for each in loop.units)
    return moved if name == CONTROL else measured
