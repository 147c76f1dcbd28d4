"""A rough guess of one rate axis, and what an excitation would make of it.

``p = K exp(-tau s) / ((T s + 1) (T_m s + 1)) u`` with ``u = r - k_p (p + k_phi phi)``: a rate axis
behind its motors, under the stabilising loop that stays on in flight. All signals are worked out in
the frequency domain, with a silent end as long as the loop's memory, so that any delay is exact.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.excitation.checks import require_positive
from flightid.frozen import dataclass
from flightid.options import Options, option

MEMORY = 12.0
"""Time constants of the slowest closed-loop mode that the silent end lasts."""


@dataclass(frozen=True)
class RateAxis(Options):
    """Guess of a rate axis: steady gain, lag, delay, measurement noise, and the loop that stays on.

    Attributes
    ----------
    gain : float
        Steady rate for a unit of input, rad/s; negative where the sign is.
    time_constant_s : float
        Lag, s.
    delay_s : float
        Pure delay, s.
    motor_lag_s : float
        Lag of motors or actuators, s; taken as known.
    lead_s : float
        Lead, s, as the reaction of speeding rotors gives yaw; taken as known.
    noise_rad_s : float
        Deviation of the white noise on the measured rate, rad/s.
    rate_feedback : float
        Input for a unit of rate, 1/(rad/s); zero where no loop is closed.
    attitude_feedback_per_s : float
        Rate command for a unit of attitude, 1/s; zero leaves the attitude free.

    Example
    -------
    >>> RateAxis(gain=40.0, time_constant_s=0.2, delay_s=0.02).slowest_s()
    0.2
    """

    gain: float = option(unit="rad/s", doc="Guess: steady rate for a unit of input.")
    time_constant_s: float = option(unit="s", above=0.0, doc="Guess: lag of the rate.")
    delay_s: float = option(0.0, unit="s", minimum=0.0, doc="Guess: pure delay.")
    motor_lag_s: float = option(
        0.0, unit="s", minimum=0.0, doc="Guess: lag of motors or actuators."
    )
    lead_s: float = option(
        0.0, unit="s", minimum=0.0, doc="Guess: lead, as speeding rotors give yaw."
    )
    noise_rad_s: float = option(
        0.02, unit="rad/s", above=0.0, doc="Deviation of the noise on the measured rate."
    )
    rate_feedback: float = option(0.0, doc="Loop kept on: input for a unit of rate, 1/(rad/s).")
    attitude_feedback_per_s: float = option(
        0.0, unit="1/s", minimum=0.0, doc="Loop kept on: rate command for a unit of attitude."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(absolute_gain=abs(self.gain))

    def response(self, omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Rate over input without feedback, (rad/s)/unit."""
        s = 1j * omega_rad_s
        lags = (self.time_constant_s * s + 1) * (self.motor_lag_s * s + 1)
        return np.asarray(self.gain * (self.lead_s * s + 1) * np.exp(-self.delay_s * s) / lags)

    def noise_density(
        self, omega_rad_s: NDArray[np.float64], sample_time_s: float
    ) -> NDArray[np.float64]:
        """One-sided density of what moves the rate beside the input, (rad/s)²/Hz."""
        return np.full(omega_rad_s.size, 2 * sample_time_s * self.noise_rad_s**2)

    def entry(self, omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]:
        """From what is injected to the input that it adds; 1 where it is injected at the input."""
        return np.ones(omega_rad_s.size, dtype=np.complex128)

    def feedback_slope(self, omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Feedback from rate and attitude to the input, times s: finite at rest, per rad."""
        s = 1j * omega_rad_s
        return np.asarray(self.rate_feedback * (s + self.attitude_feedback_per_s))

    def sensitivities(self, omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Derivatives of `response` by gain, time constant and delay, shape (3, n_freqs)."""
        s = 1j * omega_rad_s
        rate = self.response(omega_rad_s)
        return np.array([rate / self.gain, -s * rate / (self.time_constant_s * s + 1), -s * rate])

    def slowest_s(self) -> float:
        """Time constant of the slowest mode under feedback, s.

        Raises
        ------
        ModelError
            The loop of the guess is unstable.
        """
        poles = self._poles()
        slowest = float(np.max(poles.real))
        if slowest >= 0:
            raise ModelError(
                "the guessed loop is unstable",
                found=f"a mode that grows at {slowest:.3g} 1/s",
                needed="a stable loop",
                action="lower the feedback, or check the sign of the gain",
            )
        return -1.0 / slowest

    def fly(
        self, excitation: NDArray[np.float64], sample_time_s: float
    ) -> dict[str, NDArray[np.float64]]:
        """Predicted ``input``, ``rate`` (rad/s) and ``attitude`` (rad) while it is injected.

        Raises
        ------
        ModelError
            The loop of the guess is unstable.
        """
        count = excitation.size
        omega, transform = self._transform(excitation, sample_time_s)
        transform = transform * self.entry(omega)
        s, rate = 1j * omega, self.response(omega)
        slope = self.feedback_slope(omega)
        # Written so that nothing is divided by s, which is zero at rest.
        if self.attitude_feedback_per_s > 0:
            below = s + rate * slope
            control = s / below
            angle = np.fft.irfft(rate / below * transform)[:count]
        else:
            control = 1 / (1 + rate * self.rate_feedback)
            angle = None
        rates = np.fft.irfft(rate * control * transform)[:count]
        if angle is None:
            angle = sample_time_s * (np.cumsum(rates) - 0.5 * rates)
        return {
            "input": np.fft.irfft(control * transform)[:count],
            "rate": rates,
            "attitude": angle,
        }

    def information(
        self, control: NDArray[np.float64], sample_time_s: float
    ) -> NDArray[np.float64]:
        """Fisher information on gain, time constant and delay of one record, shape (3, 3)."""
        omega, transform = self._transform(control, sample_time_s)
        slopes = np.fft.irfft(self.sensitivities(omega) * transform, axis=1)[:, : control.size]
        return np.asarray(slopes @ slopes.T / self.noise_rad_s**2)

    def _transform(
        self, signal: NDArray[np.float64], sample_time_s: float
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        silent = int(np.ceil((MEMORY * self.slowest_s() + self.delay_s) / sample_time_s))
        total = scipy.fft.next_fast_len(signal.size + silent, real=True)
        total += total % 2
        omega = np.asarray(2 * np.pi * np.fft.rfftfreq(total, sample_time_s), dtype=np.float64)
        return omega, np.fft.rfft(signal, total)

    def _poles(self) -> NDArray[np.complex128]:
        """Closed-loop poles, the delay by a third-order Padé approximation."""
        h = self.delay_s
        over = np.array([-(h**3), 12 * h**2, -60 * h, 120.0])
        under = np.array([h**3, 12 * h**2, 60 * h, 120.0])
        lag = np.polymul([self.time_constant_s, 1.0], [self.motor_lag_s, 1.0])
        if self.rate_feedback == 0:
            return np.asarray(np.roots(lag), dtype=np.complex128)
        over = self.gain * self.rate_feedback * np.polymul([self.lead_s, 1.0], over)
        if self.attitude_feedback_per_s == 0:
            total = np.polyadd(np.polymul(lag, under), over)
        else:
            command = np.array([1.0, self.attitude_feedback_per_s])
            total = np.polyadd(
                np.polymul([1.0, 0.0], np.polymul(lag, under)),
                np.polymul(command, over),
            )
        return np.asarray(np.roots(total), dtype=np.complex128)
