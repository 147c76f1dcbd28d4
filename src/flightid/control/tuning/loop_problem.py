"""The loops of an axis as a problem: gains in, slack of every requirement for every plant out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.loop_metrics import LoopMetrics, loop_metrics
from flightid.control.margins.mode_slack import ModeSlack
from flightid.control.margins.stability_count import unstable_poles
from flightid.control.tuning.limits import ANGLE, WHOLE, limits, noise_limit, present
from flightid.control.tuning.requirements import TuningRequirements
from flightid.frozen import dataclass
from flightid.responses.pair import PairResponse

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
DISTURBANCE_WEIGHT = 0.2
"""Of the rejection of disturbances beside the logarithm of a bandwidth."""
LOWEST_PEAK_RAD_S, PEAK_BANDS = 0.5, 20
"""Lowest frequency at which a peak of sensitivity is looked for, rad/s, and bands of the search."""
FULL, NONE = 1.0, -20.0
"""Slack of a requirement that sets no limit, for lack of a crossing; and the least that counts."""


@dataclass(frozen=True, eq=False)
class Plants:
    """Plants that one axis may have, with all other loops closed.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        From far below all dynamics to half the sample rate, rad/s.
    rate, angle : ndarray of complex, shape (n, n_f)
        Output to the rate that the controller is given, and to the angle; the estimate first.
    rest : ndarray of complex, shape (n, n_f)
        det(I + L) of the other loops alone; one where there are none.
    unstable : ndarray of int, shape (n,)
        Poles of the open plants outside the unit circle.
    """

    omega_rad_s: Array
    rate: Complex
    angle: Complex
    rest: Complex
    unstable: NDArray[np.int64]

    def __len__(self) -> int:
        """Number of plants."""
        return len(self.rate)

    def take(self, rows: list[int]) -> Plants:
        """Some of the plants."""
        return replace(
            self,
            rate=self.rate[rows],
            angle=self.angle[rows],
            rest=self.rest[rows],
            unstable=self.unstable[rows],
        )

    def thinned(self, stride: int) -> Plants:
        """The plants at every so many frequencies, the highest among them."""
        kept = np.arange(len(self.omega_rad_s) - 1, -1, -stride)[::-1]
        return replace(
            self,
            omega_rad_s=self.omega_rad_s[kept],
            rate=self.rate[:, kept],
            angle=self.angle[:, kept],
            rest=self.rest[:, kept],
        )


class Paths(Protocol):
    """The controller's paths at given frequencies, linear in its gains but for the last."""

    def feedback(self, omega_rad_s: Array) -> Complex:
        """Rate to output with the opposite sign, for each gain alone: (n_gains, n_f)."""
        ...

    def forward(self, omega_rad_s: Array) -> Complex:
        """Rate set-point to output: for each gain alone, then what no gain changes."""
        ...

    def angle(self, omega_rad_s: Array) -> Complex | None:
        """Angle with the opposite sign to rate set-point for a gain of one; None without."""
        ...


@dataclass(frozen=True, eq=False)
class Loops:
    """Loop transfers of candidates with plants, each (n_candidates, n_plants, n_f).

    Attributes
    ----------
    control : ndarray of complex, shape (n_candidates, n_f)
        Rate to output, with the opposite sign.
    rate, whole, angle : ndarray of complex
        Broken at the output with the angle loop open, with it closed, and at the angle.
    inner : str
        What the loop without the angle is called.
    """

    control: Complex
    rate: Complex
    whole: Complex
    angle: Complex | None
    inner: str

    def named(self) -> Iterator[tuple[str, Complex]]:
        """Each loop that there is."""
        yield self.inner, self.rate
        if self.angle is not None:
            yield WHOLE, self.whole
            yield ANGLE, self.angle


@dataclass(frozen=True, eq=False)
class LoopAssessment:
    """Candidates judged by each plant.

    Attributes
    ----------
    names : tuple of str
        Requirements.
    slack : ndarray, shape (n_requirements, n_candidates, n_plants)
        At least 0 where the requirement is met, 1 where it sets no limit.
    objective : ndarray, shape (n_candidates, n_plants)
        Natural logarithm of what is to be high.
    metrics : dict of str to LoopMetrics
        By loop, arrays (n_candidates, n_plants).
    stable : ndarray of bool, shape (n_candidates, n_plants)
    noise : ndarray, shape (n_candidates, n_plants)
        Output over gyro noise, rms; rms output where the noise is known.
    peaks : ndarray, shape (n_loops, n_candidates, n_plants, n_bands)
        Slack of the sensitivity peak by bands of frequency: where two peaks are equally high, the
        highest alone has an edge that a search would stick to.
    lows : mapping of str to ModeSlack
        What a light mode below the identified band leaves of each loop, where that was asked.
    rooms : mapping of str to ModeSlack
        What a resonance above it leaves.
    """

    names: tuple[str, ...]
    slack: Array
    objective: Array
    metrics: dict[str, LoopMetrics]
    stable: NDArray[np.bool_]
    noise: Array
    peaks: Array
    lows: Mapping[str, ModeSlack] = field(default_factory=dict)
    rooms: Mapping[str, ModeSlack] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LoopProblem:
    """What the loops of an axis must do, and what they may be made of.

    Attributes
    ----------
    plants : Plants
    paths : Paths
    kinds : tuple of str
        ``"P"``, ``"I"`` or ``"D"`` of each gain of the rate loop; last ``"A"`` where there is
        an angle loop.
    low, high : ndarray, shape (n_gains,)
        Ranges of the gains.
    requirements : TuningRequirements
    crossover_limit_rad_s : float or None
        The band's upper edge over the factor, rad/s.
    noise_psd : ndarray, shape (n_f,), or None
        Of the rate that the controller is given, (rad/s)²/Hz; None: white, of unknown size.
    noise_limit : float or None
        Largest output noise over gyro noise (or rms output where the noise is known).
    inner : str
        What the innermost loop is called.
    time_scale : float
        Of the loop's dynamics over those of a vehicle's rate loop.
    integral_ratio : float
        Largest I over P, 1/s.
    moved_db : ndarray, shape (n_f,), or None
        By how much a mode outside the identified band may move the vehicle, dB; None: not known.
    rigid : bool
        Whether the vehicle was declared to carry none: no mode is allowed for.
    measured : PairResponse or None
        The response that was fitted.
    """

    plants: Plants
    paths: Paths
    kinds: tuple[str, ...]
    low: Array
    high: Array
    requirements: TuningRequirements
    crossover_limit_rad_s: float | None = None
    noise_psd: Array | None = None
    noise_limit: float | None = None
    inner: str = "rate loop"
    time_scale: float = 1.0
    integral_ratio: float = float("inf")
    moved_db: Array | None = None
    rigid: bool = False
    measured: PairResponse | None = None

    def with_plants(self, plants: Plants) -> LoopProblem:
        """The same requirements on other plants, at their frequencies."""
        known = self.plants.omega_rad_s
        psd, moved = (
            None if each is None else np.interp(plants.omega_rad_s, known, each)
            for each in (self.noise_psd, self.moved_db)
        )
        return replace(self, plants=plants, noise_psd=psd, moved_db=moved)

    @property
    def has_angle(self) -> bool:
        """Whether an angle loop is designed too."""
        return "A" in self.kinds

    @cached_property
    def _terms(self) -> tuple[Complex, Complex, Complex | None]:
        """The controller's paths at the plants' frequencies, which no candidate changes."""
        omega = self.plants.omega_rad_s
        return self.paths.feedback(omega), self.paths.forward(omega), self.paths.angle(omega)

    def loops(self, gains: Array, plants: Plants) -> Loops:
        """Loop transfers of candidates (n_candidates, n_gains) with plants at these frequencies."""
        feedback, terms, unit = self._terms
        inner = gains[:, :-1] if self.has_angle else gains
        control = inner @ feedback
        rate = control[:, None] * plants.rate
        if not self.has_angle or unit is None:
            return Loops(control, rate, rate, None, self.inner)
        forward = inner @ terms[:-1] + terms[-1]
        outer = (gains[:, -1:] * forward * unit)[:, None] * plants.angle
        return Loops(control, rate, rate + outer, outer / (1.0 + rate), self.inner)

    def judge(self, gains: Array, rows: list[int] | None = None) -> LoopAssessment:
        """Judge candidates.

        Parameters
        ----------
        gains : ndarray, shape (n_candidates, n_gains)
        rows : list of int, optional
            Plants to judge by; all when left out.
        """
        plants = self.plants if rows is None else self.plants.take(rows)
        omega, loops = plants.omega_rad_s, self.loops(gains, plants)
        closed = unstable_poles(omega, (1.0 + loops.rate) * plants.rest, plants.unstable)
        stable = closed == 0
        if loops.angle is not None:
            whole = (1.0 + loops.whole) * plants.rest
            stable &= unstable_poles(omega, whole, plants.unstable) == 0
        metrics = {
            # Broken at the angle, the loop's own poles are those that the rate loop leaves.
            name: loop_metrics(
                omega,
                loop,
                unstable_poles=np.maximum(closed, 0) if name == ANGLE else plants.unstable,
            )
            for name, loop in loops.named()
        }
        noise = self._noise(omega, np.abs(loops.control)[:, None] / np.abs(1.0 + loops.whole))
        parts = self._slack(metrics, stable, noise, highest_crossover(omega, loops.rate))
        return LoopAssessment(
            tuple(parts),
            np.array([*parts.values()]),
            self._objective(plants, metrics[self.inner], 1.0 + loops.whole),
            metrics,
            stable,
            noise,
            np.array([self._peaks(omega, loop) for _, loop in loops.named()]),
        )

    def _peaks(self, omega: Array, loop: Complex) -> Array:
        start = int(np.searchsorted(omega, LOWEST_PEAK_RAD_S / self.time_scale))
        edges = np.unique(np.linspace(start, len(omega), PEAK_BANDS, endpoint=False).astype(int))
        least = np.minimum.reduceat(np.abs(1.0 + loop), edges, axis=-1)
        peak = self.requirements.peak
        return np.asarray(np.clip(1.0 + np.log(least) / np.log(peak), NONE, FULL))

    def _noise(self, omega: Array, gain: Array) -> Array:
        """Rms of the output for the noise of the gyro, over the band of the sampled loop."""
        weight = np.ones_like(omega) if self.noise_psd is None else self.noise_psd
        power = np.trapezoid(gain**2 * weight, omega, axis=-1)
        share = 1.0 / omega[-1] if self.noise_psd is None else 1.0 / (2.0 * np.pi)
        return np.asarray(np.sqrt(power * share))

    def _slack(
        self,
        metrics: dict[str, LoopMetrics],
        stable: NDArray[np.bool_],
        noise: Array,
        highest: Array,
    ) -> dict[str, Array]:
        """Slack by requirement, bounded so that one plant cannot hide the others."""
        parts = {}
        for limit in limits(self.requirements, metrics, self.crossover_limit_rad_s):
            values = highest if limit.highest else getattr(metrics[limit.loop], limit.field)
            parts[limit.name] = limit.slack(np.asarray(values))
        if self.noise_limit is not None:
            limit = noise_limit(self.noise_limit)
            parts[limit.name] = limit.slack(noise)
        bounded = {
            name: np.clip(np.where(np.isnan(slack), FULL, slack), NONE, FULL)
            for name, slack in parts.items()
        }
        return {"stability": np.where(stable, FULL, -1.0), **bounded}

    def _objective(self, plants: Plants, rate: LoopMetrics, difference: Complex) -> Array:
        """Logarithm of what is raised: how little a step of disturbance leaves, or a bandwidth.

        A bandwidth alone would leave the integral open, so disturbances keep a small weight.
        """
        omega = plants.omega_rad_s
        felt = plants.angle if self.has_angle else plants.rate
        left = np.abs(felt / difference) / omega
        rejection = -0.5 * np.log(np.trapezoid(left**2, omega, axis=-1) / np.pi)
        if self.requirements.objective == "disturbance":
            return np.asarray(rejection)
        bandwidth = (
            rate.crossover_rad_s
            if self.requirements.objective == "crossover"
            else rate.disturbance_bandwidth_rad_s
        )
        return np.asarray(np.log(present(bandwidth)) + DISTURBANCE_WEIGHT * rejection)


def highest_crossover(omega_rad_s: Array, loop: Complex) -> Array:
    """Highest frequency at which each loop's gain falls through one, rad/s; NaN without.

    A derivative can hold the gain about one far beyond the crossover with the least phase.
    """
    logs, gain = np.log(omega_rad_s), np.log(np.abs(loop))
    above = gain[..., :-1] >= 0.0
    last = above.shape[-1] - 1 - np.argmax(above[..., ::-1], axis=-1)
    one = np.take_along_axis(gain, last[..., None], -1)[..., 0]
    two = np.take_along_axis(gain, last[..., None] + 1, -1)[..., 0]
    share = np.clip(one / np.where(one > two, one - two, 1.0), 0.0, 1.0)
    found = np.exp(logs[last] + share * (logs[last + 1] - logs[last]))
    return np.asarray(np.where(above.any(axis=-1), found, np.nan))
