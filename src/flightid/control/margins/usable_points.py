"""Which points of a measured loop are read: those of the widest band that keeps its coherence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.identification.frequency_domain.steady_coherence import steady_coherence
from flightid.responses import FrequencyResponse
from flightid.responses.bands import COHERENT, usable_band

LEAST_POINTS = 3
"""Fewer do not show how a loop turns."""
Array = NDArray[np.float64]
Band = tuple[float, float]


def read_band(pair: FrequencyResponse) -> Band:
    """Widest unbroken band in which the coherence of one pair is no doubt of its crossings.

    What noise makes of a response passes the unit circle and turns about −1 as often as it likes.

    Parameters
    ----------
    pair : FrequencyResponse
        One input and one output, as measured.

    Returns
    -------
    tuple of float
        Lowest and highest frequency that is read, rad/s.

    Raises
    ------
    DataError
        Fewer than three neighbouring frequencies are coherent.

    Example
    -------
    >>> omega = [1.0, 2.0, 3.0, 4.0]
    >>> known = dict(inputs=["u"], outputs=["y"], coherence=[0.9, 0.9, 0.8, 0.1])
    >>> read_band(FrequencyResponse.from_values(omega, [4.0, 2.0, 1.0, 0.5], **known))
    (1.0, 3.0)
    """
    return _coherent(pair.omega_rad_s, pair.coherence[0, 0], pair.random_error[0, 0])


def read_band_of_all(response: FrequencyResponse) -> Band:
    """The same of several pairs: where the inputs together explain each output.

    A pair that hardly couples has no coherence of its own, and need not.

    Parameters
    ----------
    response : FrequencyResponse
        As measured.

    Raises
    ------
    DataError
        Fewer than three neighbouring frequencies are coherent.

    Example
    -------
    >>> omega = [1.0, 2.0, 3.0, 4.0]
    >>> known = dict(inputs=["u"], outputs=["y"], coherence=[0.9, 0.9, 0.8, 0.1])
    >>> read_band_of_all(FrequencyResponse.from_values(omega, [4.0, 2.0, 1.0, 0.5], **known))
    (1.0, 3.0)
    """
    least = np.min(response.multiple_coherence, axis=0)
    return _coherent(response.omega_rad_s, least, np.min(response.random_error, axis=(0, 1)))


def _coherent(omega: Array, coherence: Array, error: Array) -> Band:
    # A point without any coherence has no error that chance could explain: it stands as it is.
    known = steady_coherence(omega, coherence, np.where(np.isfinite(error), error, 0.0))
    band = usable_band(omega, known)
    if band is not None:
        # Neighbours tell what chance made of a point between them, not where coherence ends.
        own = omega[_inside(omega, band) & (coherence >= COHERENT)]
        band = (float(own[0]), float(own[-1])) if own.size else None
    found = 0 if band is None else int(np.count_nonzero(_inside(omega, band)))
    if band is None or found < LEAST_POINTS:
        raise DataError(
            "too few coherent frequencies to find margins",
            found=f"{found} neighbours of coherence {COHERENT:g} or more, of {len(omega)}",
            needed="three or more",
            action="excite the band of the crossover better, or fit a model",
        )
    return band


def unread(omega: Array, band: Band) -> str:
    """What is not read and why, empty where all is.

    Parameters
    ----------
    omega : ndarray, shape (n_f,)
        Frequencies that were measured, rad/s.
    band : tuple of float
        Of `read_band`.

    Example
    -------
    >>> unread(np.array([1.0, 2.0, 3.0]), (1.0, 2.0))
    'not read: coherence falls below 0.6 beyond 2 rad/s'
    """
    low, high = band
    if low <= omega[0] and high >= omega[-1]:
        return ""
    place = f"beyond {high:.3g}"
    if low > omega[0]:
        place = f"beyond {low:.3g} to {high:.3g}" if high < omega[-1] else f"under {low:.3g}"
    return f"not read: coherence falls below {COHERENT:g} {place} rad/s"


def _inside(omega: Array, band: Band) -> NDArray[np.bool_]:
    return np.asarray((omega >= band[0]) & (omega <= band[1]))
