"""What identification of a simulated flight should find: exact rate-axis transfer functions."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem
from flightid.vehicles.autopilot import Autopilot
from flightid.vehicles.quadrotor import QuadrotorParameters

AxisName = Literal["roll", "pitch", "yaw"]
Gyro = Literal["filtered", "mean", "raw"]
AXES: tuple[AxisName, ...] = ("roll", "pitch", "yaw")
COMMANDS = ("tau_phi", "tau_theta", "tau_psi")
RATES = ("p", "q", "r")


@dataclass(frozen=True)
class RateTruth:
    """Transfer function from mixer command to body rate at hover, from physical parameters.

    H(s) = gain (1 + lead_s s) e^(−delay s) / ((s − damping) (1 + motor_lag_s s)), exact for the
    simulated vehicle: on the rig always, in free flight while the rotors lie in the plane of the
    c.g. (`exact`). The autopilot holds each command for a loop and filters the gyro; both are
    discrete and known, and `frequency_response` includes them without approximation.

    Attributes
    ----------
    axis : {"roll", "pitch", "yaw"}
        Axis.
    damping_1_s : float
        Lp, Mq or Nr, 1/s.
    gain_rad_s2 : float
        L_tau_phi, M_tau_theta or N_tau_psi: angular acceleration of a full command, rad/s².
    motor_lag_s : float
        Time constant of rotor thrust, s.
    lead_s : float
        Numerator time constant from the rotors' inertia; zero but for yaw, s.
    motor_delay_s : float
        Pure delay from the autopilot's output to thrust, s.
    sample_time_s : float
        Time between loops, s.
    gyro_filter_hz : float
        Cut-off of the gyro filter, Hz.
    exact : bool
        False where translation couples into the axis.

    Example
    -------
    >>> truth = rate_truth("roll")
    >>> round(truth.damping_1_s, 3), round(truth.gain_rad_s2, 1)
    (-3.38, 142.3)
    """

    axis: AxisName
    damping_1_s: float
    gain_rad_s2: float
    motor_lag_s: float
    lead_s: float
    motor_delay_s: float
    sample_time_s: float
    gyro_filter_hz: float
    exact: bool

    def to_dict(self) -> dict[str, object]:
        """Plain values with a schema key."""
        return {"schema": "flightid.rate_truth/1", **asdict(self)}

    def effective_delay_s(self, gyro: Gyro = "filtered") -> float:
        """Delay of a continuous model fitted to the logged signals, s.

        Motor delay, half a loop of hold, and the gyro filter's delay at low frequency (half a
        loop for the mean over a loop that SIDD logs).
        """
        hold = 0.5 * self.sample_time_s
        extra = {"raw": 0.0, "mean": hold, "filtered": self._filter_delay_s()}
        if gyro not in extra:
            raise OptionError("gyro signal is not known", found=gyro, needed=f"one of {[*extra]}")
        return self.motor_delay_s + hold + extra[gyro]

    def _filter(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.gyro_filter_hz == 0:
            return np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
        ohm = math.tan(math.pi * self.gyro_filter_hz * self.sample_time_s)
        scale = 1 + math.sqrt(2) * ohm + ohm**2
        b = ohm**2 / scale * np.array([1.0, 2.0, 1.0])
        a = np.array([1.0, 2 * (ohm**2 - 1) / scale, (1 - math.sqrt(2) * ohm + ohm**2) / scale])
        return b, a

    def _filter_delay_s(self) -> float:
        b, a = self._filter()
        order = np.arange(3)
        return float(self.sample_time_s * (b @ order / b.sum() - a @ order / a.sum()))

    def system(self) -> LinearSystem:
        """Continuous state space from held command to rate, to simulate with ``hold="zero"``."""
        lag, lead = self.motor_lag_s, self.lead_s
        index = AXES.index(self.axis)
        return LinearSystem(
            [[-1 / lag, 0.0], [self.gain_rad_s2 * (1 - lead / lag), self.damping_1_s]],
            [[1 / lag], [self.gain_rad_s2 * lead / lag]],
            [[0.0, 1.0]],
            [[0.0]],
            (COMMANDS[index],),
            (RATES[index],),
            [self.motor_delay_s],
        )

    def continuous(self, omega_rad_s: ArrayLike, gyro: Gyro = "filtered") -> NDArray[np.complex128]:
        """The continuous model with its effective delay, as a fit would write it."""
        s = 1j * np.asarray(omega_rad_s, dtype=np.float64)
        lag = np.exp(-s * self.effective_delay_s(gyro)) / (1 + self.motor_lag_s * s)
        return np.asarray(self.gain_rad_s2 * (1 + self.lead_s * s) * lag / (s - self.damping_1_s))

    def frequency_response(
        self, omega_rad_s: ArrayLike, gyro: Gyro = "filtered"
    ) -> NDArray[np.complex128]:
        """Exact response of the sampled loop, logged command to logged gyro, rad/s per unit.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n,)
            Frequencies, rad/s.
        gyro : {"filtered", "mean", "raw"}
            RATE (behind INS_GYRO_FILTER), SIDD (mean of two samples) or the plain sample.

        Returns
        -------
        ndarray of complex, shape (n,)
        """
        b, a = self._filter() if gyro == "filtered" else (np.zeros(3), np.zeros(3))
        self.effective_delay_s(gyro)
        T = self.sample_time_s
        z = np.exp(1j * np.asarray(omega_rad_s, dtype=np.float64) * T)
        powers = np.array([np.ones_like(z), 1 / z, 1 / z**2])
        chain = {"raw": powers[0], "mean": 0.5 * (powers[0] + powers[1])}
        sensor = chain[gyro] if gyro in chain else (b @ powers) / (a @ powers)
        A, B, C, _, _ = self.system().state_space()
        whole = math.floor(self.motor_delay_s / T + 1e-9)
        late = (1 - (self.motor_delay_s / T - whole)) * T
        early_state, early_input = _held(A, B, T - late)
        late_state, late_input = _held(A, B, late)
        step = late_state @ early_state
        states = [
            np.linalg.solve(zk * np.eye(2) - step, late_state @ early_input / zk + late_input)[:, 0]
            for zk in z
        ]
        return np.asarray((np.array(states) @ C[0]) * z ** (-whole) * sensor)


def _held(
    A: NDArray[np.float64], B: NDArray[np.float64], duration_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    block = np.zeros((3, 3))
    block[:2, :2], block[:2, 2:] = A * duration_s, B * duration_s
    result = _native.matrix_exponential(block)
    return result[:2, :2], result[:2, 2:]


def rate_truth(
    axis: AxisName,
    vehicle: QuadrotorParameters | None = None,
    autopilot: Autopilot | None = None,
) -> RateTruth:
    """Linearise a rate axis of the simulated quadrotor at hover, by hand and without differences.

    Parameters
    ----------
    axis : {"roll", "pitch", "yaw"}
        Axis.
    vehicle : QuadrotorParameters, optional
        Vehicle; the default one when left out.
    autopilot : Autopilot, optional
        For loop rate and gyro filter.

    Raises
    ------
    OptionError
        No such axis.

    Reference
    ---------
    Khudairi et al., gyroscopic rig study, eqs. 4 and 8–10, with the moments of `quadrotor.rs`:
    L_p = −4 (k_w y² + k_h h²)/I_xx, L_tau = 2 T_max y/I_xx, and for yaw N_tau = 2 T_max c/I_zz.

    Example
    -------
    >>> rate_truth("yaw").exact
    True
    """
    if axis not in AXES:
        raise OptionError("axis is not known", found=axis, needed=f"one of {list(AXES)}")
    body = vehicle or QuadrotorParameters()
    loop = autopilot or Autopilot()
    index = AXES.index(axis)
    inertia = body.total_inertia_kg_m2[index]
    side = body.arm_m / math.sqrt(2)
    if axis == "yaw":
        arm, lead = body.torque_per_thrust_m, _yaw_lead_s(body)
        damping = 4 * body.in_plane_drag_n_s_m * body.arm_m**2
    else:
        arm, lead = side, 0.0
        damping = 4 * (
            body.axial_damping_n_s_m * side**2 + body.in_plane_drag_n_s_m * body.rotor_height_m**2
        )
    friction = body.rig_friction_n_m_s[index] if body.on_rig else 0.0
    return RateTruth(
        axis=axis,
        damping_1_s=-(damping + friction) / inertia,
        gain_rad_s2=2 * body.maximum_thrust_n * arm / inertia,
        motor_lag_s=body.motor_lag_s,
        lead_s=lead,
        motor_delay_s=body.motor_delay_s,
        sample_time_s=1 / loop.loop_rate_hz,
        gyro_filter_hz=loop.gyro_filter_hz,
        exact=body.on_rig or body.rotor_height_m == 0 or axis == "yaw",
    )


def _yaw_lead_s(body: QuadrotorParameters) -> float:
    """Spinning a rotor up turns the body the same way as its drag does, but at once."""
    hover_n = body.hover_throttle * body.maximum_thrust_n
    speed = math.sqrt(hover_n / body.thrust_per_speed_n_s2)
    per_thrust = 1 / (2 * body.thrust_per_speed_n_s2 * speed)
    return body.rotor_inertia_kg_m2 * per_thrust / body.torque_per_thrust_m
