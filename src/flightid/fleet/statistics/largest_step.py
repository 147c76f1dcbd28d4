"""A step at an unknown time: the largest one, its size and when."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr

from flightid.errors import DataError, ShapeError
from flightid.fleet.statistics.few_days import as_normal
from flightid.fleet.statistics.step_chances import largest_step_chance
from flightid.frozen import dataclass
from flightid.uncertainty.quantiles import LEVEL, half_width, tails

Array = NDArray[np.float64]
SHORTEST = 3
"""Flights on either side of a step: a lone odd flight is none."""
NEWEST = 2
"""Newest flights before which one may stand where its size is asked: two of them may be one."""
FEWEST = 2 * SHORTEST
"""Flights without which no step is looked for."""


@dataclass(frozen=True, eq=False)
class StepScan:
    """Steps of a series at every place where one may stand: as `step_places` has them.

    Attributes
    ----------
    sizes : ndarray, shape (m,)
        Estimated change between the flights before and behind each place.
    variances : ndarray, shape (m,)
        Of `sizes`.
    correlations : ndarray, shape (m − 1,)
        Between neighbouring steps.
    before : ndarray, shape (m,)
        Level before each place.
    before_variances : ndarray, shape (m,)
    with_before : ndarray, shape (m,)
        Covariance of each step with the level before it.
    places : ndarray of int, shape (m,)
        Last flight before each step, from 0.
    freedom : float
        Of the variances; infinite where they are known.

    Example
    -------
    >>> scan = scan_steps(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), 0.01 * np.eye(7))
    >>> scan.place, round(scan.statistic, 1), round(scan.size, 2)
    (2, 171.4, 1.0)
    """

    sizes: Array
    variances: Array
    correlations: Array
    before: Array
    before_variances: Array
    with_before: Array
    places: NDArray[np.intp]
    freedom: float = np.inf

    def up_to(self, place: int) -> StepScan:
        """The same of places up to one."""
        m = int(np.searchsorted(self.places, place, side="right"))
        return StepScan(
            self.sizes[:m],
            self.variances[:m],
            self.correlations[: max(m - 1, 0)],
            self.before[:m],
            self.before_variances[:m],
            self.with_before[:m],
            self.places[:m],
            self.freedom,
        )

    @property
    def deviations(self) -> Array:
        """Steps in their standard errors, shape (m,)."""
        return np.asarray(self.sizes / np.sqrt(self.variances))

    @property
    def _largest(self) -> int:
        return int(np.argmax(np.abs(self.deviations)))

    @property
    def place(self) -> int:
        """Last flight before the largest step, from 0."""
        return int(self.places[self._largest])

    @property
    def size(self) -> float:
        """The largest step."""
        return float(self.sizes[self._largest])

    @property
    def level(self) -> float:
        """Level before the largest step."""
        return float(self.before[self._largest])

    @property
    def statistic(self) -> float:
        """Square of the largest step in standard errors."""
        return float(np.max(self.deviations**2))

    @cached_property
    def chance(self) -> float:
        """Chance of a largest step as large were there none."""
        largest = as_normal(np.sqrt(self.statistic), self.freedom)
        return largest_step_chance(float(largest**2), self.correlations)

    @cached_property
    def _shares(self) -> Array:
        """Posterior of the place under a step of unknown size, shape (m,)."""
        log = 0.5 * as_normal(self.deviations, self.freedom) ** 2 + 0.5 * np.log(self.variances)
        shares = np.exp(log - log.max())
        return np.asarray(shares / shares.sum())

    def size_ends(self, level: float = LEVEL) -> tuple[float, float]:
        """Interval of the step's size, over the places where it may have been.

        Of a flat prior on size and place: normal at each place, mixed by how likely each is.
        """
        return self._ends(self.sizes, np.sqrt(self.variances), level)

    def percent_ends(self, level: float = LEVEL) -> tuple[float, float]:
        """The same in percent of the level before, whose error counts (delta method)."""
        share = self.sizes / self.before
        variance = self.variances - 2.0 * share * self.with_before
        variance = variance + share**2 * self.before_variances
        size = np.abs(self.before)
        sign = np.sign(self.before)
        ends = self._ends(share * sign, np.sqrt(variance) / size, level)
        return 100.0 * ends[0], 100.0 * ends[1]

    def _ends(self, centres: Array, deviations: Array, level: float) -> tuple[float, float]:
        wide = half_width(level, self.freedom) / half_width(level)
        return _mixture_ends(self._shares, centres, wide * deviations, level)

    def place_ends(self, level: float = LEVEL) -> tuple[int, int]:
        """Last flight before the step at the earliest and at the latest."""
        order = np.argsort(self._shares)[::-1]
        count = int(np.searchsorted(np.cumsum(self._shares[order]), level)) + 1
        places = self.places[order[:count]]
        return int(places.min()), int(places.max())


def scan_steps(
    values: Array, covariance: Array, known: Array | None = None, *, newest: int = SHORTEST
) -> StepScan:
    """Estimate a step at every place of a series, by generalised least squares.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In order of time.
    covariance : ndarray, shape (n, n)
        Of their errors.
    known : ndarray, shape (n, e), optional
        Flights behind each known step, whose size `covariance` leaves open: another one has
        `SHORTEST` flights between itself and each of them, too.
    newest : int
        Flights behind a step at the least.

    Returns
    -------
    StepScan

    Raises
    ------
    ShapeError
        Shapes that do not agree.
    DataError
        Fewer than six values, no place between known steps, or a covariance that is not positive
        definite.

    Reference
    ---------
    Hawkins, *J. Am. Stat. Assoc.* 72 (1977), 180–186; Worsley, *J. Am. Stat. Assoc.* 74 (1979),
    365–367.
    """
    n = len(values)
    places = step_places(n, known, newest)
    if n >= FEWEST and not len(places):
        raise DataError("no step fits between the known ones", needed=f"{FEWEST} flights of one")
    return _scan(values, covariance, _steps(n, places), places)


def step_places(n: int, known: Array | None = None, newest: int = SHORTEST) -> NDArray[np.intp]:
    """Last flights before a step that has `SHORTEST` flights to either side, known steps apart.

    At the end of a series it has `newest` behind it.
    """
    ends = {0} if known is None else {0, *np.count_nonzero(known == 0.0, axis=0).tolist()}
    places = np.arange(n - newest, dtype=np.intp)
    near = [(places + 1 > end - SHORTEST) & (places + 1 < end + SHORTEST) for end in ends]
    return np.asarray(places[~np.any(near, axis=0)], dtype=np.intp)


def _steps(n: int, places: NDArray[np.intp]) -> Array:
    """Column by column: the flights behind each place."""
    return np.tri(n, n - 1, -1)[:, places]


def scan_drifts(values: Array, covariance: Array, time_s: Array) -> StepScan:
    """Estimate a steady movement from every flight on to the last, by generalised least squares.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In order of time.
    covariance : ndarray, shape (n, n)
        Of their errors.
    time_s : ndarray, shape (n,)
        Ascending.

    Returns
    -------
    StepScan
        Its sizes are whole changes, of the last flight beside the level before the movement; its
        first place is the first flight.

    Raises
    ------
    ShapeError, DataError
        As `scan_steps`; or all flights are of one instant.

    Example
    -------
    >>> days = np.arange(9.0)
    >>> scan = scan_drifts(np.maximum(days - 2.0, 0.0), 1e-4 * np.eye(9), days)
    >>> round(scan.size, 6), [round(end, 2) for end in scan.size_ends()]
    (6.0, [5.98, 6.02])
    """
    ramps = _ramps(time_s)
    return _scan(values, covariance, ramps, np.arange(ramps.shape[1]))


def scan_changes(
    values: Array, covariance: Array, time_s: Array, known: Array | None = None
) -> StepScan:
    """Steps, then steady movements, as `scan_steps` and `scan_drifts` have them, in one scan.

    Steps may have the two newest flights behind them.
    Its interval weighs both kinds by how well they fit; a change may be either.
    """
    places, ramps = step_places(len(values), known, NEWEST), _ramps(time_s)
    shapes = np.hstack([_steps(len(values), places), ramps])
    return _scan(values, covariance, shapes, np.append(places, np.arange(ramps.shape[1])))


def _ramps(time_s: Array) -> Array:
    """Column by column: the part of a whole movement at each flight."""
    starts = time_s[: len(time_s) - SHORTEST]
    starts = starts[starts < time_s[-SHORTEST:].min()]
    if not len(starts):
        raise DataError("a drift needs flights at several times", needed=f"{FEWEST} or more")
    return np.asarray(np.maximum(time_s[:, None] - starts, 0.0) / (time_s[-1] - starts))


def _scan(values: Array, covariance: Array, shapes: Array, places: NDArray[np.intp]) -> StepScan:
    """Each shape at its size, beside a level."""
    n = len(values)
    if covariance.shape != (n, n):
        raise ShapeError("a covariance of the series", found=covariance.shape, needed=(n, n))
    if n < FEWEST:
        raise DataError("a step needs several flights", found=n, needed=f"{FEWEST} or more")
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise DataError(
            "the errors of a series have no positive covariance", needed="a positive definite one"
        ) from error
    whitened = np.linalg.solve(root, np.column_stack([np.ones(n), values, shapes]))
    one, y, steps = whitened[:, 0], whitened[:, 1], whitened[:, 2:]
    total = one @ one
    steps_alone = steps - np.outer(one, one @ steps) / total
    information = np.sum(steps_alone**2, axis=0)
    sizes = steps_alone.T @ y / information
    neighbours = np.sum(steps_alone[:, :-1] * steps_alone[:, 1:], axis=0)
    correlations = neighbours / np.sqrt(information[:-1] * information[1:])
    before = (one @ y - sizes * (one @ steps)) / total
    variances, shared = 1.0 / information, (one @ steps) / total
    return StepScan(
        *(sizes, variances, correlations, before),
        before_variances=1.0 / total + shared**2 * variances,
        with_before=-shared * variances,
        places=places,
    )


def _mixture_ends(
    shares: Array, centres: Array, deviations: Array, level: float
) -> tuple[float, float]:
    """Quantiles of a mixture of normals."""
    reach = 12.0 * float(deviations.max())
    found = []
    for share in tails(level):
        low, high = float(centres.min()) - reach, float(centres.max()) + reach
        for _ in range(60):
            middle = 0.5 * (low + high)
            below = float(shares @ ndtr((middle - centres) / deviations))
            low, high = (middle, high) if below < share else (low, middle)
        found.append(0.5 * (low + high))
    return found[0], found[1]


def largest_step_limit(n: int, chance: float = 1.0 - LEVEL) -> float:
    """Square of the largest step that n flights without one exceed with a chance.

    Parameters
    ----------
    n : int
        Flights with equal independent errors.
    chance : float

    Returns
    -------
    float
        In squared standard errors.

    Raises
    ------
    DataError
        Fewer than six flights.

    Example
    -------
    >>> [round(largest_step_limit(n), 1) for n in (20, 60, 200)]
    [7.3, 8.7, 9.7]
    """
    correlations = scan_steps(np.zeros(n), np.eye(n)).correlations
    return float(
        brentq(lambda s: largest_step_chance(s, correlations) - chance, 0.01, 400.0, xtol=1e-8)
    )
