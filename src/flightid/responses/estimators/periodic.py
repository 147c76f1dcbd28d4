"""Responses at the harmonics of inputs that repeat: whole periods, so their power leaks nowhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.record import Record
from flightid.record.history import Step
from flightid.responses.estimators.local_polynomial import response_of_fits
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.local_fit import RANK_TOLERANCE, Bins, LocalFit
from flightid.responses.windows.samples import Samples

WHOLE = 1e-3
"""Samples by which a period may miss a whole number of them."""
BESIDE = 3
"""Bins between harmonics, on each side of one, that tell its transient and its noise."""
DEGREE = 2
EXCITED = 1e-4
"""Least power of an excited harmonic over that of the strongest."""
CLEAR = 10.0
"""Least power of an excited harmonic over that of the bins beside it."""


def estimate_periodic(
    samples: Samples,
    records: Sequence[Record],
    omega: NDArray[np.float64],
    step: Step,
    *,
    covariance: bool,
) -> FrequencyResponse:
    """Responses at those excited harmonics that lie nearest to the wanted frequencies.

    Between harmonics there is the transient of a start and noise, both smooth and random: a
    polynomial through the bins beside a harmonic takes the first away and leaves the second.

    Raises
    ------
    DataError
        No period, fewer than two whole ones in a record, or inputs that cannot be told apart.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., §7.3.
    """
    cut, periods = _whole_periods(samples, records)
    bins = [Bins.of(record, cut.sample_time_s) for record in cut.records]
    n_in = len(cut.inputs)
    chosen = _harmonics(bins, periods, n_in, omega)
    fits = [_fit(bins, periods, harmonic, cut.inputs) for harmonic in chosen]
    base = bins[0].omega[periods[0] - 1]
    return response_of_fits(
        cut,
        base * chosen,
        bins,
        fits,
        step,
        covariance,
        estimator="periodic",
        n_independent=float(sum(periods)),
    )


def _whole_periods(samples: Samples, records: Sequence[Record]) -> tuple[Samples, list[int]]:
    """The last whole periods of each record, and how many."""
    known = {record.period_s for record in records}
    period_s = next(iter(known)) if len(known) == 1 else None
    if period_s is None:
        raise DataError(
            "the records have no common period",
            found=", ".join(str(each) for each in known),
            needed="inputs that repeat, all by the same period_s",
            action="declare period_s=… of the record, or use another estimator",
        )
    size = period_s / samples.sample_time_s
    if abs(size - round(size)) > WHOLE:
        raise DataError(
            "the period is no whole number of samples",
            found=f"{size:.4f}",
            needed="a whole number",
            action="resample the records to a divisor of the period",
        )
    length = round(size)
    periods = [record.shape[1] // length for record in samples.records]
    if min(periods) < 2:
        raise DataError(
            "a record holds fewer than two whole periods",
            found=f"{min(periods)} of {period_s:.4g} s",
            needed="2 or more in each record: between harmonics the noise is read",
            action="fly longer, or use estimator='local_polynomial'",
        )
    kept = [
        record[:, -count * length :] for record, count in zip(samples.records, periods, strict=True)
    ]
    centred = tuple(each - each.mean(axis=1, keepdims=True) for each in kept)
    return replace(samples, records=centred), periods


def _harmonics(
    bins: Sequence[Bins], periods: Sequence[int], n_in: int, omega: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Numbers of the excited harmonics nearest to the wanted frequencies."""
    base = bins[0].omega[periods[0] - 1]
    last = min((len(b.omega) - BESIDE - 1) // p for b, p in zip(bins, periods, strict=True))
    first = -(-(BESIDE + 2) // min(periods))
    numbers = np.arange(first, last + 1)
    power, beside = np.zeros(len(numbers)), np.zeros(len(numbers))
    for one, count in zip(bins, periods, strict=True):
        square = np.sum(np.abs(one.values[:n_in]) ** 2, axis=0)
        power += square[numbers * count - 1]
        beside += 0.5 * (square[numbers * count - 2] + square[numbers * count])
    clear = (power > EXCITED * power.max(initial=0.0)) & (power > CLEAR * beside)
    inside = (numbers * base >= omega[0] - 0.5 * base) & (numbers * base <= omega[-1] + 0.5 * base)
    near = numbers[clear & inside]
    if not len(near):
        raise DataError(
            "no harmonic is excited in the band",
            found=f"{omega[0]:.3g} to {omega[-1]:.3g} rad/s",
            needed=f"power at multiples of {base:.4g} rad/s",
            action="check period_s, or widen the band",
        )
    return np.unique(near[np.argmin(np.abs(near[:, None] * base - omega), axis=0)])


def _fit(
    bins: Sequence[Bins], periods: Sequence[int], harmonic: int, inputs: Sequence[str]
) -> LocalFit:
    n_in = len(inputs)
    places, shares, excitation, target, spread = [], [], [], [], []
    noise, freedom = np.zeros((len(bins[0].values) - n_in,) * 2, dtype=np.complex128), 0.0
    for one, count in zip(bins, periods, strict=True):
        middle = int(harmonic) * count - 1
        reach = BESIDE if count > BESIDE else BESIDE + BESIDE // (count - 1)
        place = slice(max(middle - reach, 0), min(middle + reach + 1, len(one.omega)))
        offset = np.arange(place.start, place.stop) - middle
        between = np.flatnonzero((place.start + np.arange(len(offset)) + 1) % count != 0)
        powers = (offset[between, None] / reach) ** np.arange(DEGREE + 1)
        smooth = np.linalg.pinv(powers)
        share = (offset == 0).astype(np.float64)
        share[between] -= smooth[0]
        values = one.values[:, place]
        left = values[n_in:, between] - (values[n_in:, between] @ smooth.T) @ powers.T
        noise += left.conj() @ left.T
        freedom += len(between) - DEGREE - 1
        places.append(place)
        shares.append(share)
        excitation.append(values[:n_in] @ share)
        target.append(values[n_in:] @ share)
        spread.append(float(share @ share))
    matrix = np.array(excitation) / np.sqrt(spread)[:, None]
    scale = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    if np.linalg.matrix_rank(matrix / scale, tol=RANK_TOLERANCE) < n_in:
        raise DataError(
            f"inputs {', '.join(inputs)} cannot be told apart at a harmonic",
            found=f"{len(bins)} records with dependent inputs at harmonic {harmonic}",
            needed="as many records as inputs, each with another combination of them",
            action="fly one record an input, or use estimator='local_polynomial'",
        )
    solved = np.linalg.pinv(matrix / scale) / scale[:, None] / np.sqrt(spread)
    weights = tuple(solved[:, k, None] * share for k, share in enumerate(shares))
    return LocalFit(
        (solved @ np.array(target)), weights, tuple(places), noise / freedom, freedom, True
    )
