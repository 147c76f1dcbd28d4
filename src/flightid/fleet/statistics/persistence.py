"""Days that go on as the days before them did: correlated errors that no step should be held by."""

from __future__ import annotations

from collections.abc import Sequence, Set
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.largest_step import scan_drifts, scan_steps
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected
from flightid.fleet.statistics.parameter_history import AskedHistory
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_DAYS = 10
"""Of a vehicle, below which its days do not tell whether they go on."""
CORRELATIONS = (0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97)
"""From one day to the next of the part that goes on, which are tried."""
SHARES = (0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9, 0.98)
"""Of the variance of a day that goes on, which are tried."""
LIKELIER = 3.0
"""Twice the logarithm of the ratio of likelihoods from which days go on: of independent ones one
fleet in twenty has as much."""
FEW_DAYS, LIKELIER_OF_FEW = 16, 1.0
"""Days of several flights below which they hardly tell, and the same for those: from there on they
may go on. With `LIKELIER` 7 of 60 fleets of twelve days that go on, by 0.5 at 4 % and by 0.9 at
5 %, had a red vehicle each; of 10 independent vehicles a quarter of the steps of 5 %, and one in
ten of those of 10 %, are told as what may be days that go on."""
FEWEST_VOICES = 5
"""Vehicles without a change that this takes: of fewer chance often has as much."""
KEPT = 11.5
"""Log likelihood that a change must explain: of a step and a movement, sizes and places chosen."""
ALIKE = 1e-6
"""Share of a shape that others leave, below which it is one of them."""
VOICES = 20
"""Vehicles without a change from which on they say by themselves whether days go on."""
CAUTION = 2.0
"""The same, by which what counts may be less likely than the best: the longest memory of these."""


@dataclass(frozen=True)
class Persistence:
    """How days of all vehicles go on, in one parameter.

    Attributes
    ----------
    share : float
        Of the variance of a day's mean that goes on.
    correlation : float
        Of that part, from one day to the next.
    factor : float
        Of the variances that errors and days were taken to have; 1 at least.
    likelier : float
        Twice the logarithm of how much likelier that is than independent days.
    typical : float
        Variance of a day's mean, the median of all, in the square of the unit: what goes on has
        the same size whatever a flight's own error.
    fitness, apart : float
        Log likelihood of the days, and were they independent, less what changes that are kept out
        cost (`KEPT` a vehicle).
    needed : float
        Of `likelier`, from which days go on.
    """

    share: float
    correlation: float
    factor: float
    likelier: float
    typical: float
    fitness: float
    apart: float
    needed: float = LIKELIER

    @property
    def is_told(self) -> bool:
        """Whether days go on, and not by chance; of few days, whether they may."""
        return self.likelier > self.needed

    @property
    def is_sure(self) -> bool:
        """Whether days go on, however few there are."""
        return self.likelier > LIKELIER

    @property
    def long_run(self) -> float:
        """Variance of the mean of many days, in that of independent ones."""
        rest = self.share * self.correlation / (1.0 - self.correlation)
        return self.factor * (1.0 + 2.0 * rest)

    def words(self, name: str) -> str:
        """What is seen, and what it does to changes."""
        verb = "go" if self.is_sure else "may go"
        return (
            f"{name}: flights {verb} on as their neighbours did (up to {100.0 * self.share:.0f} % "
            f"of what days differ by, correlated {self.correlation:.2g} from one day to the "
            "next): what lasts as long is no change"
        )


@dataclass(frozen=True, eq=False)
class DaySeries:
    """Days of one vehicle.

    Attributes
    ----------
    vehicle : str
    values : ndarray, shape (d,)
    variances : ndarray, shape (d,)
        Of these, were days independent.
    level : ndarray, shape (d, e)
        What may have any size: a level, and the steps of events.
    change : ndarray, shape (d, m)
        The same with the largest step and the steadiest movement; `level` where nothing changed.
    flights : int
        On all days.
    """

    vehicle: str
    values: Array
    variances: Array
    level: Array
    change: Array
    flights: int


def persistence(
    series: Sequence[DaySeries], changed: Set[str], *, caution: float = CAUTION
) -> Persistence | None:
    """Hold days that go on beside independent ones, by the likelihood over all vehicles.

    Days' means have the covariance f ((1 − c) v δ + c v̄ ρ^|lag|) with the variance v of each, the
    median v̄ of all and lags in days that were flown; f is common, and eliminated. A level of each
    vehicle, the steps of its events and what changed may have any size.

    Parameters
    ----------
    series : sequence of DaySeries
        Of one parameter.
    changed : set of str
        Vehicles whose change is kept out.
    caution : float
        Twice the logarithm of how much less likely than the best what is told may be.

    Returns
    -------
    Persistence or None
        None where no vehicle has ten days, or none scatters at all. Of all that are nearly as
        likely as the best the one with the longest memory: what is wrongly called a change costs
        more than one missed.

    Assumes
    -------
    The same memory for all vehicles; days in a row are as far apart as others. What most vehicles
    do by and by, each its own way, cannot be told from days that go on.

    Reference
    ---------
    Patterson & Thompson, *Biometrika* 58 (1971), 545–554 (restricted likelihood).
    """
    if not series:
        return None
    typical = typical_variance(series)
    groups = _grouped(
        [_scaled(e, e.change if e.vehicle in changed else e.level, typical) for e in series]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        none = _likelihood(groups, 0.0, 0.0)
    if not np.isfinite(none[0]):
        return None
    grid = [(0.0, 0.0, *none)]
    grid += [(c, r, *_likelihood(groups, c, r)) for c, r in product(SHARES, CORRELATIONS)]
    best = max(each[2] for each in grid)
    kept = sum(each.vehicle in changed for each in series)
    likelier, apart = 2.0 * (best - none[0]), none[2] - KEPT * kept
    few = _are_few(series) and len(series) - kept >= FEWEST_VOICES
    needed = LIKELIER_OF_FEW if few else LIKELIER
    found = [
        Persistence(c, r, max(1.0, factor), likelier, typical, whole - KEPT * kept, apart, needed)
        for c, r, value, factor, whole in grid
        if 2.0 * (best - value) <= caution
    ]
    return max(found, key=lambda each: each.long_run)


def _are_few(series: Sequence[DaySeries]) -> bool:
    """Whether days are few, beside the flights on them that tell what days differ by."""
    days = [len(each.values) for each in series]
    return float(np.median(days)) < FEW_DAYS and sum(e.flights for e in series) > 1.5 * sum(days)


def changed_vehicles(asked: Sequence[AskedHistory]) -> frozenset[str]:
    """Vehicles whose history of one parameter would be an alarm by itself among those asked."""
    judged = [each.history for each in asked if each.history.chance is not None]
    shares = corrected([each.chance or 0.0 for each in judged])
    told = zip(judged, shares, strict=True)
    return frozenset(each.vehicle for each, share in told if share <= FALSE_SHARE)


def explained(series: Sequence[DaySeries], most: Set[str], found: Persistence) -> frozenset[str]:
    """Vehicles, of `most`, whose change explains more than it costs beside days that go on."""
    kept = []
    for each in (one for one in series if one.vehicle in most):
        values, variances, _ = _scaled(each, each.level, found.typical)
        root, _ = _root(variances, found.share, found.correlation)
        without, beside = (
            float(_left(root, values[:, None], design)[0].sum())
            for design in (each.level, each.change)
        )
        if without - beside > 2.0 * KEPT * found.factor:
            kept.append(each.vehicle)
    return frozenset(kept)


def is_shared(series: Sequence[DaySeries], changed: Set[str], found: Persistence) -> bool:
    """Whether vehicles that did not change, where they are many, may go on like that.

    Small steps in a large part of a fleet look like days that go on; but those who share in no
    step would then go on as well.
    """
    others = [
        _scaled(each, each.level, found.typical) for each in series if each.vehicle not in changed
    ]
    if len(others) < VOICES:
        return True
    groups = _grouped(others)
    with_it, without = (
        _likelihood(groups, *each)[0] for each in ((found.share, found.correlation), (0.0, 0.0))
    )
    return with_it >= without


def _left(root: Array, values: Array, design: Array) -> tuple[Array, Array]:
    """Squares that whitened designs leave of values, and the sizes of the designs' triangles.

    By the triangle of both side by side; of one vehicle, or of several along the first axis.
    """
    white = np.linalg.solve(root, np.concatenate([design, values], axis=-1))
    ends = np.abs(np.diagonal(np.linalg.qr(white, mode="r"), axis1=-2, axis2=-1))
    p = design.shape[-1]
    return ends[..., p:] ** 2, ends[..., :p]


def day_series(asked: Sequence[AskedHistory], changed: Set[str]) -> list[DaySeries]:
    """Days of the histories that were judged and have ten or more, with what changed in some."""
    judged = (each for each in asked if each.history.chance is not None)
    found = (_days(each, each.history.vehicle in changed) for each in judged)
    return [each for each in found if each is not None]


def _days(asked: AskedHistory, has_changed: bool) -> DaySeries | None:
    time_s = asked.history.time_s
    day = days_of(time_s)
    if day.max() + 1 < FEWEST_DAYS:
        return None
    own, of_day = asked.own_variances, np.bincount(day, 1.0 / asked.own_variances)
    weights = (day == np.arange(day.max() + 1)[:, None]) / own / of_day[:, None]
    variances = day_variances(asked)[np.unique(day, return_index=True)[1]]
    level = np.column_stack([np.ones(len(day)), asked.known])
    change = np.column_stack([level, *changes(asked)]) if has_changed else level
    level, change = (_apart(weights @ each) for each in (level, change))
    values = weights @ asked.values
    return DaySeries(asked.history.vehicle, values, variances, level, change, len(day))


def typical_variance(series: Sequence[DaySeries]) -> float:
    """Median variance of a day's mean, over all vehicles."""
    return float(np.median(np.concatenate([each.variances for each in series])))


def _scaled(series: DaySeries, design: Array, typical: float) -> tuple[Array, Array, Array]:
    """Values and variances in a typical one, and the design."""
    return series.values / np.sqrt(typical), series.variances / typical, design


def _apart(design: Array) -> Array:
    """Shapes of which none is like the others: a step and a movement of the last day are one."""
    own = np.abs(np.diag(np.linalg.qr(design)[1]))
    return np.asarray(design[:, own > ALIKE * own.max()])


def changes(asked: AskedHistory) -> list[Array]:
    """The step and the steady movement that explain most of a history."""
    n, time_s = len(asked.values), asked.history.time_s
    place = scan_steps(asked.values, asked.covariance, asked.known).place
    found = [(np.arange(n) > place).astype(np.float64)[:, None]]
    if time_s[0] < time_s[-3]:
        start = scan_drifts(asked.values, asked.covariance, time_s).place
        found.append(np.maximum(time_s - time_s[start], 0.0)[:, None] / (time_s[-1] - time_s[0]))
    return found


def day_variances(asked: AskedHistory) -> Array:
    """Variance of the mean of each flight's day, shape (n,)."""
    day = days_of(asked.history.time_s)
    return np.asarray(1.0 / np.bincount(day, 1.0 / asked.own_variances)[day] + asked.by_day)


Group = tuple[Array, Array, Array]


def _grouped(series: Sequence[tuple[Array, Array, Array]]) -> list[Group]:
    """Series of equal shape in one array, with a last axis of one column for the values."""
    groups: dict[tuple[int, ...], list[tuple[Array, Array, Array]]] = {}
    for each in series:
        groups.setdefault(each[2].shape, []).append(each)
    stacked = [[np.stack(each) for each in zip(*held, strict=True)] for held in groups.values()]
    return [(values[:, :, None], variances, design) for values, variances, design in stacked]


def _root(variances: Array, share: float, correlation: float) -> tuple[Array, float]:
    """Cholesky roots of days' covariances, and half the logarithm of their determinants.

    Variances are of one vehicle, shape (d,), or of several, shape (m, d).
    """
    n = variances.shape[-1]
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    own = (1.0 - share) * variances[..., None] * np.eye(n)
    root = np.linalg.cholesky(share * correlation**lag + own)
    return root, float(np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1))))


def _likelihood(
    groups: Sequence[Group], share: float, correlation: float
) -> tuple[float, float, float]:
    """Restricted log likelihood over all vehicles, their common factor, and the plain likelihood.

    The last, with means as estimated, compares designs.
    """
    total, squares, freedom, whole, count = 0.0, 0.0, 0, 0.0, 0
    for values, variances, design in groups:
        many, n, p = design.shape
        root, log_root = _root(variances, share, correlation)
        left, sizes = _left(root, values, design)
        squares += float(left.sum())
        total -= log_root + float(np.sum(np.log(sizes)))
        freedom, count, whole = freedom + many * (n - p), count + many * n, whole - log_root
    factor = squares / freedom
    whole -= 0.5 * count * float(np.log(squares / count))
    return total - 0.5 * freedom * float(np.log(factor)), factor, whole


def persisting(asked: AskedHistory, found: Persistence) -> Array:
    """Covariance of the flights of a vehicle whose days go on, shape (n, n).

    Days' means have that of `persistence`, and no less than were they independent: errors of one
    that is told worse than others are its own. Flights of a day scatter about theirs as before.
    """
    day = days_of(asked.history.time_s)
    same = (day[:, None] == day).astype(np.float64)
    own, of_day = np.diag(asked.own_variances), day_variances(asked)
    before = own + same * asked.by_day
    going_on = found.typical * found.correlation ** np.abs(np.subtract.outer(day, day))
    means = found.factor * ((1.0 - found.share) * same * of_day + found.share * going_on)
    means += same * np.maximum(of_day - np.diag(means), 0.0)
    return np.asarray(asked.errors - before + own + means - same * (of_day - asked.by_day))
