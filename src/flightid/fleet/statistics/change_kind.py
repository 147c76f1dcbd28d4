"""Whether a level changed at once or gradually, where the flights can tell: a calibrated choice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, ShapeError
from flightid.fleet.statistics.largest_step import FEWEST, NEWEST, SHORTEST

Array = NDArray[np.float64]
STEP, DRIFT, CHANGED = "a step", "drift", "changed"
"""At once; gradually; and where the flights do not tell which."""
DRAWS = 399
WRONG = 0.05
"""Chance of ruling out the kind that it was."""


def change_kind(values: Array, covariance: Array, time_s: Array, *, seed: int = 0) -> str:
    """Tell a step at an unknown flight from a level that moves steadily from an unknown one on.

    Both have a place and a size. The difference of their sums of squares is held against what it
    would be had the best step, or the best steady movement, been the truth (Cox's comparison of
    separate families, its distributions drawn): a kind that would rarely give it is ruled out.

    Parameters
    ----------
    values : ndarray, shape (n,)
        In order of time.
    covariance : ndarray, shape (n, n)
        Of their errors.
    time_s : ndarray, shape (n,)
        Ascending.
    seed : int
        Of the draws.

    Returns
    -------
    str
        ``"a step"`` or ``"drift"`` where the other is ruled out at 5 %; ``"changed"`` where both or
        neither are.

    Raises
    ------
    ShapeError
        Shapes that do not agree.
    DataError
        Fewer than six values, or a covariance that is not positive definite.

    Assumes
    -------
    One change of one of the two kinds. A random walk is neither: it is named by what it is like.

    Reference
    ---------
    Cox, *J. R. Stat. Soc. B* 24 (1962), 406–424; Williams, *Biometrics* 26 (1970), 23–32 (draws).

    Example
    -------
    >>> errors, days = 0.01 * np.eye(20), np.arange(20.0)
    >>> noise = 0.1 * np.random.default_rng(1).normal(size=20)
    >>> change_kind(noise + (days > 9), errors, days), change_kind(noise + days / 9, errors, days)
    ('a step', 'drift')
    """
    n = len(values)
    if covariance.shape != (n, n) or time_s.shape != (n,):
        raise ShapeError(
            "covariance and times of a series",
            found=(covariance.shape, time_s.shape),
            needed=((n, n), (n,)),
        )
    if n < FEWEST:
        raise DataError("a change needs several flights", found=n, needed=f"{FEWEST} or more")
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise DataError(
            "the errors of a series have no positive covariance", needed="a positive definite one"
        ) from error
    since = time_s - time_s[0]
    if since[-1] <= 0.0:
        return CHANGED
    steps = np.tri(n, n - 1, -1)[:, SHORTEST - 1 : n - NEWEST]
    starts = since[: n - SHORTEST]
    slopes = np.maximum(since[:, None] - starts[starts < since[-SHORTEST]], 0.0) / since[-1]
    level = np.linalg.solve(root, np.ones((n, 1)))
    level /= np.linalg.norm(level)
    y = _apart(np.linalg.solve(root, values[:, None]), level)
    kinds = [_directions(np.linalg.solve(root, each), level) for each in (steps, slopes)]
    found = float(_difference(y, kinds)[0])
    noise = _apart(np.random.default_rng(seed).normal(size=(n, DRAWS)), level)
    as_step, as_drift = (_difference(_best(y, each) + noise, kinds) for each in kinds)
    no_step = np.mean(as_step <= found) <= WRONG
    no_drift = np.mean(as_drift >= found) <= WRONG
    if no_step == no_drift:
        return CHANGED
    return DRIFT if no_step else STEP


def _apart(columns: Array, level: Array) -> Array:
    """What a constant level leaves of whitened columns."""
    return np.asarray(columns - level @ (level.T @ columns))


def _directions(shapes: Array, level: Array) -> Array:
    apart = _apart(shapes, level)
    sizes = np.linalg.norm(apart, axis=0)
    kept = sizes > 1e-9 * sizes.max()
    return np.asarray(apart[:, kept] / sizes[kept])


def _best(y: Array, directions: Array) -> Array:
    """The shape that explains most, at its size."""
    along = directions.T @ y
    place = int(np.argmax(np.abs(along[:, 0])))
    return np.asarray(directions[:, [place]] * along[place, 0])


def _difference(y: Array, kinds: list[Array]) -> Array:
    """By how much the best step leaves less than the best steady movement, each column."""
    steps, slopes = (np.max((each.T @ y) ** 2, axis=0) for each in kinds)
    return np.asarray(steps - slopes)
