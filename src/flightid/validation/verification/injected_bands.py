"""Bands of neighbouring frequencies of a free run: what follows an injection there, and what not.

What follows the injection is coherent in a band, gusts are not. A model that is wrong errs by a
smooth share of its own answer: a gain, what grows with frequency (a lag, a delay) and what falls
with it (a damping); along these a small miss is told that is lost among all that could be missed.
"""

from __future__ import annotations

from collections.abc import Sequence

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


@dataclass(frozen=True)
class Power:
    """A power without what noise makes of it, and the variance of that number."""

    value: float
    variance: float

    def times(self, factor: float) -> Power:
        """In another unit."""
        return Power(factor * self.value, factor**2 * self.variance)


@dataclass(frozen=True, eq=False)
class InjectedBand:
    """Neighbouring frequencies of one record, whitened by what the error holds.

    Attributes
    ----------
    injected : float
        Power of the excitations, as they were.
    missed, answer : Power
        What of the error and of the output follows them.
    back : float
        Factor to powers as they were.
    chance : float
        That noise makes as much of a miss (Fisher's F).
    noise : float
        Power of the error at a frequency that does not follow.
    grams : (ndarray, ndarray), shape (n_ways, n_ways)
        Products of the ways in which a model is wrong: of what follows, and of chance beside it.
    along : ndarray, shape (n_ways,)
        Their products with the error, less what chance makes.
    """

    injected: float
    missed: Power
    answer: Power
    back: float
    chance: float
    noise: float
    grams: tuple[Array, Array]
    along: Array


def injected_bands(run: Prediction, name: str, excitations: Sequence[str]) -> list[InjectedBand]:
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
        return []
    # One filter for all leaves each answer to the excitations what it is.
    rows = np.vstack([y, y - y_hat, y_hat, injected - injected.mean(axis=1, keepdims=True)])
    white = scipy.signal.lfilter(weights, [1.0], rows)[:, weights.size :]
    n = white.shape[1]
    spectra = np.fft.rfft(white) * np.sqrt(2.0 / n)
    shape = np.abs(np.fft.rfft(weights, n)) ** 2
    turn = np.arange(spectra.shape[1]) / n
    count = (spectra.shape[1] - 1) // BINS
    parts = (slice(at, at + BINS) for at in range(1, 1 + count * BINS, BINS))
    return [_band(spectra[:, part], shape[part], turn[part]) for part in parts]


def _band(spectra: Spectra, shape: Array, turn: Array) -> InjectedBand:
    output, error, said, injected = spectra[0], spectra[1], spectra[2], spectra[3:]
    directions, sizes, _ = np.linalg.svd(injected.T, full_matrices=False)
    basis = directions[:, sizes > RANK * max(sizes[0], TINY)]
    told, free = basis.shape[1], injected.shape[1] - basis.shape[1]
    back = 1.0 / float(np.mean(shape))
    (missed, noise), (answer, _) = (_power(basis, each, free) for each in (error, output))
    found = float(np.sum(np.abs(basis.conj().T @ error) ** 2))
    chance = 1.0
    if told:
        f = found / told / max(noise, TINY)
        chance = float(scipy.special.fdtrc(2 * told, 2 * free, f))
    ways = np.array([said, 1j * turn * said, said / (1j * turn)])
    follows = (ways @ basis.conj()) @ basis.T
    beside = ways - follows
    grams = tuple(np.real(each.conj() @ each.T) for each in (follows, beside))
    along = np.real(follows.conj() @ error) - told / free * np.real(beside.conj() @ error)
    power = float(np.sum(np.abs(injected) ** 2)) * back
    return InjectedBand(
        power, missed, answer, back, chance, noise, (grams[0], told / free * grams[1]), along
    )


def _power(basis: Spectra, row: Spectra, free: int) -> tuple[Power, float]:
    """What of a row follows the excitations, and the power at a frequency of what does not."""
    told = basis.shape[1]
    along = float(np.sum(np.abs(basis.conj().T @ row) ** 2))
    noise = max(float(np.sum(np.abs(row) ** 2)) - along, 0.0) / free
    clean = along - told * noise
    scatter = told * noise**2 + 2.0 * noise * max(clean, 0.0) + (told * noise) ** 2 / free
    return Power(clean, scatter), noise


def _whitening(error: Array) -> Array | None:
    """Weights of the present and past errors that leave of them what is new (least squares)."""
    order = min(MEMORY, error.size // 20)
    if order < 1 or not np.any(error):
        return None
    past = np.lib.stride_tricks.sliding_window_view(error, order)[:-1, ::-1]
    weights = np.linalg.lstsq(past, error[order:], rcond=None)[0]
    return np.concatenate([[1.0], -weights])


def smooth_miss(bands: Sequence[InjectedBand]) -> tuple[float, float, float]:
    """Miss along the smooth ways: weighed by noise, as it is, and the chance of as much by noise.

    Parameters
    ----------
    bands : sequence of InjectedBand
        Those that hold injected power.

    Returns
    -------
    tuple of float
        Least misses over the answer, rms, and the chance (chi-square of as many ways).
    """
    noise = scipy.ndimage.uniform_filter1d([band.noise for band in bands], SMOOTHED, mode="nearest")
    weights = 1.0 / np.maximum(noise, TINY)
    scale = np.sqrt(sum(w * np.diag(b.grams[0]) for w, b in zip(weights, bands, strict=True)))
    scale = np.where(scale > 0.0, scale, 1.0)
    both = np.outer(scale, scale)

    def total(factors: Array, second: float) -> Array:
        made = np.zeros_like(both)
        for factor, band in zip(factors, bands, strict=True):
            made += factor * (band.grams[0] + second * band.grams[1])
        return np.asarray(made / both, dtype=np.float64)

    b = sum(w * band.along for w, band in zip(weights, bands, strict=True)) / scale
    scatter = 0.5 * total(weights, 1.0)
    statistic = float(b @ np.linalg.pinv(scatter, rcond=RANK, hermitian=True) @ b)
    moves = np.linalg.pinv(total(weights, -1.0), rcond=RANK, hermitian=True) @ b
    sure = max(0.0, 1.0 - SURE / np.sqrt(max(statistic, TINY)))
    back = np.array([band.back for band in bands])
    misses = []
    for factors in (weights, back):
        answer = sum(f * band.answer.value for f, band in zip(factors, bands, strict=True))
        miss = float(moves @ total(factors, -1.0) @ moves)
        misses.append(float(sure * np.sqrt(max(miss, 0.0) / answer)) if answer > 0.0 else 0.0)
    return misses[0], misses[1], float(scipy.special.chdtrc(len(b), statistic))
