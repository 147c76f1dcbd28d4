"""Local polynomial least squares over neighbouring Fourier bins of whole records.

Over a few neighbouring bins a response and the leakage of a record's ends are both smooth, so low
polynomials stand for them. What the polynomials leave is noise, free of leakage.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

ORDER = 2
"""Degree of the local polynomials of response and leakage."""
SPARE = 1.6
"""Equations for each unknown in a local fit, before `SPARE_BINS`."""
SPARE_BINS = 8
RANK_TOLERANCE = 1e-9
CLEAR_RANK = 1e-5
"""Least part of a column that others leave, over its length, from which no rank is in doubt."""
AT_ONCE = 256
"""Groups of bins that are worked on at a time, to bound memory."""


@dataclass(frozen=True)
class Bins:
    """Fourier bins of one record, scaled so that noise has the variance of its one-sided PSD.

    Attributes
    ----------
    omega : ndarray, shape (n_bins,)
        Frequencies of the bins between zero and the Nyquist frequency, rad/s.
    values : ndarray of complex, shape (n_channels, n_bins)
    """

    omega: NDArray[np.float64]
    values: NDArray[np.complex128]

    @classmethod
    def of(cls, samples: NDArray[np.float64], sample_time_s: float) -> Bins:
        """Bins of a record, shape (n_channels, n_samples); zero and Nyquist are left out."""
        n = samples.shape[1]
        values = np.fft.rfft(samples, axis=1)[:, 1 : (n - 1) // 2 + 1]
        omega = 2.0 * np.pi * np.arange(1, values.shape[1] + 1) / (n * sample_time_s)
        return cls(omega, values * math.sqrt(2.0 * sample_time_s / n))


@dataclass(frozen=True)
class LocalFit:
    """Least squares at one frequency.

    Attributes
    ----------
    gain : ndarray of complex, shape (n_in, n_out)
        Response at the frequency itself.
    weights : tuple of ndarray of complex, each shape (n_in, bins of the record)
        The gain is the weights times the outputs' bins: what covariances are made of.
    places : tuple of slice
        Bins used, for each record.
    residual : ndarray of complex, shape (n_out, n_out)
        Noise spectrum, one-sided, conjugate on the first index, corrected for the unknowns.
    freedom : float
        Complex equations less unknowns.
    full_rank : bool
        Whether the inputs could be told apart.
    """

    gain: NDArray[np.complex128]
    weights: tuple[NDArray[np.complex128], ...]
    places: tuple[slice, ...]
    residual: NDArray[np.complex128]
    freedom: float
    full_rank: bool

    @property
    def n_bins(self) -> int:
        """Bins used, all records together."""
        return sum(place.stop - place.start for place in self.places)


def bins_needed(n_inputs: int, n_records: int, order: int = ORDER) -> int:
    """Bins of each record that a local fit takes."""
    unknowns = (order + 1) * (n_inputs + n_records)
    return math.ceil((SPARE * unknowns + SPARE_BINS) / n_records)


def around(bins: Bins, omega: float, count: int) -> slice:
    """The `count` bins nearest to a frequency; fewer where the record has fewer."""
    size = len(bins.omega)
    count = min(count, size)
    middle = round((omega - bins.omega[0]) / (bins.omega[1] - bins.omega[0]))
    start = min(max(middle - count // 2, 0), size - count)
    return slice(start, start + count)


def fit_locally(
    records: Sequence[Bins],
    places: Sequence[slice],
    omega: float,
    n_inputs: int,
    order: int = ORDER,
) -> LocalFit:
    """Fit one response polynomial for all records and one leakage polynomial for each.

    Parameters
    ----------
    records : sequence of Bins
        Inputs first, then outputs.
    places : sequence of slice
        Bins of each record that take part.
    omega : float
        Frequency at which the response is wanted, rad/s.
    n_inputs : int
    order : int

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., section
    7.2 (equations 7-8 to 7-16).
    """
    width = max(
        float(np.max(np.abs(bins.omega[place] - omega)))
        for bins, place in zip(records, places, strict=True)
    )
    left, right = [], []
    # Records of one length share their bins, and so their polynomials.
    shared: dict[tuple[float, int, int], tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
    for bins, place in zip(records, places, strict=True):
        key = (float(bins.omega[0]), place.start, place.stop)
        if key not in shared:
            distance = (bins.omega[place] - omega) / width
            powers = distance[:, None] ** np.arange(order + 1)
            shared[key] = powers, np.linalg.qr(powers)[0]
        powers, basis = shared[key]
        values = bins.values[:, place].T
        regressors = (values[:, :n_inputs, None] * powers[:, None, :]).reshape(len(values), -1)
        left.append(regressors - basis @ (basis.T @ regressors))
        outputs = values[:, n_inputs:]
        right.append(outputs - basis @ (basis.T @ outputs))
    matrix, target = np.concatenate(left), np.concatenate(right)
    norms = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    u, s, vh = np.linalg.svd(matrix / norms, full_matrices=False)
    rank = int(np.sum(s > RANK_TOLERANCE * s[0]))
    inverse = (vh[:rank].conj().T / s[:rank]) @ u[:, :rank].conj().T / norms[:, None]
    remains = target - u[:, :rank] @ (u[:, :rank].conj().T @ target)
    freedom = max(len(target) - rank - len(records) * (order + 1), 1)
    at_centre = inverse[:: order + 1]
    edges = np.cumsum([len(one) for one in left])[:-1]
    return LocalFit(
        at_centre @ target,
        tuple(np.split(at_centre, edges, axis=1)),
        tuple(places),
        remains.conj().T @ remains / freedom,
        float(freedom),
        rank == matrix.shape[1],
    )


def local_residuals(
    records: Sequence[Bins], groups: Sequence[slice], n_inputs: int, order: int = ORDER
) -> list[NDArray[np.complex128] | None]:
    """`LocalFit.residual` of many groups of as many bins each, of records of one length.

    Bins of all groups lie alike about their middle: one projection takes the leakage out of all.

    Returns
    -------
    list of ndarray of complex or None
        None where inputs might not be told apart: the group is for `fit_locally`.
    """
    if not groups:
        return []
    count = groups[0].stop - groups[0].start
    powers = np.linspace(-1.0, 1.0, count)[:, None] ** np.arange(order + 1)
    left = np.linalg.qr(powers, mode="complete")[0][:, order + 1 :]
    of_inputs = (powers[:, :, None] * left[:, None]).reshape(count, -1)
    rows, columns = len(records) * (count - order - 1), n_inputs * (order + 1)
    freedom = max(rows - columns, 1)
    found: list[NDArray[np.complex128] | None] = []
    for first in range(0, len(groups), AT_ONCE):
        some = groups[first : first + AT_ONCE]
        places = np.concatenate([np.arange(place.start, place.stop) for place in some])
        values = np.stack([bins.values[:, places] for bins in records])
        values = values.reshape(len(records), -1, len(some), count).transpose(2, 0, 3, 1)
        # Group, record, bin, channel: real matrices act on bins.
        inputs = np.tensordot(values[..., :n_inputs], of_inputs, axes=(2, 0))
        inputs = inputs.reshape(*inputs.shape[:3], order + 1, -1).transpose(0, 1, 4, 2, 3)
        outputs = np.tensordot(values[..., n_inputs:], left, axes=(2, 0)).transpose(0, 1, 3, 2)
        matrix = inputs.reshape(len(some), rows, columns)
        norms = np.linalg.norm(matrix, axis=1, keepdims=True)
        matrix = matrix / np.maximum(norms, np.finfo(float).tiny)
        joined = np.concatenate([matrix, outputs.reshape(len(some), rows, -1)], axis=2)
        triangle = np.asarray(np.linalg.qr(joined, mode="r"))
        clear = np.min(np.abs(np.diagonal(triangle, 0, 1, 2)[:, :columns]), axis=1) > CLEAR_RANK
        rest = triangle[:, columns:, columns:]
        residual = rest.conj().transpose(0, 2, 1) @ rest / freedom
        found += [one if sure else None for one, sure in zip(residual, clear, strict=True)]
    return found
