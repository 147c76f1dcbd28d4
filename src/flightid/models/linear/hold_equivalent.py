"""What a continuous system with delays does between the samples of a held input, exactly."""

from __future__ import annotations

from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
Hold = Literal["zero", "first"]
WHOLE = 1e-9
"""Fraction of a sample below which a delay is a whole number of samples."""


def hold_equivalent(
    matrices: tuple[Array, Array, Array, Array, Array], sample_time_s: float, hold: Hold
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D in discrete time of a continuous system, its delays turned into states.

    Parameters
    ----------
    matrices : tuple of ndarray
        A (n, n), B (n, m), C (p, n), D (p, m) and the delay of each input (m,), s, none negative.
    sample_time_s : float
        T, s, positive.
    hold : {"zero", "first"}
        Inputs are steps or straight lines between samples. With ``"first"`` and a delay below a
        sample the next sample acts at once: the state is then the system's less that part.

    Returns
    -------
    tuple of ndarray
        The states of the system first, then the past samples of the inputs that act later.

    Reference
    ---------
    Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., sections 4.3.3
    (delays) and 6.3 (first-order hold); Van Loan, *IEEE Trans. Automatic Control* 23 (1978).

    Example
    -------
    >>> one = np.ones((1, 1))
    >>> a, b, c, d = hold_equivalent((-one, one, one, 0 * one, np.zeros(1)), 0.1, "zero")
    >>> round(float(b[0, 0]), 6)
    0.095163
    """
    a, b, c, d, delays_s = matrices
    n, m = b.shape
    taps = [_taps(a, b[:, j], d[:, j], delays_s[j], sample_time_s, hold) for j in range(m)]
    memory = [max((lag for lag, *_ in each), default=0) for each in taps]
    starts = n + np.concatenate([[0], np.cumsum(memory)]).astype(int)
    size = int(starts[-1])
    transition, forced = np.zeros((size, size)), np.zeros((size, m))
    seen, direct = np.zeros((len(c), size)), np.zeros((len(c), m))
    transition[:n, :n], seen[:, :n] = scipy.linalg.expm(a * sample_time_s), c
    for j, each in enumerate(taps):
        for place in range(memory[j]):
            row = starts[j] + place
            if place:
                transition[row, row - 1] = 1.0
            else:
                forced[row, j] = 1.0
        for lag, state, output in each:
            if lag < 0:
                # x = ξ + w u: the sample ahead becomes the present one of the next step.
                forced[:n, j] += transition[:n, :n] @ state
                direct[:, j] += c @ state
            elif lag:
                transition[:n, starts[j] + lag - 1] += state
                seen[:, starts[j] + lag - 1] += output
            else:
                forced[:n, j] += state
                direct[:, j] += output
    return transition, forced, seen, direct


def _taps(
    a: Array, b: Array, d: Array, delay_s: float, step: float, hold: Hold
) -> list[tuple[int, Array, Array]]:
    """Lag in samples, weights on the next state and on the output, of one input."""
    samples = delay_s / step
    whole = int(np.floor(samples + WHOLE))
    part = samples - whole
    part = 0.0 if abs(part) < WHOLE else part
    moved, early = _integrals(a, b, part * step), _integrals(a, b, (1.0 - part) * step)
    later = scipy.linalg.expm(a * (1.0 - part) * step)
    first, first_ramp = later @ moved[0], later @ moved[1] / step
    last, last_ramp = early[0], early[1] / step
    none = np.zeros_like(d)
    if hold == "zero":
        taps = [(whole, last, none if part else d), (whole + 1, first, d if part else none)]
    else:
        taps = [
            (whole - 1, last_ramp, none),
            (whole, last - last_ramp + (1.0 - part) * first + first_ramp, (1.0 - part) * d),
            (whole + 1, part * first - first_ramp, part * d),
        ]
    return [tap for tap in taps if np.any(tap[1]) or np.any(tap[2])]


def _integrals(a: Array, b: Array, duration: float) -> tuple[Array, Array]:
    """∫ e^(A(h−s)) b ds and ∫ e^(A(h−s)) b s ds from 0 to h."""
    n = len(a)
    if duration == 0.0:
        return np.zeros(n), np.zeros(n)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n], block[n, n + 1] = a, b, 1.0
    found = scipy.linalg.expm(block * duration)
    return found[:n, n], found[:n, n + 1]
