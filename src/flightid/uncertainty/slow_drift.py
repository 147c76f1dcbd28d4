"""A slow drift beside faster noise: a first-order process whose corner no short recursion reaches.

A walk that ends a standard deviation of white noise away stands above it in a few bins alone. An
autoregression of few samples does not see these, and slow sensitivities look nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
SLOWEST = 1.5
"""Corner over the inverse of the number of samples, rad: below it a record knows no corner."""
LEAST_FREEDOM = 1.0
"""Below it Student's distribution has no mean, and its interval no meaning."""
RANK = 1e-12
"""Share of the largest information below which a direction of a drift is not known at all."""
FASTEST = 0.05
"""Corner (rad per sample) from which on an autoregression serves."""
STEP = 4.0
"""Ratio of neighbouring corners that are tried."""
LOOKS, RACE, ROUNDS = 4, 6, 30
"""Rounds of expectation and maximisation at each corner, more where it is close, most at the best.

They gain a digit in two rounds."""
SETTLED = 1e-7
"""Relative change of a drift's variance in a round that ends the rounds."""
CLOSE = 60.0
"""Twice a likelihood by which a corner may be behind after its looks and still win."""
NUMBERS = 2
"""Variance and corner."""
STARTED = 0.3
"""Share of the mean power that a drift begins with."""
SEEN, OCTAVES = 1.5, (4, 8, 16, 32)
"""Standard deviations by which the power of so many half cycles makes a drift worth a look."""


@dataclass(frozen=True)
class Drift:
    """First-order autoregression with a slow corner.

    Attributes
    ----------
    variance : float
        Square of the residual's unit.
    corner : float
        One less the pole, rad per sample.
    freedom : float or None
        Degrees of freedom of the variance, at a corner that is given; None where the spectrum tells
        both (`doubt`).
    """

    variance: float
    corner: float
    freedom: float | None = None

    def autocovariance(self, n_lags: int) -> Array:
        """Autocovariance at lags 0 to ``n_lags - 1``."""
        return np.asarray(self.variance * (1.0 - self.corner) ** np.arange(n_lags))

    def spectrum(self, length: int) -> Array:
        """Spectrum at the bins of a real transform of this length."""
        power, under = self._parts(length)
        return np.asarray(self.variance * power / under)

    def doubt(self, fast: Array, n: int, length: int) -> Array:
        """Variance of the logarithm of the whole level at each bin.

        By Whittle's information of n samples on both levels and the corner; `fast` is the spectrum
        of the other noise.
        """
        power, under = self._parts(length)
        own = self.variance * power / under
        if self.freedom is not None:
            level = 2.0 / max(self.freedom, LEAST_FREEDOM)
            return np.asarray(level * (own / (fast + own)) ** 2)
        # By the corner: a number times `own`, which is there, and one times this.
        slopes = np.array([fast, own, own * self.corner**2 / under]) / (fast + own)
        information = 0.5 * n * (slopes @ slopes.T) / len(fast)
        inverse = np.linalg.pinv(information, rcond=RANK, hermitian=True)
        return np.asarray(np.einsum("ib,ij,jb->b", slopes, inverse, slopes))

    def _parts(self, length: int) -> tuple[float, Array]:
        """Power of the drive of unit variance, and what the recursion divides by at each bin."""
        pole = 1.0 - self.corner
        return 1.0 - pole**2, self.corner**2 + 2.0 * pole * turns(length)


@lru_cache(maxsize=2)
def turns(length: int) -> Array:
    """One less the cosine of each bin's angle."""
    found = 1.0 - np.cos(2.0 * np.pi * np.arange(length // 2 + 1) / length)
    found.flags.writeable = False
    return np.asarray(found)


class Spectral(Protocol):
    """A model of noise: its order and its spectrum."""

    @property
    def weights(self) -> Array:
        """One number for each order."""

    def spectrum(self) -> Array:
        """At the bins of the power that it was made of."""


M = TypeVar("M", bound=Spectral)
Rounds = Callable[[Array, tuple[M, Drift], int], tuple[M, Drift]]
"""Of expectation and maximisation."""
Likelihood = Callable[[Array, tuple[M, Drift]], float]
"""Twice Whittle's, of a power, for both parts together."""


def apart(
    plain: M,
    power: Array,
    n: int,
    length: int,
    rounds: Rounds[M],
    likelihood: Likelihood[M] | None = None,
) -> tuple[M, Drift | None]:
    """Noise and the drift beside it; the noise as it was where nothing speaks for a drift.

    Expectation and maximisation over the spectrum, at corners a factor apart; Whittle's likelihood
    and the Bayesian criterion say whether the drift is worth its numbers.

    Parameters
    ----------
    plain : model
        Of all power.
    power : ndarray, shape (n_bins,)
        Periodogram at the bins of a real transform of `length`.
    n : int
        Number of samples.
    length : int
    rounds : callable
        Takes a power, a noise with the drift beside it and a number of rounds; gives both after
        these.
    likelihood : callable, optional
        `whittle` of a power for a noise with the drift beside it; default: by their spectra.

    Reference
    ---------
    Dempster, Laird & Rubin (1977), J. Royal Statistical Society B 39(1), section 2; Whittle (1953),
    Estimation and information in stationary time series, Arkiv foer Matematik 2(23).
    """
    # A spectrum of nothing stands beside the negative power of errors less than their known noise.
    least = np.finfo(float).eps ** 2 * float(np.max(np.abs(power), initial=0.0))
    level = np.maximum(plain.spectrum(), max(np.finfo(float).tiny, least))
    if not is_slow(power / level, n, length):
        return plain, None
    whole = np.maximum(power, 0.0)
    count = max(2, 1 + round(np.log(FASTEST * n / SLOWEST) / np.log(STEP)))
    start = STARTED * float(np.mean(whole))

    def worth(pair: tuple[M, Drift]) -> float:
        fast, drift = pair
        told = (
            whittle(fast.spectrum() + drift.spectrum(length), whole, n)
            if likelihood is None
            else likelihood(whole, pair)
        )
        return _criterion(told, fast.weights.size + NUMBERS, n)

    found = [
        rounds(whole, (plain, Drift(start, corner)), LOOKS)
        for corner in np.geomspace(SLOWEST / n, FASTEST, count)
    ]
    values = [worth(pair) for pair in found]
    close = [pair for pair, value in zip(found, values, strict=True) if value > max(values) - CLOSE]
    if len(close) > 1:
        close = [rounds(whole, pair, RACE) for pair in close]
    best = rounds(whole, max(close, key=worth), ROUNDS)
    alone = _criterion(whittle(level, whole, n), plain.weights.size, n)
    return best if worth(best) > alone else (plain, None)


def whittle(spectrum: Array, power: Array, n: int) -> float:
    """Twice Whittle's likelihood of n samples with a power, for a spectrum at the same bins.

    Example
    -------
    >>> whittle(np.ones(3), np.ones(3), 10)
    -10.0
    """
    return float(-n * np.mean(np.log(spectrum) + power / spectrum))


def _criterion(likelihood: float, numbers: int, n: int) -> float:
    """Twice a likelihood less what its numbers cost."""
    return likelihood - numbers * float(np.log(n))


def n_slow_bins(n: int, length: int) -> int:
    """How many of the first bins `is_slow` looks at."""
    return max(OCTAVES) * length // n + 1


def is_slow(ratio: Array, n: int, length: int) -> bool:
    """Whether octaves of the slowest bins hold more power than a model gives them.

    Parameters
    ----------
    ratio : ndarray
        Power over the model's, at the first bins: `n_slow_bins` of them, or all.
    n : int
        Number of samples.
    length : int
        Of the transform.
    """
    sums = np.cumsum(ratio - 1.0)
    last = (np.array(OCTAVES) * length) // n
    last = last[last < len(ratio)]
    return bool(np.any(sums[last] * n / length > SEEN * np.sqrt(last * n / length)))
