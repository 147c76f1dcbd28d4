"""Whether a regression's errors foretell themselves beside its regressors: told in short records.

A sum of squares of many correlations tells little of short records, and what the coefficients took
to whiten errors is missing from it. Here past errors stand beside the regressors, as the first
coefficients of a noise model would.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.identification.innovation_tests import InnovationTests
from flightid.uncertainty.foretold import percent_of_output

Array = NDArray[np.float64]
LAGS = 4
"""Past errors that are asked."""
FEWEST = 10
"""Errors beside all coefficients below which nothing is asked."""


def with_own_past(
    tests: InnovationTests, slopes: Array, errors: Array, lengths: list[int], ratio: float
) -> InnovationTests:
    """The tests, with past errors asked beside the regressors; Bonferroni's chance of both.

    Parameters
    ----------
    tests : InnovationTests
    slopes : ndarray, shape (n_samples, n)
        How errors answer to the coefficients, records after records.
    errors : ndarray, shape (n_samples,)
    lengths : list of int
        Samples of each record.
    ratio : float
        Errors over outputs.

    Returns
    -------
    InnovationTests
        Where this test tells more than the portmanteau, `excess` and `past_percent` are what past
        errors foretell by coefficients that are fitted with the model's: all of the part that
        biases, not what is left of it.

    Reference
    ---------
    Breusch (1978), Australian Economic Papers 17, 334-355; Godfrey (1978), Econometrica 46,
    1293-1301.

    Example
    -------
    >>> e = np.random.default_rng(1).standard_normal(101)
    >>> late, early = e[1:] + e[:-1], np.zeros((100, 0))
    >>> with_own_past(InnovationTests(0.5, 0.5), early, late, [100], 0.1).is_white
    False
    """
    past = _past(errors, lengths)
    beside = _centred(slopes, lengths)
    about = _centred(errors[:, None], lengths)[:, 0]
    free = errors.size - len(lengths) - beside.shape[1] - LAGS
    if free < FEWEST or not about @ about > 0.0:
        return tests
    basis = np.linalg.qr(beside)[0]
    about = about - basis @ (basis.T @ about)
    new = past - basis @ (basis.T @ past)
    weights = np.linalg.lstsq(new, about, rcond=None)[0]
    left = about - new @ weights
    noise = float(left @ left) / free
    if not noise > 0.0:
        return tests
    statistic = float(about @ about - left @ left) / noise
    chance = float(scipy.special.fdtrc(LAGS, free, statistic / LAGS))
    white = min(1.0, 2.0 * min(chance, 1.0 if tests.white is None else tests.white))
    if tests.white is not None and tests.white <= chance:
        return replace(tests, white=white, is_short=True)
    foretold = float(np.sum((past @ weights) ** 2))
    share = max(0.0, foretold / noise - LAGS) * noise / float(errors @ errors)
    worth = percent_of_output(min(share, 1.0), ratio, 1.0) or 0.0
    return replace(
        tests,
        white=white,
        past_percent=max(worth, tests.past_percent or 0.0),
        excess=(max(foretold / noise - LAGS, tests.excess[0]), tests.excess[1]),
        is_short=True,
    )


def _past(errors: Array, lengths: list[int]) -> Array:
    """Errors so many samples before, none from before a record, about their means."""
    found, start = np.zeros((errors.size, LAGS)), 0
    for length in lengths:
        row = errors[start : start + length]
        for lag in range(1, min(LAGS, length - 1) + 1):
            found[start + lag : start + length, lag - 1] = row[:-lag]
        start += length
    return _centred(found, lengths)


def _centred(columns: Array, lengths: list[int]) -> Array:
    """Columns less each record's means: a constant of each is fitted."""
    ends = np.cumsum(lengths)[:-1]
    return np.concatenate([each - each.mean(axis=0) for each in np.split(columns, ends)])
