"""Intervals of a response at every frequency, with what its estimator adds taken into account."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.response import FrequencyResponse
from flightid.responses.shown import WITHOUT_BIAS
from flightid.uncertainty.magnitude import magnitude_interval
from flightid.uncertainty.quantiles import LEVEL, half_width

Real = NDArray[np.float64]
RANDOM = "random errors alone: what windows blur is not known"
TAKEN_OUT = "about the response with leakage and resolution taken out"


@dataclass(frozen=True, eq=False)
class ResponseIntervals:
    """Intervals of gain and phase of one output to one input.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    centre : ndarray of complex, shape (n_f,)
        What the intervals stand about: the response less the bias that could be foretold.
    gain : ndarray, shape (2, n_f)
        Lower and upper end, in the unit of the response; from zero where noise alone could make as
        large a one. Noise lengthens weak responses: the lower end lies further away than the upper.
    phase_rad : ndarray, shape (2, n_f)
        About the unwrapped phase of `centre`; wider than a turn where it is not known.
    reason : str
        What the intervals hold and leave out.
    """

    omega_rad_s: Real
    centre: NDArray[np.complex128]
    gain: Real
    phase_rad: Real
    reason: str

    def __repr__(self) -> str:
        """Number of frequencies and typical width on one line."""
        wide = np.median((self.gain[1] - self.gain[0]) / np.maximum(np.abs(self.centre), 1e-300))
        return f"ResponseIntervals({len(self.omega_rad_s)} frequencies, gain ±{50.0 * wide:.3g} %)"


def response_band(
    source: FrequencyResponse, inputs: str, outputs: str, *, level: float = LEVEL
) -> ResponseIntervals | None:
    """Intervals of gain and phase at every frequency of a measured response.

    Windows and local polynomials blur modes and leak at low frequency, which can be many times the
    random error. A pilot model foretells that bias, and the intervals stand about the response less
    it, `FrequencyResponse.shown`: near a mode they need not hold what the windows gave.

    Parameters
    ----------
    source : FrequencyResponse
    inputs, outputs : str
        The pair.
    level : float
        Probability that one interval holds the truth.

    Returns
    -------
    ResponseIntervals or None
        None where no errors are known.

    Raises
    ------
    UnknownNameError
        There is no such channel.

    Assumes
    -------
    A vehicle that a rational response of order ten comes near to, and noise that does not reach the
    inputs: with a loop closed a direct estimate is biased, and so is its band. After arithmetic or
    from a file, where the records are gone, intervals hold random errors alone, as `reason` says.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., sections
    2.4 and 6.7.

    Example
    -------
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(4000)
    >>> record = fid.Record.from_arrays(np.arange(4000) / 100, inputs={"u": u},
    ...                                 outputs={"y": np.convolve(u, [0.5, 0.5])[:4000]})
    >>> response = fid.estimate_response(record, band_rad_s=(2.0, 50.0), n_omega=20)
    >>> band = fid.response_band(response, "u", "y")
    >>> truth = 0.5 + 0.5 * np.exp(-1j * band.omega_rad_s / 100)
    >>> bool(np.all(np.abs(band.gain - np.abs(truth)) < 1e-7))
    True
    >>> held = (band.gain[0] <= np.abs(truth)) & (np.abs(truth) <= band.gain[1])
    >>> bool(np.mean(held) >= 0.9)
    True
    """
    return response_bands(source, [(outputs, inputs)], level=level)[outputs, inputs]


def response_bands(
    source: FrequencyResponse, pairs: Sequence[tuple[str, str]], *, level: float = LEVEL
) -> dict[tuple[str, str], ResponseIntervals | None]:
    """Intervals of several pairs, those of one input worked out together; see `response_band`.

    Parameters
    ----------
    source : FrequencyResponse
    pairs : sequence of (str, str)
        Output and input of each.
    level : float

    Returns
    -------
    dict of (str, str) to ResponseIntervals or None
        By pair, in their order.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    """
    outputs, inputs = (tuple(dict.fromkeys(pair[side] for pair in pairs)) for side in (0, 1))
    whole = set(inputs) == set(source.inputs)
    known = (source if whole else source.select(outputs=outputs, inputs=inputs)).shown
    return {pair: _intervals(known, *pair, level) for pair in pairs}


def _intervals(
    shown: FrequencyResponse, output: str, source: str, level: float
) -> ResponseIntervals | None:
    known = shown.select(outputs=[output], inputs=[source])
    corrected = known.estimator.endswith(WITHOUT_BIAS) and bool(np.any(known.coherence > 0.0))
    reason = TAKEN_OUT if corrected else RANDOM
    centre = known.response[0, 0]
    spread = spread_of(known)
    if spread is None:
        return None
    across = half_width(level) * spread[1]
    size = np.abs(centre)
    phase = np.unwrap(np.angle(centre))
    gain = magnitude_interval(size, *spread, level=level)
    # Where noise alone makes as much, no direction is known: half of all would be behind.
    known_at = (gain[0] > 0.0) & (across < size)
    turned = np.where(known_at, np.arcsin(np.minimum(across / size, 1.0)), np.pi)
    return ResponseIntervals(
        known.omega_rad_s,
        centre,
        gain,
        np.stack([phase - turned, phase + turned]),
        reason,
    )


def spread_of(known: FrequencyResponse) -> Real | None:
    """Standard errors along and across the response of one pair, shape (2, n_f), or None."""
    values = known.response[0, 0]
    if known.errors is None:
        error = known.random_error[0, 0]
        return np.stack([np.abs(values) * error] * 2) if np.any(error > 0.0) else None
    n = len(values)
    matrix = known.covariance_at(known.omega_rad_s)[0]
    places = np.arange(n)
    real, imaginary = matrix[places, places], matrix[places + n, places + n]
    both = matrix[places, places + n]
    c, s = np.cos(np.angle(values)), np.sin(np.angle(values))
    along = c**2 * real + s**2 * imaginary + 2.0 * c * s * both
    across = s**2 * real + c**2 * imaginary - 2.0 * c * s * both
    return np.asarray(np.sqrt(np.maximum(np.stack([along, across]), 0.0)))
