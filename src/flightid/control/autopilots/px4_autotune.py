"""PX4's own gain design (autotune), to compare with: generalised minimum variance."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.autopilots.parameter_table import parameter_entries
from flightid.errors import OptionError, ShapeError
from flightid.frozen import dataclass

FUDGE = 5.0
"""PX4 divides the integral gain by this to get gains that fly; it is not part of the method."""
LARGEST = {"kc": 0.5, "ki": 10.0, "kd": 0.1}
"""Above these PX4 calls the identification a failure."""
ANGLE_STEP_RAD = math.radians(60.0)
ANGLE_BOUNDS = (2.0, 6.5)


@dataclass(frozen=True)
class Px4AutotuneGains:
    """Gains of PX4's autotune: u = kc (1 + ki/s + kd s) e.

    Attributes
    ----------
    kc : float
        Controller gain, 1/(rad/s).
    ki, kd : float
        Integral gain, 1/s, and derivative gain, s.
    angle_p_1_s : float
        Gain of the attitude loop, 1/s.
    acceptable : bool
        Whether PX4 would take them.
    """

    kc: float
    ki: float
    kd: float
    angle_p_1_s: float
    acceptable: bool

    def parameters(self, axis: str) -> dict[str, float]:
        """The gains under PX4's multicopter names, with K = 1."""
        found = {"p": self.kc, "i": self.kc * self.ki, "d": self.kc * self.kd, "k": 1.0}
        found["angle_p"] = self.angle_p_1_s
        entries = parameter_entries("px4_multicopter", axis)
        return {entry.name: found[entry.role] for entry in entries if entry.role in found}


def desired_polynomial(
    sample_time_s: float, rise_time_s: float, damping: float
) -> tuple[float, float]:
    """p1 and p2 of the closed loop that PX4 asks for, 1 + p1 z⁻¹ + p2 z⁻²."""
    rho = sample_time_s / rise_time_s
    mu = 0.25 * (1 - damping) + 0.51 * damping
    decay = math.exp(-rho / (2 * mu))
    return -2 * decay * math.cos(math.sqrt(4 * mu - 1) * rho / (2 * mu)), math.exp(-rho / mu)


def px4_autotune_gains(
    numerator: ArrayLike,
    denominator: ArrayLike,
    sample_time_s: float,
    *,
    rise_time_s: float = 0.14,
    damping: float = 0.0,
    detuning: float = 0.7,
) -> Px4AutotuneGains:
    """Gains that PX4's autotune would choose for a second-order discrete model.

    Parameters
    ----------
    numerator, denominator : array_like, shape (3,)
        b0, b1, b2 and 1, a1, a2 of the model from torque set-point to rate (rad/s), in powers
        of z⁻¹.
    sample_time_s : float
        Sample time of the model, s.
    rise_time_s : float
        MC_AT_RISE_TIME, s; PX4 takes 0.2 s for yaw, and 0.01 to 1 s at all.
    damping : float
        0 critical, 1 Butterworth.
    detuning : float
        Weight on the control; more lowers kc.

    Raises
    ------
    ShapeError
        Not three coefficients each.
    OptionError
        A denominator that does not begin with 1, or settings without meaning.

    Biased when
    -----------
    It looks at no margin and at no delay of the loop: compare, do not trust.

    Reference
    ---------
    T. Yamamoto, K. Fujii and M. Kaneda, Design and implementation of a self-tuning PID controller,
    1998; PX4, src/lib/pid_design/pid_design.hpp.

    Example
    -------
    >>> gains = px4_autotune_gains([0.0, 0.1, 0.1], [1.0, -1.8, 0.81], 0.02)
    >>> round(gains.kc, 4), gains.acceptable
    (0.4089, True)
    """
    num, den = np.asarray(numerator, dtype=float), np.asarray(denominator, dtype=float)
    if num.shape != (3,) or den.shape != (3,):
        raise ShapeError("a model of order two", found=(num.shape, den.shape), needed="(3,) each")
    settings = (0.01 <= rise_time_s <= 1.0, 0 <= damping <= 1, 0 <= detuning <= 10)
    if den[0] != 1.0 or not (sample_time_s > 0 and all(settings)):
        raise OptionError(
            "autotune cannot use this",
            found=f"a0 {den[0]}, sample time {sample_time_s} s, rise time {rise_time_s} s, "
            f"damping {damping}, detuning {detuning}",
            needed="a0 = 1, rise time 0.01 to 1 s, damping 0 to 1, detuning 0 to 10",
        )
    (_, a1, a2), total = den, float(num.sum())
    p1, p2 = desired_polynomial(sample_time_s, rise_time_s, damping)
    e1 = -a1 + p1 + 1
    f0 = -a1 * e1 + a1 - a2 + e1 + p2
    f1 = a1 * e1 - a2 * e1 + a2
    f2 = a2 * e1
    nu = detuning + (e1 + 1) * total
    middle = f1 + 2 * f2
    if abs(nu) < float(np.finfo(np.float32).eps) or middle == 0:
        return Px4AutotuneGains(0.0, 0.0, 0.0, ANGLE_BOUNDS[1], acceptable=False)
    kc = -middle / nu
    ki = -(f0 + f1 + f2) / (sample_time_s * middle) / FUDGE
    kd = -sample_time_s * f2 / middle
    found = {"kc": kc, "ki": ki, "kd": kd}
    acceptable = all(0 < found[name] < bound for name, bound in LARGEST.items())
    low, high = ANGLE_BOUNDS
    angle_p = min(max(1 / (ANGLE_STEP_RAD * kc), low), high) if kc > 0 else high
    return Px4AutotuneGains(float(kc), float(ki), float(kd), float(angle_p), acceptable)
