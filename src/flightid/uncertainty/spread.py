"""How the uncertainty of an estimate is carried to what is computed from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import OptionError
from flightid.uncertainty.quantity import Quantity

T = TypeVar("T")
Made = TypeVar("Made")
Array = NDArray[np.float64]
NORMAL_95 = 1.959963984540054
NEGLIGIBLE = 1e-14
"""Share of the largest eigenvalue of a covariance below which a direction is rounding."""
INSIDE = 1.0 - 1e-9
"""Keeps steps off the bounds by more than rounding."""
TRIES = 100
"""Draws for each one that has to lie inside the bounds."""


@dataclass(frozen=True, eq=False)
class Propagated:
    """What `Spread.propagate` found.

    Attributes
    ----------
    values : ndarray, shape (k,)
        The function at the estimate; NaN where it is not determined.
    covariance : ndarray, shape (k, k), or None
        None where the estimate has none; NaN in the rows of what an error of one standard
        deviation makes undetermined.
    reason : str
        Why there is no covariance.

    Example
    -------
    >>> Propagated(np.array([2.0]), np.array([[0.25]])).interval95.round(2)
    array([[1.02, 2.98]])
    """

    values: Array
    covariance: Array | None
    reason: str = ""

    @property
    def stderr(self) -> Array | None:
        """Standard errors, shape (k,)."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    @property
    def interval95(self) -> Array | None:
        """95 % intervals, shape (k, 2)."""
        if self.stderr is None:
            return None
        half = NORMAL_95 * self.stderr
        return np.column_stack([self.values - half, self.values + half])

    def quantity(self, place: int, name: str, unit: str = "1", missing: str = "") -> Quantity:
        """One entry as a printed number.

        Parameters
        ----------
        place : int
        name, unit : str
        missing : str
            Why the value is missing, where it is.
        """
        value = float(self.values[place])
        if not np.isfinite(value):
            return Quantity(name, None, unit, None, missing or "not determined")
        if self.interval95 is None:
            return Quantity(name, value, unit, None, self.reason)
        low, high = map(float, self.interval95[place])
        if not (np.isfinite(low) and np.isfinite(high)):
            return Quantity(
                name, value, unit, None, "not determined everywhere within its uncertainty"
            )
        return Quantity(name, value, unit, (low, high))


@dataclass(frozen=True, eq=False, repr=False)
class Spread(Generic[T]):
    """An estimate with its covariance, as numbers and as the thing that they make.

    Made by `spread_of`.

    Attributes
    ----------
    centre : ndarray, shape (n,)
        The estimated numbers.
    covariance : ndarray, shape (n, n), or None
        Of `centre` over repeated flights; None where `reason` says why.
    make : callable
        From numbers to the thing: a model, a system, a response.
    bounds : tuple of ndarray, shapes (n,)
        What the numbers may be.
    reason : str
        Why there is no covariance; where there is one, what it leaves out.

    Example
    -------
    >>> spread = Spread(np.array([3.0]), np.array([[0.01]]), lambda numbers: float(numbers[0]))
    >>> spread.propagate(lambda value: value**2).stderr.round(12)
    array([0.6])
    """

    centre: Array
    covariance: Array | None
    make: Callable[[Array], T]
    bounds: tuple[Array, Array] | None = None
    reason: str = ""
    _factor: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        factor = np.zeros((len(self.centre), 0))
        if self.covariance is not None and len(self.centre):
            sizes, directions = np.linalg.eigh((self.covariance + self.covariance.T) / 2.0)
            kept = sizes > NEGLIGIBLE * max(float(sizes[-1]), 0.0)
            factor = directions[:, kept] * np.sqrt(sizes[kept])
        object.__setattr__(self, "_factor", factor)

    @property
    def known(self) -> bool:
        """Whether there is a covariance."""
        return self.covariance is not None

    @property
    def estimate(self) -> T:
        """The thing at the estimate."""
        return self.make(self.centre)

    def __repr__(self) -> str:
        """Size on one line."""
        n = len(self.centre)
        known = "known" if self.known else f"unknown: {self.reason}"
        return f"Spread({n} number{'' if n == 1 else 's'}, covariance {known})"

    def steps(self, scale: float = 1.0) -> Iterator[tuple[T, T]]:
        """Pairs of things one standard deviation up and down each independent direction.

        One that would leave the bounds stops at them.
        """
        for direction in self._factor.T:
            ends = (self.centre + scale * direction, self.centre - scale * direction)
            if self.bounds is not None:
                ends = (np.clip(ends[0], *self.bounds), np.clip(ends[1], *self.bounds))
            yield self.make(ends[0]), self.make(ends[1])

    def slopes(self, function: Callable[[T], ArrayLike]) -> Array:
        """Moves of a function's values by one standard deviation along each independent direction.

        Central differences over ± one standard deviation; over less where that would leave the
        bounds, as for a delay known to its own size.

        Parameters
        ----------
        function : callable
            From the thing to k numbers.

        Returns
        -------
        ndarray, shape (n_directions, k)
        """
        found = []
        for direction in self._factor.T:
            share = self._room(direction)
            ends = [
                np.atleast_1d(
                    np.asarray(function(self.make(self.centre + sign * share * direction)), float)
                )
                for sign in (1.0, -1.0)
            ]
            found.append((ends[0] - ends[1]) / (2.0 * share))
        return np.array(found)

    def _room(self, direction: Array) -> float:
        """Share of a direction that stays inside the bounds, up and down; one where all does."""
        if self.bounds is None:
            return 1.0
        room = np.minimum(self.bounds[1] - self.centre, self.centre - self.bounds[0])
        moving = direction != 0.0
        shares = INSIDE * room[moving] / np.abs(direction[moving])
        return float(np.min(shares, initial=1.0))

    def propagate(self, function: Callable[[T], ArrayLike]) -> Propagated:
        """Values and covariance of what is computed from the thing.

        Central differences over ± one standard deviation along the independent directions of the
        covariance: deterministic, and right in second order too as far as the slope goes.

        Parameters
        ----------
        function : callable
            From the thing to k numbers; NaN for one that is not determined.

        Returns
        -------
        Propagated

        Assumes
        -------
        A function that is nearly straight over the spread: biased where it is not, for example
        for a damping ratio known to half its size.

        Reference
        ---------
        Julier & Uhlmann, *Proceedings of the IEEE* 92 (2004), eqs. 11–15, with the slopes alone.
        """
        values = np.atleast_1d(np.asarray(function(self.estimate), dtype=np.float64))
        if not self.known:
            return Propagated(values, None, self.reason)
        slopes = self.slopes(function).reshape(-1, len(values))
        return Propagated(values, slopes.T @ slopes)

    def draws(self, count: int, seed: int = 0) -> list[T]:
        """Things drawn from the normal distribution of the estimate, inside the bounds.

        Parameters
        ----------
        count : int
        seed : int

        Returns
        -------
        list
            Empty where there is no covariance. A draw outside the bounds is drawn again; after
            many it is moved to them.

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
        return [self.make(self._inside(random)) for _ in range(count)]

    def _inside(self, random: np.random.Generator) -> Array:
        low, high = self.bounds or (np.full(1, -np.inf), np.full(1, np.inf))
        for _ in range(TRIES):
            numbers = self.centre + self._factor @ random.standard_normal(self._factor.shape[1])
            if np.all((numbers >= low) & (numbers <= high)):
                return np.asarray(numbers)
        return np.asarray(np.clip(numbers, low, high))

    def then(self, function: Callable[[T], Made]) -> Spread[Made]:
        """The spread of what is made of the thing: of a loop made of a model."""
        make = self.make
        return Spread(
            self.centre,
            self.covariance,
            lambda numbers: function(make(numbers)),
            self.bounds,
            self.reason,
        )
