"""Noise in the residuals of a fit: an autoregressive model of each output, stable by construction.

The order is chosen by the Bayesian information criterion. Sample autocovariances alone would give
too little: the fit has already taken out of the residuals what lies along the sensitivities. What
it took of noise like the model's is given back, in rounds. The power so restored is no sample
spectrum any more and may be negative in places; it is cut off there, so that its autocovariance is
one, the recursion over the orders meets no reflection of one or more, and the model cannot grow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid._native import autoregression_weights, drift_beside, drift_likelihood
from flightid.frozen import dataclass
from flightid.recursive_filter import filtered_from, state_after
from flightid.uncertainty.driven_noise import driven_products
from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.periodograms import (
    LONGEST_TABLE,
    cosines,
    first_lags,
    leaking,
    pooled,
    transform_length,
)
from flightid.uncertainty.slow_drift import (
    LEAST_FREEDOM,
    SETTLED,
    Drift,
    apart,
    is_slow,
    n_slow_bins,
    turns,
    whittle,
)
from flightid.uncertainty.taken_noise import TakenNoise

Array = NDArray[np.float64]
LARGEST_ORDER = 20
"""Most coefficients of a model of noise."""
SAMPLES_PER_NUMBER = 20
"""Samples without which a model of noise has no further coefficient."""
SEPARATIONS = 20
"""Rounds in which a known part is told from the rest."""
RESTORATIONS = 2
"""Times that models of the noise are made with what a fit took away by those before."""
SHARPEST = 1e6
"""Power of one line over the whole power that no sound model reaches."""
CUT = 1e-6
"""Of the mean power, to which a power that is negative is cut: below it rounding decides."""
VALLEY = 0.02
"""Share of the mean power below which a spectrum is not believed."""


@dataclass(frozen=True, eq=False)
class Autoregression:
    """Autoregressive model of a stationary residual.

    Attributes
    ----------
    lags : ndarray, shape (largest_order + 1,)
        Autocovariance at the first lags, square of the residual's unit.
    weights : ndarray, shape (order,)
        Weights of the past samples.
    n : int
        Number of samples of the residual.
    length : int
        Transform length of its periodogram.
    drift : Drift or None
        Slow noise beside that of `lags` and `weights`.
    """

    lags: Array
    weights: Array
    n: int
    length: int
    drift: Drift | None = None

    @property
    def is_white(self) -> bool:
        """Whether no sample tells of another."""
        return not self.weights.size and self.drift is None

    @property
    def order(self) -> int:
        """Of the recursion, and of the drift's."""
        return self.weights.size + (self.drift is not None)

    def autocovariance(self, n_lags: int) -> Array:
        """Autocovariance at lags 0 to ``n_lags - 1``."""
        fast = self._fast_autocovariance(n_lags)
        return fast if self.drift is None else fast + self.drift.autocovariance(n_lags)

    def _fast_autocovariance(self, n_lags: int) -> Array:
        order = self.weights.size
        if n_lags <= order:
            return self.lags[:n_lags].copy()
        result = np.zeros(n_lags)
        result[: order + 1] = self.lags[: order + 1]
        if order:
            # Beyond its order the model continues its autocovariance by its own recursion.
            denominator = np.concatenate(([1.0], -self.weights))
            state = state_after(denominator, result[order:0:-1])
            result[order + 1 :] = filtered_from(
                [1.0], denominator, np.zeros(n_lags - order - 1), state
            )[0]
        return result

    def squared(self, columns: Array) -> Array:
        """Columns' covariance by this noise: XᵀΩX, shape (k, k)."""
        if not self.weights.size:
            fast = np.asarray(self.lags[0] * (columns.T @ columns))
        else:
            fast = self.innovation * driven_products(
                columns, np.concatenate(([1.0], -self.weights))
            )
        if self.drift is None:
            return fast
        pole = 1.0 - self.drift.corner
        drive = self.drift.variance * (1.0 - pole**2)
        return np.asarray(fast + drive * driven_products(columns, np.array([1.0, -pole])))

    @property
    def innovation(self) -> float:
        """Variance of what the recursion does not foretell."""
        return max(float(self.lags[0] - self.weights @ self.lags[1 : self.weights.size + 1]), 0.0)

    def freedom(self, levels: Array | None = None) -> Array | float:
        """Degrees of freedom of the model's level at zero frequency, where slow sensitivities look.

        Beside a drift: where the spectrum comes down to each of some `levels`.

        Weights are known to ``innovation / n`` times the inverse of their autocovariance, and the
        level goes with the inverse square of one less their sum.
        """
        order, share = self.weights.size, 2.0 / self.n
        if order:
            innovation = float(self.lags[0] - self.weights @ self.lags[1 : order + 1])
            ones = np.ones(order)
            try:
                known = float(scipy.linalg.solve_toeplitz(self.lags[:order], ones) @ ones)
            except np.linalg.LinAlgError:
                return LEAST_FREEDOM
            short = (1.0 - float(self.weights.sum())) ** 2
            if not short > 0.0:
                return LEAST_FREEDOM
            share += 4.0 * max(known * innovation / self.n, 0.0) / short
        if self.drift is None or levels is None:
            return max(2.0 / share, LEAST_FREEDOM)
        fast = self._fast_spectrum()
        whole = fast + self.drift.spectrum(self.length)
        bins = np.array([int(np.argmax(whole <= level)) for level in levels])
        drifting = self.drift.doubt(fast, self.n, self.length)
        doubt = ((fast / whole) ** 2 * share + drifting)[bins]
        return np.asarray(np.maximum(2.0 / doubt, LEAST_FREEDOM))

    def unshaped(self, columns: Array) -> Array:
        """Columns by the inverse of this noise's covariance, but for their ends: Ω⁻¹X, (n, k).

        Deep valleys of a sharp spectrum are filled by what its peaks leak: no model tells them.
        """
        spectrum = self.spectrum()
        level = np.maximum(spectrum, VALLEY * np.mean(spectrum))
        rows = np.empty(columns.shape[::-1])
        for row, column in zip(rows, columns.T, strict=True):
            part = scipy.fft.rfft(column, self.length) / level
            row[:] = scipy.fft.irfft(part, self.length)[: len(row)]
        return rows.T

    def spectrum(self) -> Array:
        """Spectrum at the frequencies of `periodogram`."""
        fast = self._fast_spectrum()
        return fast if self.drift is None else fast + self.drift.spectrum(self.length)

    def _fast_spectrum(self) -> Array:
        order = self.weights.size
        innovation = self.innovation
        if not order:
            return np.full(self.length // 2 + 1, innovation)
        gain = scipy.fft.rfft(np.concatenate(([1.0], -self.weights)), self.length)
        # A pole that rounding puts onto the circle: no line holds more than all power, by far.
        most = SHARPEST * self.length * max(float(self.lags[0]), np.finfo(float).tiny)
        least = max(innovation / most, np.finfo(float).tiny)
        return np.asarray(innovation / np.maximum(np.abs(gain) ** 2, least))


def autoregression(
    power: Array, n: int, known: Array | None = None, length: int | None = None
) -> Autoregression:
    """Autoregressive model of a residual by its `periodogram`.

    A part of the residual whose mean periodogram is `known` is left out of the model, by
    expectation and maximisation over the spectrum: both parts keep positive spectra.

    Parameters
    ----------
    power : ndarray, shape (n_bins,)
        Periodogram of the residual.
    n : int
        Number of samples of the residual.
    known : ndarray, shape (n_bins,), optional
        Mean periodogram of the part to leave out.
    length : int, optional
        Transform length of the periodogram; default: that of n samples.

    Reference
    ---------
    Brockwell & Davis, Time Series: Theory and Methods (2nd ed.), sections 8.1-8.2 (Yule-Walker);
    Dempster, Laird & Rubin (1977), J. Royal Statistical Society B 39(1), section 2.

    Example
    -------
    >>> from flightid.uncertainty.periodograms import periodogram
    >>> white = np.random.default_rng(0).standard_normal((4000, 1))
    >>> autoregression(periodogram(white), 4000).autocovariance(3).round(1)
    array([1., 0., 0.])
    """
    length = transform_length(n) if length is None else length
    model = _fitted(power, n, length)
    if known is None:
        rounds, likelihood = partial(_rounds, n, length), partial(_likelihood, n, length)
        fast, drift = apart(model, power, n, length, rounds, likelihood)
        return replace(fast, drift=drift)
    for _ in range(SEPARATIONS):
        own = model.spectrum()
        share = own / np.maximum(own + known, np.finfo(float).tiny)
        model = _fitted(share**2 * power + share * known, n, length, often=True)
    return model


def _fitted(power: Array, n: int, length: int, *, often: bool = False) -> Autoregression:
    """Stable autoregression of a periodogram.

    A periodogram that a fit's share was given back to can be negative somewhere: then it is no
    power, its autocovariance is no autocovariance, and the recursion meets a reflection above one.
    What is negative is cut off there; of a power all reflections are below one, and of one without
    valleys of nothing no rounding takes a pole over the circle.
    """
    largest = min(LARGEST_ORDER, n // SAMPLES_PER_NUMBER)
    lags = first_lags(power, length, largest, often=often)
    weights, sound = autoregression_weights(lags, n)
    if not sound:
        least = CUT * float(np.mean(np.maximum(power, 0.0)))
        lags = first_lags(np.maximum(power, least), length, largest)
        weights, _ = autoregression_weights(lags, n)
    return Autoregression(lags, weights, n, length)


def _rounds(
    n: int, length: int, whole: Array, pair: tuple[Autoregression, Drift], rounds: int
) -> tuple[Autoregression, Drift]:
    """Rounds for `apart`, natively; by a table of cosines where that stays in the cache."""
    fast, drift = pair
    none = np.empty((0, 0))
    most = min(LARGEST_ORDER, n // SAMPLES_PER_NUMBER)
    tables = none if length > LONGEST_TABLE else cosines(length, most), turns(length)
    begun = fast.lags, fast.weights, drift.variance
    ends = rounds, SETTLED, SHARPEST, CUT
    lags, weights, variance = drift_beside(whole, tables, (length, n), begun, drift.corner, ends)
    return Autoregression(lags, weights, n, length), replace(drift, variance=variance)


def _likelihood(n: int, length: int, whole: Array, pair: tuple[Autoregression, Drift]) -> float:
    """`whittle` of autoregression and drift, natively where a transform is not long."""
    fast, drift = pair
    if length > LONGEST_TABLE:
        return whittle(fast.spectrum() + drift.spectrum(length), whole, n)
    tables = cosines(length, min(LARGEST_ORDER, n // SAMPLES_PER_NUMBER)), turns(length)
    parts = fast.lags, fast.weights, drift.variance
    return drift_likelihood(whole, tables, (length, n), parts, drift.corner, SHARPEST)


def noise_models(
    residuals: Sequence[Array], taken: Sequence[FittedDirections], known: Array | None = None
) -> list[Autoregression]:
    """Models of the outputs' noise, in rounds: what the fit took of it is given back.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (n_outputs, n)
        By record.
    taken : sequence of FittedDirections
        By record, in the residuals' own metric.
    known : ndarray, shape (n_outputs, n_bins), optional
        Mean periodograms of parts to leave out of the models; one record alone.

    Returns
    -------
    list of Autoregression
        By output.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal((1, 2000))
    >>> none = FittedDirections(np.zeros((1, 2000, 0)), np.zeros((1, 2000, 0)))
    >>> model, = noise_models([white], [none])
    >>> model.autocovariance(2).round(1) + 0.0
    array([1., 0.])
    """
    lengths = [each.shape[1] for each in residuals]
    total, length, n_outputs = sum(lengths), transform_length(max(lengths)), residuals[0].shape[0]
    outputs = range(n_outputs)
    seen = np.array([pooled([each[o][:, None] for each in residuals], length) for o in outputs])
    count, bins = min(LARGEST_ORDER, total // SAMPLES_PER_NUMBER) + 1, n_slow_bins(total, length)
    noise = TakenNoise(taken, length, count, min(bins, seen.shape[1]))
    # What is seen is the same in all rounds.
    begun = [first_lags(power, length, count - 1) for power in seen if known is None]

    def modelled(output: int, before: Autoregression | None) -> Autoregression:
        """Of what is seen, and of what the fit took of the model of the round before."""
        power = seen[output]
        if known is None and (before is None or before.is_white):
            # First lags and slowest bins tell a white model.
            lags, slow = begun[output], power[:bins]
            if before is not None:
                more, lower = noise.of_white(output, float(before.lags[0]), forms)
                lags, slow = lags + more / total, slow + lower / total
            if (white := _white(lags, slow, total, length)) is not None:
                return white
        if before is not None:
            power = power + noise.at_all_bins(output, before, forms) / total
            # White noise has one lag, which ends with no record.
            if not before.is_white:
                spectrum = before.spectrum()
                power = power + (spectrum - leaking(spectrum, lengths, length))
        return autoregression(power, total, None if known is None else known[output], length)

    forms: list[Array] = []
    models = [modelled(output, None) for output in outputs]
    for _ in range(RESTORATIONS):
        forms = noise.forms(models)
        models = [modelled(output, before) for output, before in enumerate(models)]
    return models


def _white(lags: Array, slow: Array, n: int, length: int) -> Autoregression | None:
    """The model of these lags and slowest bins where it is white; else None."""
    weights, sound = autoregression_weights(lags, n)
    level = max(float(lags[0]), np.finfo(float).tiny)
    if weights.size or not sound or is_slow(slow / level, n, length):
        return None
    return Autoregression(lags, weights, n, length)
