"""Bands of neighbouring frequencies of a free run: what follows an injection there, and what not.

What follows the injection is coherent in a band, gusts are not. A model that is wrong errs by a
smooth share of its own answer: a gain, what grows with frequency (a lag, a delay) and what falls
with it (a damping); along these a small miss is told that is lost among all that could be missed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.prediction.result import Prediction
from flightid.uncertainty.quantiles import half_width

Array = NDArray[np.float64]
Spectra = NDArray[np.complex128]
BINS = 12
"""Frequencies of a band: an answer hardly turns within it, and noise is told from it."""
MEMORY = 30
"""Past samples by which errors are whitened: a steep spectrum leaks into bands far above it."""
SMOOTHED = 9
"""Bands over whose mean the noise of whitened errors is read where it weighs."""
SURE = half_width(0.90)
"""Standard errors of a miss, to one side: 95 % of right statements."""
RANK = 1e-6
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Powers:
    """Powers by band without what noise makes of them, and the variances of those numbers."""

    value: Array
    variance: Array

    def times(self, factor: Array) -> Powers:
        """In other units."""
        return Powers(factor * self.value, factor**2 * self.variance)

    @property
    def total(self) -> tuple[float, float]:
        """Of all bands, and its variance."""
        return float(np.sum(self.value)), float(np.sum(self.variance))


@dataclass(frozen=True, eq=False)
class InjectedBands:
    """Bands of neighbouring frequencies, whitened by what the error holds; of one record or more.

    Attributes
    ----------
    injected : ndarray, shape (n,)
        Power of the excitations, as they were.
    missed, answer : Powers
        What of the error and of the output follows them.
    back : ndarray, shape (n,)
        Factors to powers as they were.
    chance : ndarray, shape (n,)
        That noise makes as much of a miss (Fisher's F).
    noise : ndarray, shape (n,)
        Power of the error at a frequency that does not follow.
    grams : (ndarray, ndarray), shape (n, n_ways, n_ways)
        Products of the ways in which a model is wrong: of what follows, and of chance beside it.
    along : ndarray, shape (n, n_ways)
        Their products with the error, less what chance makes.
    """

    injected: Array
    missed: Powers
    answer: Powers
    back: Array
    chance: Array
    noise: Array
    grams: tuple[Array, Array]
    along: Array

    @staticmethod
    def joined(parts: Sequence[InjectedBands]) -> InjectedBands:
        """Bands of records, one after the other."""
        return _each(np.concatenate, parts)

    def where(self, kept: NDArray[np.bool_]) -> InjectedBands:
        """Some of the bands."""
        return _each(lambda rows: rows[0][kept], [self])


def _each(made: Callable[[list[Array]], Array], parts: Sequence[InjectedBands]) -> InjectedBands:
    missed, answer = (
        Powers(made([each.value for each in side]), made([each.variance for each in side]))
        for side in ([each.missed for each in parts], [each.answer for each in parts])
    )
    return InjectedBands(
        made([each.injected for each in parts]),
        missed,
        answer,
        made([each.back for each in parts]),
        made([each.chance for each in parts]),
        made([each.noise for each in parts]),
        (made([each.grams[0] for each in parts]), made([each.grams[1] for each in parts])),
        made([each.along for each in parts]),
    )


def injected_bands(run: Prediction, name: str, excitations: Sequence[str]) -> InjectedBands | None:
    """Bands of an output of a free run, lowest frequency first; none of a run without error.

    Parameters
    ----------
    run : Prediction
    name : str
        Of the output.
    excitations : sequence of str
    """
    y, y_hat = run.scored(name)
    injected = np.array([run.measured[each][run.start :] for each in excitations])
    weights = _whitening(y - y_hat)
    if weights is None or not np.all(np.ptp(injected, axis=1) > 0.0):
        return None
    # One filter for all leaves each answer to the excitations what it is.
    rows = np.vstack([y, y - y_hat, y_hat, injected - injected.mean(axis=1, keepdims=True)])
    white = scipy.signal.lfilter(weights, [1.0], rows)[:, weights.size :]
    n = white.shape[1]
    spectra = np.fft.rfft(white) * np.sqrt(2.0 / n)
    shape = np.abs(np.fft.rfft(weights, n)) ** 2
    turn = np.arange(spectra.shape[1]) / n
    count = (spectra.shape[1] - 1) // BINS

    used = slice(1, 1 + count * BINS)
    return _bands(
        spectra[:, used].reshape(-1, count, BINS),
        shape[used].reshape(count, BINS),
        turn[used].reshape(count, BINS),
    )


def _bands(spectra: Spectra, shape: Array, turn: Array) -> InjectedBands:
    output, error, said = spectra[:3]
    injected = np.moveaxis(spectra[3:], 0, -1)
    directions, sizes, _ = np.linalg.svd(injected, full_matrices=False)
    kept = sizes > RANK * np.maximum(sizes[:, :1], TINY)
    basis = directions * kept[:, None, :]
    told = kept.sum(axis=1)
    free = BINS - told
    back = 1.0 / np.mean(shape, axis=1)
    (missed, noise), (answer, _) = (_powers(basis, each, told) for each in (error, output))
    found = _squares(_onto(basis, error))
    f = found / np.maximum(told, 1) / np.maximum(noise, TINY)
    chance = np.where(told > 0, scipy.special.fdtrc(2 * np.maximum(told, 1), 2 * free, f), 1.0)
    ways = np.stack([said, 1j * turn * said, said / (1j * turn)], axis=1)
    follows = (ways @ basis.conj()) @ np.swapaxes(basis, 1, 2)
    beside = ways - follows
    grams = [np.real(each.conj() @ np.swapaxes(each, 1, 2)) for each in (follows, beside)]
    by_chance = told / free
    along = np.real(_products(follows, error) - by_chance[:, None] * _products(beside, error))
    return InjectedBands(
        np.sum(_squares(np.swapaxes(injected, 1, 2)), axis=1) * back,
        missed,
        answer,
        back,
        chance,
        noise,
        (grams[0], by_chance[:, None, None] * grams[1]),
        along,
    )


def _powers(basis: Spectra, row: Spectra, told: Array) -> tuple[Powers, Array]:
    """What of a row follows the excitations, and the power at a frequency of what does not."""
    free = BINS - told
    along = _squares(_onto(basis, row))
    noise = np.maximum(_squares(row) - along, 0.0) / free
    clean = along - told * noise
    scatter = told * noise**2 + 2.0 * noise * np.maximum(clean, 0.0) + (told * noise) ** 2 / free
    return Powers(clean, scatter), noise


def _onto(basis: Spectra, row: Spectra) -> Spectra:
    return np.asarray(np.einsum("bfk,bf->bk", basis.conj(), row))


def _products(ways: Spectra, row: Spectra) -> Spectra:
    return np.asarray(np.einsum("bwf,bf->bw", ways.conj(), row))


def _squares(rows: Spectra) -> Array:
    return np.asarray(np.sum(np.abs(rows) ** 2, axis=-1), dtype=np.float64)


def _whitening(error: Array) -> Array | None:
    """Weights of the present and past errors that leave of them what is new (least squares)."""
    order = min(MEMORY, error.size // 20)
    if order < 1 or not np.any(error):
        return None
    past = np.lib.stride_tricks.sliding_window_view(error, order)[:-1, ::-1]
    weights = np.linalg.lstsq(past, error[order:], rcond=None)[0]
    return np.concatenate([[1.0], -weights])


def smooth_miss(bands: InjectedBands) -> tuple[float, float, float]:
    """Miss along the smooth ways: weighed by noise, as it is, and the chance of as much by noise.

    Parameters
    ----------
    bands : InjectedBands
        Those that hold injected power.

    Returns
    -------
    tuple of float
        Least misses over the answer, rms, and the chance (chi-square of as many ways).
    """
    noise = scipy.ndimage.uniform_filter1d(bands.noise, SMOOTHED, mode="nearest")
    weights = 1.0 / np.maximum(noise, TINY)
    followed, beside = bands.grams
    scale = np.sqrt(weights @ np.diagonal(followed, axis1=1, axis2=2))
    scale = np.where(scale > 0.0, scale, 1.0)
    both = np.outer(scale, scale)

    def total(factors: Array, second: float) -> Array:
        return np.asarray(np.einsum("b,bij->ij", factors, followed + second * beside) / both)

    b = weights @ bands.along / scale
    scatter = 0.5 * total(weights, 1.0)
    statistic = float(b @ np.linalg.pinv(scatter, rcond=RANK, hermitian=True) @ b)
    moves = np.linalg.pinv(total(weights, -1.0), rcond=RANK, hermitian=True) @ b
    sure = max(0.0, 1.0 - SURE / np.sqrt(max(statistic, TINY)))
    misses = []
    for factors in (weights, bands.back):
        answer = float(factors @ bands.answer.value)
        miss = float(moves @ total(factors, -1.0) @ moves)
        misses.append(float(sure * np.sqrt(max(miss, 0.0) / answer)) if answer > 0.0 else 0.0)
    return misses[0], misses[1], float(scipy.special.chdtrc(len(b), statistic))
