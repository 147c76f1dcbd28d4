"""A thing that is known with a covariance, which goes on to whatever is computed from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property, lru_cache
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import UNHEARD, Estimate, Reading
from flightid.uncertainty.quantiles import LEVEL, half_width
from flightid.uncertainty.shown_bands import Band, covered_band, responses_about

T = TypeVar("T")
Made = TypeVar("Made")
Array = NDArray[np.float64]
NEGLIGIBLE = 1e-14
"""Share of the largest eigenvalue of a covariance below which a direction is rounding."""
INSIDE = 1.0 - 1e-9
"""Keeps steps off the bounds by more than rounding."""
TRIES = 100
"""Draws for each one that has to lie inside the bounds."""
TOGETHER = 64
"""Directions whose ends are computed at once: a long response has thousands."""
CHECKED = 32
"""Draws that ask whether what is computed is as straight as its first order says."""
KEPT = 256
"""Things that are kept: the steps of a hundred numbers, and the draws."""
BENT = 1.2
"""Spread of the draws over that of first order of the same draws from which it counts."""
MISSED = 0.05
"""Share of draws without the number from which it is not determined."""
LOST = "not determined everywhere within its uncertainty"


@dataclass(frozen=True, eq=False)
class Uncertain(Generic[T]):
    """Numbers with their covariance, and the thing that they make.

    A model and the covariance of its parameters; a frequency response and its errors; or plain
    numbers, as `carried` gives them.

    Attributes
    ----------
    numbers : ndarray, shape (n,)
        As estimated; NaN for one that is not determined.
    covariance : ndarray, shape (n, n), or None
        Of `numbers` over repeated flights; None where `reason` says why. NaN in the rows of what
        an error of one standard deviation makes undetermined.
    make : callable
        From numbers to the thing: a model, a system, a response.
    bounds : tuple of ndarray, shapes (n,)
        What the numbers may be.
    reason : str
        Why there is no covariance; where there is one, what it leaves out.
    findings : tuple of Finding
        What is known of where it comes from; what is computed from it is no better.
    valid_rad_s : tuple of float or None
        Frequencies in which it is known, rad/s.
    allowed : callable, optional
        Whether numbers are some that their estimator could have given; others are not drawn.
    by_response_rad_s : mapping of str to (float, float)
        Of single responses, rad/s, where several were fitted; see `about`.

    Example
    -------
    >>> side = Uncertain(np.array([3.0]), np.array([[0.01]]), lambda numbers: float(numbers[0]))
    >>> area = side.carried(lambda length: length**2)
    >>> area.number(0, "area", "m^2")
    Estimate(area = 9 (7.824 to 10.18) m^2)
    """

    numbers: Array
    covariance: Array | None
    make: Callable[[Array], T]
    bounds: tuple[Array, Array] | None = None
    reason: str = ""
    findings: tuple[Finding, ...] = ()
    valid_rad_s: tuple[float, float] | None = None
    allowed: Callable[[Array], bool] | None = None
    by_response_rad_s: Mapping[str, Band] = field(default_factory=dict)

    @classmethod
    def exact(cls, thing: T, reason: str = "") -> Uncertain[T]:
        """A thing of which no errors are known.

        Example
        -------
        >>> Uncertain.exact("model", "typed in").known
        False
        """
        return cls(np.zeros(0), None, lambda _: thing, None, reason)

    @property
    def known(self) -> bool:
        """Whether there is a covariance."""
        return self.covariance is not None

    @property
    def value(self) -> T:
        """The thing as estimated."""
        return self.make(self.numbers)

    @property
    def stderr(self) -> Array | None:
        """Standard errors of the numbers, shape (n,)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    def interval(self, level: float = LEVEL) -> Array | None:
        """Intervals of the numbers, shape (n, 2); None without a covariance."""
        if self.stderr is None:
            return None
        half = half_width(level) * self.stderr
        return np.column_stack([self.numbers - half, self.numbers + half])

    def number(self, place: int, name: str, unit: str = "1", missing: str = "") -> Reading:
        """One of the numbers as a printed estimate.

        Parameters
        ----------
        place : int
        name, unit : str
        missing : str
            Why the value is missing, where it is.
        """
        value = float(self.numbers[place])
        if not np.isfinite(value):
            return Estimate(name, None, unit, None, missing or "not determined")
        if self.stderr is None:
            return Estimate(name, value, unit, None, self.reason)
        error = float(self.stderr[place])
        if not np.isfinite(error):
            return Estimate(name, value, unit, None, LOST)
        if not error > 0.0:
            return Estimate(name, value, unit, None, UNHEARD)
        return Estimate(name, value, unit, error)

    def __repr__(self) -> str:
        """Size on one line."""
        n = len(self.numbers)
        known = "known" if self.known else f"unknown: {self.reason}"
        return f"Uncertain({n} number{'' if n == 1 else 's'}, covariance {known})"

    @cached_property
    def directions(self) -> Array:
        """Independent moves of the numbers by one standard deviation, shape (n_directions, n).

        A number that is not determined has one of its own, which is NaN.
        """
        if self.covariance is None or not len(self.numbers):
            return np.zeros((0, len(self.numbers)))
        determined = np.isfinite(np.diag(self.covariance))
        part = self.covariance[np.ix_(determined, determined)]
        sizes, turned = np.linalg.eigh((part + part.T) / 2.0)
        kept = sizes > NEGLIGIBLE * max(float(np.max(sizes, initial=0.0)), 0.0)
        moves = np.zeros((int(np.count_nonzero(kept)), len(self.numbers)))
        moves[:, determined] = (turned[:, kept] * np.sqrt(sizes[kept])).T
        lost = np.zeros((int(np.count_nonzero(~determined)), len(self.numbers)))
        lost[np.arange(len(lost)), np.flatnonzero(~determined)] = np.nan
        return np.concatenate([moves, lost])

    def steps(self, scale: float = 1.0) -> Iterator[tuple[T, T]]:
        """Pairs of things one standard deviation up and down each independent direction.

        One that would leave the bounds stops at them; a step that is not allowed is halved.
        """
        for move in scale * self.directions:
            ends = (self._held(self.numbers + move), self._held(self.numbers - move))
            yield self.make(ends[0]), self.make(ends[1])

    def slopes(self, function: Callable[[T], ArrayLike]) -> Array:
        """Moves of a function's values by one standard deviation along each independent direction.

        See `slopes_together`, for one thing at a time.
        """
        return self.slopes_together(lambda things: np.array(_each(function, things)))

    def slopes_together(self, function: Callable[[list[T]], Array]) -> Array:
        """Moves of a function's values by one standard deviation along each independent direction.

        Central differences over ± one standard deviation; over less where that would leave the
        bounds, as for a delay known to its own size.

        Parameters
        ----------
        function : callable
            From n things to an array, shape (n, k).

        Returns
        -------
        ndarray, shape (n_directions, k)
        """
        shares = np.array([self._share_inside(each) for each in self.directions])
        moves = shares[:, None] * self.directions
        found = []
        for first in range(0, len(moves), TOGETHER):
            part = slice(first, first + TOGETHER)
            up, down = (
                function([self.make(self.numbers + sign * move) for move in moves[part]])
                for sign in (1.0, -1.0)
            )
            found.append((up - down) / (2.0 * shares[part, None]))
        return np.concatenate(found) if found else np.zeros((0, 0))

    def _share_inside(self, direction: Array) -> float:
        """Share of a direction that stays inside the bounds, up and down; one where all does."""
        if self.bounds is None:
            return 1.0
        room = np.minimum(self.bounds[1] - self.numbers, self.numbers - self.bounds[0])
        moving = direction != 0.0
        shares = INSIDE * room[moving] / np.abs(direction[moving])
        return float(np.min(shares, initial=1.0))

    def carried(self, function: Callable[[T], ArrayLike]) -> Uncertain[Array]:
        """Numbers that are computed from the thing, with their covariance.

        See `carried_together`, for one thing at a time: NaN for a number that is not determined.
        """
        return self.carried_together(lambda things: np.array(_each(function, things)))

    def carried_together(self, function: Callable[[list[T]], Array]) -> Uncertain[Array]:
        """Numbers that are computed from many things at once, with their covariance.

        Central differences over ± one standard deviation along the independent directions of the
        covariance: deterministic, and right in second order too as far as the slope goes. Draws of
        all directions at once then check it: where their spread is clearly larger, as of a crossing
        that changes places with another one, the number has the spread of the draws.

        Parameters
        ----------
        function : callable
            From n things to an array, shape (n, k).

        Returns
        -------
        Uncertain of ndarray

        Assumes
        -------
        Normal errors; a bent function has a standard error, its interval is symmetric all the same.

        Reference
        ---------
        Julier & Uhlmann, *Proceedings of the IEEE* 92 (2004), eqs. 11–15, with the slopes alone.
        """
        values = function([self.value])[0]
        covariance, reason = None, self.reason
        if self.known:
            slopes = self.slopes_together(function).reshape(-1, len(values))
            wider = self._bend(function, values, slopes)
            covariance, reason = wider[:, None] * (slopes.T @ slopes) * wider, ""
        found = uncertain_numbers(values, covariance, reason)
        return replace(found, findings=self.findings, valid_rad_s=self.valid_rad_s)

    def _bend(self, function: Callable[[list[T]], Array], values: Array, slopes: Array) -> Array:
        """Factors of standard errors, shape (k,): one where first order holds, NaN where lost."""
        factors = np.ones(len(values))
        if not len(slopes) or not np.all(np.isfinite(self.directions)):
            return factors
        steps = np.random.default_rng(0).standard_normal((CHECKED, len(slopes)))
        ends = self.numbers + steps @ self.directions
        moves = function([self.make(self._held(end)) for end in ends]) - values
        there = np.isfinite(moves)
        found, straight = (
            np.sqrt(np.sum(np.where(there, each, 0.0) ** 2, axis=0))
            for each in (moves, steps @ slopes)
        )
        bent = (found > BENT * straight) & (straight > 0.0)
        np.divide(found, straight, out=factors, where=bent)
        factors[np.mean(there, axis=0) < 1.0 - MISSED] = np.nan
        return factors

    def draws(self, count: int, seed: int = 0) -> list[T]:
        """Things drawn from the normal distribution of the estimate, inside bounds and class.

        Parameters
        ----------
        count : int
        seed : int

        Returns
        -------
        list
            Empty where there is no covariance. A draw outside the bounds, or not `allowed`, is
            drawn again; after many it is moved to the bounds, and halfway to the estimate until it
            is allowed.

        Raises
        ------
        OptionError
            A count below one.
        """
        if count < 1:
            raise OptionError("the number of draws", found=count, needed="1 or more")
        if not self.known:
            return []
        random = np.random.default_rng(seed)
        return [self.make(self._drawn_inside(random)) for _ in range(count)]

    def _drawn_inside(self, random: np.random.Generator) -> Array:
        for _ in range(TRIES):
            numbers = self.numbers + random.standard_normal(len(self.directions)) @ self.directions
            if self._allows(numbers):
                break
        return self._held(numbers)

    def _held(self, numbers: Array) -> Array:
        """The same inside the bounds, and as near to the estimate as it has to be."""
        if self.bounds is not None:
            numbers = np.clip(numbers, *self.bounds)
        for _ in range(TRIES):
            if self._allows(numbers):
                break
            numbers = (numbers + self.numbers) / 2.0
        return numbers

    def _allows(self, numbers: Array) -> bool:
        """Whether these are inside the bounds, and what their estimator could have given."""
        low, high = self.bounds or (-np.inf, np.inf)
        inside = bool(np.all((numbers >= low) & (numbers <= high)))
        return inside and (self.allowed is None or self.allowed(numbers))

    def then(self, function: Callable[[T], Made]) -> Uncertain[Made]:
        """What is made of the thing, as uncertain as it is: a loop made of a model."""
        make = self.make
        return Uncertain(
            self.numbers,
            self.covariance,
            lambda numbers: function(make(numbers)),
            self.bounds,
            self.reason,
            self.findings,
            self.valid_rad_s,
            self.allowed,
            self.by_response_rad_s,
        )

    def about(self, responses: Iterable[str]) -> Uncertain[T]:
        """The same as it is known for what is made of some responses, ``"output/input"``.

        Their bands together are the band; of responses that were not fitted nothing changes.
        """
        found = responses_about(self.by_response_rad_s, responses)
        return replace(self, valid_rad_s=covered_band(found.values())) if found else self

    def kept(self) -> Uncertain[T]:
        """The same, with what it has made kept: a closed loop whose margins are read at each input.

        What is computed from it takes the same steps and draws every time. Of more than 256 things
        those used last are kept.

        Example
        -------
        >>> made = []
        >>> seen = Uncertain(np.array([3.0]), np.array([[0.01]]), made.append).kept()
        >>> seen.value, seen.value, len(made)
        (None, None, 1)
        """
        make = self.make

        @lru_cache(KEPT)
        def found(packed: bytes) -> T:
            return make(np.frombuffer(packed).copy())

        return replace(self, make=lambda numbers: found(numbers.tobytes()))


def uncertain_numbers(
    numbers: ArrayLike, covariance: Array | None, reason: str = ""
) -> Uncertain[Array]:
    """Plain numbers with their covariance.

    Parameters
    ----------
    numbers : array_like, shape (n,)
    covariance : ndarray, shape (n, n), or None
    reason : str
        Why there is none.

    Example
    -------
    >>> uncertain_numbers([2.0], np.array([[0.25]])).interval(0.95).round(2)
    array([[1.02, 2.98]])
    """
    return Uncertain(np.asarray(numbers, dtype=np.float64), covariance, _same, None, reason)


def _each(function: Callable[[T], ArrayLike], things: list[T]) -> list[Array]:
    return [np.atleast_1d(np.asarray(function(each), dtype=np.float64)) for each in things]


def _same(numbers: Array) -> Array:
    return numbers
