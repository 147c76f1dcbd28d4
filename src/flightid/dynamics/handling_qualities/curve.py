"""An attitude response as decibels and degrees, with the crossings that handling qualities read."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.handling_qualities.branch import POINTS, Branch, branch_of
from flightid.errors import DataError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models import LinearSystem, TransferFunctionModel
from flightid.models.model import linear_system
from flightid.responses import FrequencyResponse
from flightid.responses.shown import WITHOUT_BIAS
from flightid.scalar_search import root_between

COHERENT = 0.6
"""Coherence below which the phase of a measured point is a guess."""
BRANCH_POINTS = 10
"""Coherent points that a branch is told from; where there are fewer, all points are asked."""
LOOKED_BELOW = 30.0
"""By which ratio below the band a model is looked at for the branch of its phase."""
GRID_POINTS = 2000
SLOPE_POINTS = 200
DEGREES_PER_RADIAN = 57.3
"""As the standard writes it in the definition of phase delay."""
BELOW_NYQUIST = 0.999
SMOOTHED = 0.3
"""Reach of a local parabola over measured points, in the logarithm of frequency."""
FEWEST_NEAR = 6
"""Points that a parabola goes through at least."""
Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Pair:
    """What is looked at: one output to one input, in one band, as an attitude.

    Attributes
    ----------
    output, input : str
    low, high : float
        Band, rad/s.
    integrate : bool
        The output is a rate: its integral is looked at.
    sign : int
        −1 for a control that pulls the other way.
    """

    output: str
    input: str
    low: float
    high: float
    integrate: bool = False
    sign: int = 1

    def attitude(self, omega: Array, values: Complex) -> Complex:
        """The response as that of an attitude to a control of positive effect."""
        return self.sign * values / (1j * omega) if self.integrate else self.sign * values


@dataclass(frozen=True, eq=False)
class GainPhaseCurve:
    """Decibels and degrees on a grid, and between its frequencies.

    Attributes
    ----------
    omega, decibels, degrees : ndarray, shape (n,)
        rad/s, dB, and unwrapped degrees on the branch on which an integrator lies at −90° near
        crossover.
    exact : callable, or None
        A model's response at one frequency; None joins measured points by straight lines over log
        frequency.
    branch : Branch
        Sign of the control, and where the unstable pairs of the band end.
    """

    omega: Array
    decibels: Array
    degrees: Array
    exact: Callable[[float], complex] | None
    branch: Branch

    @classmethod
    def of(
        cls,
        thing: object,
        pair: Pair,
        smoother: Array | None = None,
        points: int = GRID_POINTS,
    ) -> GainPhaseCurve:
        """Curve of a response, a model or a system.

        Parameters
        ----------
        thing : FrequencyResponse, model or system
        pair : Pair
        smoother : ndarray, shape (n, n), optional
            Of measured decibels and degrees, from `smoother_of`.
        points : int
            Of the grid of a model.

        Raises
        ------
        UnknownNameError
            There is no such channel.
        DataError
            Fewer than two points in the band, or a zero among them.
        """
        exact, first, sound = None, 0, None
        if isinstance(thing, FrequencyResponse):
            measured = thing.pair(pair.output, pair.input)
            inside = (measured.omega_rad_s >= pair.low) & (measured.omega_rad_s <= pair.high)
            omega = measured.omega_rad_s[inside]
            values = pair.attitude(omega, measured.response[inside])
            sound = _coherent(measured.coherence[inside])
        else:
            respond, high = _evaluator(thing, pair)
            omega = np.geomspace(pair.low, min(pair.high, high), points)
            # A model is known below the band too, where slow modes turn what tells its sign.
            below = np.geomspace(pair.low / LOOKED_BELOW, pair.low, POINTS, endpoint=False)
            omega, first = np.concatenate([below, omega]), len(below)
            values = respond(omega)

            def exact(at: float) -> complex:
                return complex(respond(np.array([at]))[0])

        if first and not (np.all(values[:first]) and np.all(np.isfinite(values[:first]))):
            omega, values, first = omega[first:], values[first:], 0
        if len(omega) < 2 or np.any(values == 0.0):
            raise DataError(
                f"{pair.output}/{pair.input} has no points in the band",
                found=f"{np.count_nonzero(values)} between {pair.low:g} and {pair.high:g} rad/s",
                needed="two or more, none of them zero",
            )
        decibels = 20.0 * np.log10(np.abs(values))
        degrees = np.degrees(np.unwrap(np.angle(values)))
        told = slice(None) if sound is None else sound
        branch = branch_of(omega[told], decibels[told], degrees[told])
        omega, decibels, degrees = omega[first:], decibels[first:], degrees[first:] + branch.turn
        if smoother is not None:
            decibels, degrees = smoother @ decibels, smoother @ degrees
        return cls(omega, decibels, degrees, exact, branch)

    def at(self, omega: float) -> tuple[float, float]:
        """Decibels and degrees at one frequency: of a model exactly, else between neighbours."""
        wanted = math.log(omega)
        degrees = float(np.interp(wanted, self._logs, self.degrees))
        if self.exact is None:
            return float(np.interp(wanted, self._logs, self.decibels)), degrees
        value = self.exact(omega)
        angle = math.degrees(cmath.phase(value))
        turns = round((degrees - angle) / 360.0)
        return 20.0 * math.log10(abs(value)), angle + 360.0 * turns

    @cached_property
    def _logs(self) -> Array:
        return np.log(self.omega)

    def falls_through(self, level: float) -> float | None:
        """Lowest frequency above unstable pairs at which the phase falls through a level."""
        places = self.falls(level)
        return None if not len(places) else self._between(int(places[0]), 1, level)

    def falls(self, level: float) -> NDArray[np.intp]:
        """Grid points above unstable pairs after which the phase falls through a level."""
        high = self.degrees - level
        beyond = self.omega[:-1] >= self.branch.above
        return np.flatnonzero((high[:-1] > 0.0) & (high[1:] <= 0.0) & beyond)

    def above(self, limit: float, margin_db: float) -> float | None:
        """Highest frequency below a limit at which the gain is still a margin above that there."""
        level = self.at(limit)[0] + margin_db
        count = int(np.searchsorted(self.omega, limit))
        high = np.append(self.decibels[:count], level - margin_db) - level
        places = np.flatnonzero((high[:-1] >= 0.0) & (high[1:] < 0.0))
        return None if not len(places) else self._between(int(places[-1]), 0, level)

    def phase_delay(self, crossing: float) -> float | None:
        """Fall of phase from −180° to twice its frequency, as a delay, s; None beyond the band."""
        if 2.0 * crossing > self.omega[-1] * (1.0 + 1e-12):
            return None
        beyond = -180.0 - self.at(2.0 * crossing)[1]
        return beyond / (DEGREES_PER_RADIAN * 2.0 * crossing)

    def phase_slope(self, low: float, high: float) -> tuple[float, float]:
        """Least-squares slope of phase over frequency as a phase delay, s, and rms misfit, deg.

        Half the slope: with phase on one line through −180° at ω_180 it is the phase delay.
        """
        omega = np.linspace(low, high, SLOPE_POINTS)
        phase = np.interp(np.log(omega), self._logs, self.degrees)
        away, phase = omega - omega.mean(), phase - phase.mean()
        slope = float(away @ phase / (away @ away))
        misfit = phase - slope * away
        return -slope / (2.0 * DEGREES_PER_RADIAN), float(np.sqrt(np.mean(misfit**2)))

    def _between(self, place: int, part: int, level: float) -> float:
        pair = np.minimum([place, place + 1], len(self.omega) - 1)
        left, right = map(float, self.omega[pair])
        known = (self.decibels, self.degrees)[part][pair] - level
        ends = float(known[0]), float(known[1])
        if self.exact is None and ends[0] != ends[1]:  # a straight line over log frequency
            return float(left * (right / left) ** (ends[0] / (ends[0] - ends[1])))
        return root_between(lambda at: self.at(at)[part] - level, left, right, ends=ends)


def _coherent(coherence: Array) -> NDArray[np.bool_] | None:
    """Points that tell a branch; None where few do: gain of noise asks for any phase."""
    sound = np.asarray(coherence >= COHERENT)
    return sound if np.count_nonzero(sound) >= BRANCH_POINTS else None


def smoother_of(response: FrequencyResponse, pair: Pair) -> Array | None:
    """Local parabolas over log frequency through the measured points of the band.

    A crossing read off two noisy neighbours has the slope of their noise. None where the points
    have no errors, are few, or are smooth: of `without_bias`, a pilot with what it leaves.

    Reference
    ---------
    Cleveland, "Robust locally weighted regression", *J. American Statistical Association* 74
    (1979), section 2, without its iterations.
    """
    measured = response.pair(pair.output, pair.input)
    inside = (measured.omega_rad_s >= pair.low) & (measured.omega_rad_s <= pair.high)
    error = measured.random_error[inside]
    logs = np.log(measured.omega_rad_s[inside])
    if response.estimator.endswith(WITHOUT_BIAS):
        return None
    if len(logs) < FEWEST_NEAR or not np.all(error > 0.0):
        return None
    rows = np.zeros((len(logs), len(logs)))
    for place, centre in enumerate(logs):
        away = np.abs(logs - centre)
        reach = max(SMOOTHED, 1.001 * float(np.partition(away, FEWEST_NEAR - 1)[FEWEST_NEAR - 1]))
        near = np.flatnonzero(away < reach)
        weights = (1.0 - (away[near] / reach) ** 3) ** 1.5 / error[near]
        basis = np.vander((logs[near] - centre) / reach, 3, increasing=True)
        rows[place, near] = np.linalg.pinv(weights[:, None] * basis)[0] * weights
    return rows


def _evaluator(thing: object, pair: Pair) -> tuple[Callable[[Array], Complex], float]:
    """Attitude response of a model, and the highest frequency at which it means anything."""
    system = thing if isinstance(thing, TransferFunctionModel) else linear_system(thing)
    for name, known in ((pair.output, system.outputs), (pair.input, system.inputs)):
        if name not in known:
            raise UnknownNameError("there is no such channel", found=name, needed=", ".join(known))
    step = None
    if isinstance(system, LinearSystem):
        step = system.sample_time_s
        system = system.select(outputs=[pair.output], inputs=[pair.input])
    row, column = list(system.outputs).index(pair.output), list(system.inputs).index(pair.input)

    def respond(omega: Array) -> Complex:
        return pair.attitude(omega, system.frequency_response(omega)[row, column])

    return respond, np.inf if step is None else BELOW_NYQUIST * np.pi / step
