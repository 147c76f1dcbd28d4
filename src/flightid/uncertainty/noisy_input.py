"""Whether noise in the measurement of an input explains what past outputs foretell of it.

A noisy sensor hides an input's past, and outputs that are cleaner tell it better: they foretell the
input with the loop open (errors in variables). White noise of one variance makes few of the shapes
that a loop makes. For each variance it is taken out of the products of the input's own past, which
then foretells the input and, beside it, the outputs without bias; what is left of both must be
uncorrelated where the loop is open. Directions of the past in which a signal is not shown above
that noise foretell nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.lagged_products import past

Array = NDArray[np.float64]
Pair = tuple[Array, Array]
LOUDEST = 0.04
"""Share of an input's power beyond which a reader knows that its sensor is noisy: 20 % rms."""
PLAUSIBLE = 1e-4
"""Probability of what noise leaves, below which it is no explanation: signals are not linear."""
REMAINS = 1.0 / 6.0
"""Of a large χ² that noise may leave: what a past of so many samples foretells of an input of many
tones is not all, and the rest is no noise."""
PREFERRED = 6.63
"""Fall of χ² from no noise, of one number, that chance takes 1 of 100 times."""
SHOWN = 3.0
"""Errors of a direction's power by which it stands above the noise."""
BEYOND = 3.0
"""Times the power of the weakest direction, which is less than the noise by chance."""
FIRST = 1e-2
"""Least variance that is tried, over the largest."""
TRIED, REFINED = 14, 5
"""Variances from a share of the largest on, and steps of a golden section between them."""
LONGEST, SAMPLES_PER_NUMBER = 36, 20
"""Past samples that foretell an input where records have so many samples for each: steps that are
held have a long past, and what a shorter one misses outputs tell."""
RANK = 1e-10
"""Singular values below this share of the largest are rounding."""
GOLDEN = (5.0**0.5 - 1.0) / 2.0
"""Share of an interval that each step of the search for a minimum keeps."""


def explaining_noise(pairs: Sequence[Pair], place: int, order: int, lags: int) -> float | None:
    """Noise of an input's measurement that makes an open loop look closed; None where none does.

    Parameters
    ----------
    pairs : sequence of tuple of ndarray
        Inputs, shape (n_inputs, n_samples), and outputs of each record, means removed.
    place : int
        Of the input.
    order : int
        Past samples of every input that may foretell it, and of an output its own, at least.
    lags : int
        Past samples of what is new in outputs that are asked.

    Returns
    -------
    float or None
        Its share of the input's power.

    Assumes
    -------
    Noise of the sensor is white and independent of what outputs measure.

    Reference
    ---------
    Anderson & Deistler, "Identifiability in dynamic errors-in-variables models", *Journal of Time
    Series Analysis* 5 (1984); Söderström, "Errors-in-variables methods in system identification",
    *Automatica* 43 (2007); Hansen, "Large sample properties of generalized method of moments
    estimators", *Econometrica* 50 (1982).

    Example
    -------
    >>> e, n, v = np.random.default_rng(0).standard_normal((3, 2000))
    >>> u = scipy.signal.lfilter([1.0], [1.0, -1.6, 0.7], e)
    >>> seen, y = u + 0.1 * np.std(u) * n, np.append(0.0, u[:-1]) + 0.1 * v
    >>> 0.005 < explaining_noise([(seen[None], y[None])], 0, 10, 12) < 0.02
    True
    >>> fed = e - 0.5 * np.append(0.0, v[:-1])
    >>> explaining_noise([(fed[None], v[None])], 0, 10, 12) is None
    True
    """
    samples = sum(u.shape[1] for u, _ in pairs)
    order = max(order, min(LONGEST, samples // (SAMPLES_PER_NUMBER * len(pairs[0][0]))))
    asked = _NoisyPast.of(pairs, place, order, lags)
    largest = min(BEYOND * float(asked.own.power[0]), LOUDEST * asked.power)
    if not largest > 0.0:
        return None
    without = asked.chi_square(0.0)
    variance, least = _smallest(asked, np.geomspace(FIRST * largest, largest, TRIED))
    limit = float(scipy.special.chdtri(asked.numbers - 1, PLAUSIBLE))
    if least > max(limit, REMAINS * without) or without - least < PREFERRED:
        return None
    return variance / asked.power


def _smallest(asked: _NoisyPast, variances: Array) -> tuple[float, float]:
    """The variance that explains best, and the χ² that it leaves."""
    found = [asked.chi_square(float(each)) for each in variances]
    place = int(np.argmin(found))
    best = (float(variances[place]), found[place])
    low = float(np.log(variances[max(place - 1, 0)]))
    high = float(np.log(variances[min(place + 1, len(found) - 1)]))
    for _ in range(REFINED):
        inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)]
        left = [asked.chi_square(float(np.exp(each))) for each in inner]
        low, high = (low, inner[1]) if left[0] < left[1] else (inner[0], high)
        best = min([best, *zip(np.exp(inner).tolist(), left, strict=True)], key=lambda x: x[1])
    return best


@dataclass(frozen=True, eq=False)
class _Directions:
    """Columns of an input's past by the directions of their products, from strong to weak ones."""

    columns: Array
    power: Array
    along: Array

    @classmethod
    def of(cls, columns: Array) -> _Directions:
        power, along = np.linalg.eigh(columns.T @ columns / len(columns))
        return cls(columns, power, along)

    def weights(self, targets: Array, variance: float) -> Array:
        """Least squares of targets on the columns without noise of a variance in them."""
        left = np.maximum(self.power - variance, 0.0)
        error = SHOWN * self.power * np.sqrt(2.0 / len(self.columns)) * (variance > 0.0)
        # As a Wiener filter would: no direction counts for all or for nothing.
        gains = left / np.maximum(left**2 + error**2, (RANK * self.power[-1]) ** 2)
        aims = self.columns.T @ targets / len(self.columns)
        return np.asarray((self.along * gains) @ (self.along.T @ aims))


@dataclass(frozen=True, eq=False)
class _NoisyPast:
    """An input, its past, and outputs that their own past has whitened; others' pasts taken out.

    Records stand one after the other. `now`, shape (n,), and `own`, of its past, (n, order), begin
    `lags` samples after `with_now`, which holds both, (n + lags, order + 1), and `outputs`.
    """

    now: Array
    own: _Directions
    with_now: _Directions
    outputs: Array
    lengths: tuple[int, ...]
    lags: int

    @classmethod
    def of(cls, pairs: Sequence[Pair], place: int, order: int, lags: int) -> _NoisyPast:
        kept = [pair for pair in pairs if pair[0].shape[1] > order + lags]
        late = range(order + 1)
        columns = np.concatenate([past(u[place : place + 1], order, late) for u, _ in kept])
        others = np.concatenate([past(np.delete(u, place, 0), order, late) for u, _ in kept])
        outputs = np.concatenate(_whitened([y for _, y in kept], order))
        ways = np.linalg.lstsq(others, np.hstack([columns, outputs]), rcond=RANK)[0]
        columns = columns - others @ ways[:, : order + 1]
        outputs = outputs - others @ ways[:, order + 1 :]
        lengths = tuple(u.shape[1] - order for u, _ in kept)
        held = np.concatenate([np.arange(n) >= lags for n in lengths])
        own, whole = _Directions.of(columns[held, 1:]), _Directions.of(columns)
        return cls(columns[held, 0], own, whole, outputs, lengths, lags)

    @property
    def numbers(self) -> int:
        """Correlations that an open loop leaves at zero."""
        return self.lags * int(self.outputs.shape[1])

    @property
    def power(self) -> float:
        """Mean square of the input."""
        return float(np.mean(self.now**2))

    def chi_square(self, variance: float) -> float:
        """What correlates past outputs with the input, noise of a variance taken out of its past.

        In units of its own scatter, whatever the colours.
        """
        weights = self.own.weights(self.now, variance)
        ways = self.with_now.weights(self.outputs, variance)
        news = self.outputs - self.with_now.columns @ ways
        ends, late = np.cumsum(self.lengths)[:-1], range(1, self.lags + 1)
        heard = np.concatenate([past(rows.T, self.lags, late) for rows in np.split(news, ends)])
        left = self.now - self.own.columns @ weights
        # The same noise stands in what is left of the input and of outputs: that much is known.
        tail = np.pad(weights, (0, self.lags + len(ways)))
        shared = scipy.linalg.hankel(
            tail[: self.lags], tail[self.lags - 1 : self.lags - 1 + len(ways)]
        )
        known = variance * len(left) * np.ravel(shared @ ways)
        found = left @ heard - known
        beside = heard - self.own.columns @ self.own.weights(heard, variance)
        counts = [length - self.lags for length in self.lengths]
        scatter = _long_run(left[:, None] * beside, len(ways), counts)
        return float(found @ np.linalg.lstsq(scatter, found, rcond=RANK)[0])


def _whitened(outputs: Sequence[Array], order: int) -> list[Array]:
    """What their own pasts leave of outputs, each shape (n - order, n_outputs)."""
    columns = [past(y, order, range(1, order + 1)) for y in outputs]
    now = [y[:, order:].T for y in outputs]
    ways = np.linalg.lstsq(np.concatenate(columns), np.concatenate(now), rcond=RANK)[0]
    return [rows - each @ ways for rows, each in zip(now, columns, strict=True)]


def _long_run(rows: Array, span: int, lengths: Sequence[int]) -> Array:
    """Covariance of the sum of rows that remember less than a span (Bartlett's weights).

    No row remembers one of another record: each of them, of so many rows, ends by itself.
    """
    found = np.zeros((rows.shape[1], rows.shape[1]))
    for own in np.split(rows - np.mean(rows, axis=0), np.cumsum(lengths)[:-1]):
        sums = np.cumsum(np.pad(own, ((span + 1, span), (0, 0))), axis=0)
        moved = sums[span:] - sums[:-span]
        found += moved.T @ moved / span
    return found
