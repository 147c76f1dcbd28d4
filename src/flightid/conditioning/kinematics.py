"""Kinematic model of the consistency check: instruments around the native reconstruction.

Native half: `kinematics.rs`. A measured input is ``m = (1 + scale) true + bias``; a measured output
``z(t) = (1 + scale) y(t - delay) + bias``. Outputs are states or functions of them; their
derivatives by every parameter are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid._native import reconstruct_kinematics
from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.record.formats.name_units import unit_at_end
from flightid.uncertainty.input_noise import InputNoise, white_deviation
from flightid.units import is_convertible

Array = NDArray[np.float64]

RATES = ("p", "q", "r")
FORCES = ("ax", "ay", "az")
STATES = ("phi", "theta", "psi", "u", "v", "w")
UNITS = {
    **dict.fromkeys(RATES, "rad/s"),
    **dict.fromkeys(FORCES, "m/s^2"),
    **dict.fromkeys(("phi", "theta", "psi", "alpha", "beta"), "rad"),
    **dict.fromkeys(("u", "v", "w", "vn", "ve", "vd", "V"), "m/s"),
}
INPUTS = (*RATES, *FORCES)
OUTPUTS = tuple(name for name in UNITS if name not in INPUTS)
VELOCITIES = ("u", "v", "w", "vn", "ve", "vd", "V", "alpha", "beta")


def columns_of(record: Record) -> dict[str, str]:
    """Channels of a record by canonical name: of that name, else with their unit at its end.

    Example
    -------
    >>> of_rates = {"p": [0.0, 0.1], "q_radps": [0.0, 0.1], "r_of_tail": [0.0, 0.1]}
    >>> columns_of(Record.from_arrays([0, 1], outputs=of_rates, units={"q_radps": "rad/s"}))
    {'p': 'p', 'q': 'q_radps'}
    """
    found: dict[str, str] = {}
    for name, unit in UNITS.items():
        named = [name] if name in record else []
        named += [
            label
            for label in record.channels
            if label.partition("_")[0] == name and unit_at_end(label) is not None
            if is_convertible(record.unit(label), unit)
        ]
        found |= {name: named[0]} if named else {}
    return found


@dataclass(frozen=True)
class KinematicOutputs:
    """Predicted outputs (n_outputs, n) and their derivatives (n_outputs, n, n_parameters)."""

    values: Array
    slopes: Array


@dataclass(frozen=True)
class KinematicModel:
    """Measured inputs, names of the outputs, and the parameters in order.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Uniform stamps.
    inputs : mapping of str to ndarray, shape (n,)
        Measured rates and, with velocities, specific forces.
    outputs : tuple of str
        Measured outputs.
    parameters : tuple of str
        ``"<state>_0"``, ``"bias_<channel>"``, ``"scale_<channel>"``, ``"delay_<output>"``.
    """

    time_s: Array
    inputs: Mapping[str, Array]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]

    @property
    def gravity(self) -> float:
        """Gravity, m/s²; none where no velocity is reconstructed, so that nothing overflows."""
        return STANDARD_GRAVITY_M_S2 if FORCES[0] in self.inputs else 0.0

    @cached_property
    def _half_steps(self) -> Array:
        """Measured inputs at samples and half way, (2 n - 1, 6)."""
        n = self.time_s.size
        fine = np.linspace(self.time_s[0], self.time_s[-1], 2 * n - 1)
        table = np.zeros((2 * n - 1, len(INPUTS)))
        for column, name in enumerate(INPUTS):
            if name in self.inputs:
                table[:, column] = scipy.interpolate.CubicSpline(self.time_s, self.inputs[name])(
                    fine
                )
        return table

    def predict(self, theta: Sequence[float] | Array) -> KinematicOutputs:
        """Outputs and their derivatives at parameter values in the order of `parameters`.

        Raises
        ------
        OptionError
            The reconstructed pitch angle reaches 90 degrees.
        """
        value, gain, states, raw = self._reconstructed(theta)
        slopes = self._by_parameter(raw, gain)
        found = [
            self._output(name, states, slopes, value, self.parameters) for name in self.outputs
        ]
        return KinematicOutputs(np.array([y for y, _ in found]), np.array([s for _, s in found]))

    def input_noise(self, theta: Sequence[float] | Array) -> InputNoise:
        """White noise of the inputs and its way to the outputs at these parameters."""
        value, gain, states, raw = self._reconstructed(theta)
        by_start = raw[:, :, :6]
        # Offsets since the start, brought back to it; their growth is what one step adds.
        steps = np.diff(np.linalg.solve(by_start, raw[:, :, 6:12]), axis=0) / gain
        slopes = [self._output(name, states, by_start, value, ())[1] for name in self.outputs]
        delays = np.array([value.get(f"delay_{name}", 0.0) for name in self.outputs])
        deviations = [white_deviation(self.inputs[k]) if k in self.inputs else 0.0 for k in INPUTS]
        late = np.rint(delays / self._step_s).astype(np.int_)
        return InputNoise(np.array(deviations), np.array(slopes), steps, late)

    @property
    def _step_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0]) / (self.time_s.size - 1)

    def _reconstructed(
        self, theta: Sequence[float] | Array
    ) -> tuple[dict[str, float], Array, Array, Array]:
        """Parameters by name, gains of the inputs, states, and their raw sensitivities."""
        value = dict(zip(self.parameters, np.asarray(theta, dtype=np.float64), strict=True))
        bias = np.array([value.get(f"bias_{name}", 0.0) for name in INPUTS])
        gain = 1 + np.array([value.get(f"scale_{name}", 0.0) for name in INPUTS])
        start = np.array([value.get(f"{name}_0", 0.0) for name in STATES])
        states, raw = reconstruct_kinematics(
            np.ascontiguousarray((self._half_steps - bias) / gain),
            start,
            self._step_s,
            self.gravity,
        )
        return value, gain, states, raw

    def _by_parameter(self, raw: Array, gain: Array) -> Array:
        """Derivatives of the states by the model's parameters, (n, 6, n_parameters)."""
        slopes = np.zeros((*raw.shape[:2], len(self.parameters)))
        for column, parameter in enumerate(self.parameters):
            kind, _, name = parameter.partition("_")
            if parameter.endswith("_0"):
                slopes[:, :, column] = raw[:, :, STATES.index(parameter.removesuffix("_0"))]
            elif name in INPUTS:
                # true = (m - bias) / gain, so a bias offsets it and a scale multiplies it.
                j = INPUTS.index(name)
                source = 6 + j if kind == "bias" else 12 + j
                slopes[:, :, column] = -raw[:, :, source] / gain[j]
        return slopes

    def _output(
        self,
        name: str,
        states: Array,
        slopes: Array,
        value: Mapping[str, float],
        parameters: tuple[str, ...],
    ) -> tuple[Array, Array]:
        """One output and its derivatives; `parameters` name the columns of `slopes`."""
        y, gradient = OUTPUT_FUNCTIONS[name](states)
        slope = np.einsum("nx,nxc->nc", gradient, slopes)
        delay = value.get(f"delay_{name}")
        drift = np.zeros_like(y)
        if delay is not None:
            late = self.time_s - delay
            both = scipy.interpolate.CubicSpline(self.time_s, np.column_stack([y, slope]))
            moved, drift = both(late), both(late, 1)[:, 0]
            y, slope = moved[:, 0], moved[:, 1:]
        gain = 1 + value.get(f"scale_{name}", 0.0)
        slope = gain * slope
        for kind, own in (("bias", 1.0), ("scale", y), ("delay", -gain * drift)):
            if f"{kind}_{name}" in parameters:
                slope[:, parameters.index(f"{kind}_{name}")] += own
        return gain * y + value.get(f"bias_{name}", 0.0), slope


OutputFunction = Callable[[Array], tuple[Array, Array]]


def _state(index: int) -> OutputFunction:
    def output(states: Array) -> tuple[Array, Array]:
        gradient = np.zeros_like(states)
        gradient[:, index] = 1.0
        return states[:, index], gradient

    return output


def _ground(row: int) -> OutputFunction:
    def output(states: Array) -> tuple[Array, Array]:
        phi, theta, psi, u, v, w = states.T
        rows = rotation_rows(phi, theta, psi)
        north, east, down = (a * u + b * v + c * w for a, b, c in rows)
        a, b, c = rows[row]
        # Rolling turns the body's y axis into its z axis.
        by_phi = c * v - b * w
        level = -np.cos(theta) * u - np.sin(theta) * (np.sin(phi) * v + np.cos(phi) * w)
        by_theta = (np.cos(psi) * down, np.sin(psi) * down, level)[row]
        by_psi = (-east, north, np.zeros_like(u))[row]
        gradient = np.stack([by_phi, by_theta, by_psi, a, b, c], axis=1)
        return (north, east, down)[row], gradient

    return output


def rotation_rows(phi: Array, theta: Array, psi: Array) -> list[tuple[Array, Array, Array]]:
    """Rows of the matrix from body to north-east-down axes, rotation order 3-2-1."""
    sf, cf, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    ss, cs = np.sin(psi), np.cos(psi)
    return [
        (ct * cs, sf * st * cs - cf * ss, cf * st * cs + sf * ss),
        (ct * ss, sf * st * ss + cf * cs, cf * st * ss - sf * cs),
        (-st, sf * ct, cf * ct),
    ]


def _airspeed(states: Array) -> tuple[Array, Array]:
    velocity = states[:, 3:]
    speed = np.sqrt(np.sum(velocity**2, axis=1))
    gradient = np.zeros_like(states)
    gradient[:, 3:] = velocity / speed[:, None]
    return speed, gradient


def _attack(states: Array) -> tuple[Array, Array]:
    u, w = states[:, 3], states[:, 5]
    gradient = np.zeros_like(states)
    gradient[:, 3], gradient[:, 5] = -w / (u**2 + w**2), u / (u**2 + w**2)
    return np.arctan2(w, u), gradient


def _sideslip(states: Array) -> tuple[Array, Array]:
    u, v, w = states[:, 3:].T
    plane = np.sqrt(u**2 + w**2)
    square = u**2 + v**2 + w**2
    gradient = np.zeros_like(states)
    gradient[:, 3] = -v * u / (plane * square)
    gradient[:, 4] = plane / square
    gradient[:, 5] = -v * w / (plane * square)
    return np.arctan2(v, plane), gradient


OUTPUT_FUNCTIONS: dict[str, OutputFunction] = {
    **{name: _state(index) for index, name in enumerate(STATES)},
    **{name: _ground(row) for row, name in enumerate(("vn", "ve", "vd"))},
    "V": _airspeed,
    "alpha": _attack,
    "beta": _sideslip,
}
