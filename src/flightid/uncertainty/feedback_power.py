"""What a test for a loop that saw none could have seen: a test without power tells nothing.

A loop that feeds the noise of one output back moves an input by what past noise makes of that
output. Of what is new in the input the test sees the part that its own lags of noise make; where
noise lives long, or a noisy sensor hides what moves the vehicle, that is little of what is fed
back. The smallest feedback that it would have seen is told as a share of the input's variance, and
as the bias that this leaves in an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.uncertainty.feedback_result import LAGS, LEVEL

Array = NDArray[np.float64]
ECHO = 400
"""Samples over which the answer to one sample of noise is followed."""
GROWN = 1e6
"""Times the noise at which one that grows is cut."""
SMALLEST = 1e-12
"""Part of what is fed back that counts as seen where none is."""
UNSEEN = 0.05
"""Chance with which the smallest feedback that counts as seen is missed."""


@dataclass(frozen=True)
class Unseen:
    """The largest feedback that a test would have missed, of the input and output where it matters.

    Attributes
    ----------
    input : int
        Place of the input.
    share : float
        Of its variance; above one where noise alone could make more than all of it.
    bias : float
        Bias of an estimate from it to the output, in standard errors.

    Example
    -------
    >>> Unseen(0, 0.02, 0.7).bias
    0.7
    """

    input: int
    share: float
    bias: float


def unseen_feedback(
    noise: Sequence[Array], echo: Array, inputs: Sequence[Array], own: Array, fresh: Sequence[Array]
) -> Unseen | None:
    """The feedback of one output that bends an estimate most and would not have been seen.

    Parameters
    ----------
    noise : sequence of ndarray, each shape (n_out, n)
        What the pasts leave of the outputs of each record.
    echo : ndarray, shape (order, n_out, n_out)
        By lag: what past outputs make of outputs, ``[lag, output, past output]``.
    inputs : sequence of ndarray, each shape (n_in, n_samples)
    own : ndarray, shape (order, n_in, n_in)
        By lag: what past inputs make of inputs.
    fresh : sequence of ndarray, each shape (n_in, n)
        What their pasts leave of the inputs.

    Returns
    -------
    Unseen or None
        None where no noise lives longer than a sample: what is fed back is seen whole.

    Assumes
    -------
    A controller that feeds back a multiple of one output a sample later, without its sensor's white
    noise, and an input that mostly moves by itself.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4 (the bias); Kendall & Stuart, *The
    Advanced Theory of Statistics*, volume 2 (power of F: its noncentral distribution).

    Example
    -------
    >>> u, e = np.random.default_rng(0).standard_normal((2, 1, 2000))
    >>> short, slow = np.array([[[0.5]]]), np.array([[[1.98]], [[-0.9801]]])
    >>> white = np.zeros((1, 1, 1))
    >>> bias = [unseen_feedback([e], each, [u], white, [u]).bias for each in (short, slow)]
    >>> print(f"{bias[0]:.1f} {bias[1]:.1f}")
    0.6 2.1
    """
    n = sum(int(rows.shape[1]) for rows in fresh)
    n_out = len(noise[0])
    covariance = np.sum([rows @ rows.T for rows in noise], axis=0) / n
    fed = _answers(echo, covariance)
    new = np.sum([np.sum(rows**2, axis=1) for rows in fresh], axis=0)
    whole = np.sum([np.sum(rows**2, axis=1) for rows in inputs], axis=0)
    power = np.sum(fed**2, axis=(0, 2))
    # Errors of an estimate are of all the noise, the bias of what may be fed back alone.
    carried = power / (power + np.diagonal(covariance))
    least = _noncentrality(LAGS * n_out, n, LEVEL / len(new)) / n
    moving = np.flatnonzero(new > 0.0)
    seen = {place: _whitened_power(own[:, place, place], fed) for place in moving}
    found = []
    for output in np.flatnonzero(power > np.finfo(float).tiny):
        h = fed[:, output]
        spectrum = np.sum(np.abs(np.fft.rfft(h, 2 * ECHO, axis=0)) ** 2, axis=1)
        alike = np.fft.irfft(spectrum, 2 * ECHO)
        independent = n / float(np.sum((alike / np.max(alike)) ** 2))
        for place in moving:
            part = max(float(seen[place][output]) / float(power[output]), SMALLEST)
            share = least * float(new[place] / whole[place]) / part
            times = share * float(carried[output]) * independent / LAGS
            found.append(Unseen(int(place), share, float(np.sqrt(times))))
    return max(found, key=lambda each: each.bias, default=None)


def _whitened_power(past: Array, fed: Array) -> Array:
    """Power that the first lags of answers have once an input's own past is out of them, by output.

    Parameters
    ----------
    past : ndarray, shape (order,)
        Weights of an input's own past.
    fed : ndarray, shape (n_lags, n_out, n_noise)
    """
    left = np.zeros(LAGS + 1)
    left[: len(past) + 1] = np.append(1.0, -past)[: LAGS + 1]
    kept = fed[: LAGS + 1]
    whitened = np.tril(scipy.linalg.toeplitz(left)) @ kept.reshape(len(kept), -1)
    return np.asarray(np.sum(whitened.reshape(kept.shape) ** 2, axis=(0, 2)))


def _answers(echo: Array, covariance: Array) -> Array:
    """Outputs after independent unit noise, the sample of the noise apart: (lag, output, noise)."""
    value, vector = np.linalg.eigh(covariance)
    n_out = echo.shape[1]
    weights = np.ascontiguousarray(echo.transpose(1, 0, 2).reshape(n_out, -1))
    start = vector * np.sqrt(np.maximum(value, 0.0))
    largest = GROWN * float(np.max(np.abs(start)))
    found = _native.noise_answers(weights, start, ECHO, largest)
    found[0] = 0.0
    return found


@lru_cache(maxsize=16)
def _noncentrality(numbers: int, free: int, level: float) -> float:
    """Of an F that passes its quantile by `level` with all chance but `UNSEEN`."""
    limit = float(scipy.special.fdtri(numbers, free, 1.0 - level))
    return float(scipy.special.ncfdtrinc(numbers, free, UNSEEN, limit))
