"""An autopilot's axis as tuning sees it: which gains may move, and paths linear in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.gyro import Gyro
from flightid.control.tuning.gain_steps import reached
from flightid.control.tuning.sampled_plants import SampledPlants
from flightid.errors import OptionError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
RATE_ROLES = ("p", "i", "d")
SLOW_RAD_S = 1.0
"""Where a filter's phase is its delay."""
LEAST_SHARE = 1e-3
"""Of the upper end of a range: the least P, I or angle gain that a logarithm can start from."""


@dataclass(frozen=True)
class ControllerPaths:
    """Paths of one axis for plants that already hold the output and, maybe, the gyro filter.

    Attributes
    ----------
    loop : AxisLoop
        As flown.
    gyro : {"raw", "filtered"}
        Which rate the plant ends at.
    with_angle : bool
        Whether the angle loop is part of it.
    flown : AxisLoop or None
        Whose gains the ranges reach where `loop` does not stand as flown any more.
    """

    loop: AxisLoop
    gyro: Gyro
    with_angle: bool
    flown: AxisLoop | None = None

    @property
    def roles(self) -> tuple[str, ...]:
        """Roles of the gains that move, rate loop first."""
        inner = tuple(role for role in RATE_ROLES if role in self.loop.names)
        return (*inner, self._angle_role) if self.with_angle else inner

    @property
    def names(self) -> tuple[str, ...]:
        """The autopilot's names of these gains."""
        return tuple(self.loop.names[role] for role in self.roles)

    @property
    def kinds(self) -> tuple[str, ...]:
        """``"P"``, ``"I"``, ``"D"``, ``"A"``."""
        return tuple(role.upper() if role in RATE_ROLES else "A" for role in self.roles)

    @property
    def _angle_role(self) -> str:
        return "angle_p" if "angle_p" in self.loop.names else "angle_tc"

    def ranges(self) -> tuple[Array, Array]:
        """Lowest and highest value of each gain; an angle time constant as its inverse, 1/s.

        The autopilot's documentation gives them for usual vehicles: they reach what flew
        (`reached`).

        Raises
        ------
        OptionError
            The autopilot gives no range for a gain.
        """
        low, high = [], []
        known, flown = self.loop.ranges, self.flown or self.loop
        for role, name in zip(self.roles, self.names, strict=True):
            if name not in known:
                raise OptionError(
                    "a gain has no range to move in", found=name, needed=f"one of {[*known]}"
                )
            least, most = known[name].low, known[name].high
            if flown.has_flown:
                least, most = reached(least, most, flown.gains.get(name), known[name].unit)
            if role == "angle_tc":
                least, most = 1.0 / most, 1.0 / max(least, LEAST_SHARE * most)
            one = self.loop.unit_of(role)
            low.append(one * (least if role == "d" else least or LEAST_SHARE * most))
            high.append(one * most)
        return np.array(low), np.array(high)

    def integral_ratio(self, factor: float | None) -> float:
        """Largest I over P, 1/s: a factor over that of the autopilot's defaults, or as flown."""
        known, names = self.loop.ranges, self.loop.names
        if factor is None or not {"p", "i"} <= names.keys() & self.loop.values.keys():
            return float(np.inf)
        one = {role: self.loop.unit_of(role) for role in "pi"}
        usual = [known[names[role]].default * one[role] for role in "pi" if names[role] in known]
        flown = [self.loop.values[role] * one[role] for role in "pi"]
        if len(usual) < 2 or min(usual) <= 0.0:
            return float(np.inf)
        return max(factor * usual[1] / usual[0], flown[1] / flown[0] if flown[0] > 0.0 else 0.0)

    def gains_of(self, loop: AxisLoop) -> Array:
        """Values of the gains that move, in the controller's own units."""
        inner = [
            loop.values[role] * loop.unit_of(role) for role in self.roles if role in RATE_ROLES
        ]
        return np.array([*inner, loop.angle_gain_1_s] if self.with_angle else inner)

    def parameters(self, gains: Array) -> dict[str, float]:
        """Parameters by the autopilot's names, as it keeps them, for gains."""
        values = {}
        for role, name, gain in zip(self.roles, self.names, gains, strict=True):
            value = 1.0 / gain if role == "angle_tc" else gain
            values[name] = self.loop.written(value / self.loop.unit_of(role))
        return values

    def with_parameters(self, values: Mapping[str, float]) -> AxisLoop:
        """The loop with other parameters."""
        return self.loop.with_gains(dict(values))

    def feedback(self, omega_rad_s: Array) -> Complex:
        """Rate to output with the opposite sign, for each gain alone: (n_gains, n_f)."""
        terms, names = self.loop.basis(omega_rad_s, gyro=self.gyro, with_hold=False)
        return self._chosen(terms, names) * self._late(omega_rad_s)

    def forward(self, omega_rad_s: Array) -> Complex:
        """Rate set-point to output: for each gain alone, then feed-forward as flown."""
        terms, names = self.loop.forward_basis(omega_rad_s, with_hold=False)
        gains = self.loop.gains
        moving = {self.loop.names[role] for role in RATE_ROLES if role in self.loop.names}
        rest = sum(
            (
                gains[name] * term
                for name, term in zip(names, terms, strict=True)
                if name not in moving
            ),
            np.zeros(len(omega_rad_s), dtype=np.complex128),
        )
        return np.vstack([self._chosen(terms, names), rest]) * self._late(omega_rad_s)

    def angle(self, omega_rad_s: Array) -> Complex | None:
        """Angle with the opposite sign to rate set-point for a gain of one; None without."""
        if not self.with_angle:
            return None
        return np.asarray(self.loop.angle(omega_rad_s) / self.loop.angle_gain_1_s)

    def _late(self, omega: Array) -> Complex:
        return np.asarray(np.exp(-1j * omega * self.loop.computation_delay_s))

    def _chosen(self, terms: Complex, names: tuple[str, ...]) -> Complex:
        """Terms of P, I and D in order; a path without one has zero there."""
        found = dict(zip(names, terms, strict=True))
        nothing = np.zeros(terms.shape[-1], dtype=np.complex128)
        return np.array(
            [
                found.get(self.loop.names[role], nothing) / self.loop.unit_of(role)
                for role in RATE_ROLES
                if role in self.loop.names
            ]
        )


def loop_responses(
    plants: SampledPlants, omega_rad_s: Array, loops: Sequence[AxisLoop], gyro: Gyro
) -> tuple[Complex, Complex]:
    """Rates and angles over outputs, each (n, n_axes, n_axes, n_f), as the controllers see them.

    The estimator's angle does not pass the gyro filter, so an angle from filtered rates is given
    back the filter's delay.
    """
    rate, angle = plants.responses(omega_rad_s)
    if gyro == "raw":
        return rate, angle
    low = np.array([SLOW_RAD_S])
    delays = [-float(np.angle(loop.plant_gyro_response(low))[0]) / SLOW_RAD_S for loop in loops]
    lead = np.exp(1j * np.outer(delays, omega_rad_s))
    return rate, angle * lead[None, :, None, :]


def has_angle_loop(loop: AxisLoop) -> bool:
    """Whether the axis has an angle controller."""
    return "angle_p" in loop.names or "angle_tc" in loop.names


def standing(loop: AxisLoop, omega_rad_s: Array, gyro: Gyro) -> tuple[Complex, Complex]:
    """Feedback of rate and of angle to the output, with all gains as they stand, (n_f,) each."""
    paths = ControllerPaths(loop, gyro, has_angle_loop(loop))
    gains = paths.gains_of(loop)
    inner = gains[:-1] if paths.with_angle else gains
    feedback = inner @ paths.feedback(omega_rad_s)
    unit = paths.angle(omega_rad_s)
    if unit is None:
        return feedback, np.zeros_like(feedback)
    terms = paths.forward(omega_rad_s)
    return feedback, gains[-1] * unit * (inner @ terms[:-1] + terms[-1])
