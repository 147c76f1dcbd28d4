"""Responses at the harmonics of inputs that repeat: whole periods, so their power leaks nowhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.record import Record
from flightid.record.history import Step
from flightid.record.repeats import found_period
from flightid.responses.estimators.local_polynomial import response_of_fits
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.local_fit import RANK_TOLERANCE, Bins, LocalFit
from flightid.responses.windows.samples import Samples

UNSETTLED = "periods-unsettled"
WHOLE = 1e-3
"""Samples by which a period may miss a whole number of them."""
BESIDE = 3
"""Bins between harmonics, on each side of one, that tell its transient and its noise."""
DEGREE = 2
EXCITED = 1e-4
"""Least power of an excited harmonic over that of the strongest."""
CLEAR = 10.0
"""Least power of an excited harmonic over that of the bins beside it."""


FEWEST_PERIODS, FEWEST_HARMONICS = 3, 10
"""Periods of every record, and harmonics in the band, from which on the estimator is chosen by
itself: two periods do not tell whether a start has died out."""
COLOURED = 4.0
"""Samples of noise for each independent one, as the test of a start takes it."""
ROUNDING = 1e-15
"""Share of an output's power below which periods are the same."""
STARTING = 0.01
"""Chance of calling a settled period a start."""


def estimate_repeating(
    samples: Samples,
    records: Sequence[Record],
    omega: NDArray[np.float64],
    step: Step,
    *,
    covariance: bool,
) -> FrequencyResponse | None:
    """The estimate at harmonics where all inputs repeat exactly and have settled; else None."""
    lengths = {found_period(rows) for rows in samples.part("inputs")}
    length = next(iter(lengths)) if len(lengths) == 1 else None
    if length is None:
        return None
    if min(record.shape[1] // length for record in samples.records) < FEWEST_PERIODS:
        return None
    period_s = length * samples.sample_time_s
    told = [record.declare(period_s=period_s) for record in records]
    try:
        found = estimate_periodic(samples, told, omega, step, covariance=covariance)
    except DataError:
        return None
    unsettled = any(each.code == UNSETTLED for each in found.findings)
    return None if unsettled or found.n_frequencies < FEWEST_HARMONICS else found


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
    cut, periods, settling = _whole_periods(samples, records)
    bins = [Bins.of(record, cut.sample_time_s) for record in cut.records]
    n_in = len(cut.inputs)
    chosen = _harmonics(bins, periods, n_in, omega)
    fits = [_fit(bins, periods, harmonic, cut.inputs) for harmonic in chosen]
    base = bins[0].omega[periods[0] - 1]
    response = response_of_fits(
        cut,
        base * chosen,
        bins,
        fits,
        step,
        covariance,
        estimator="periodic",
        n_independent=float(sum(periods)),
    )
    return replace(response, findings=(*response.findings, settling))


def _whole_periods(
    samples: Samples, records: Sequence[Record]
) -> tuple[Samples, list[int], Finding]:
    """The last whole periods of each record that have settled, how many, and what was dropped."""
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
    outputs = samples.rows("outputs")
    starts = [
        starting_periods(record[outputs, -count * length :], length)
        for record, count in zip(samples.records, periods, strict=True)
    ]
    settles = all(start is not None for start in starts)
    dropped = [start or 0 for start in starts] if settles else [0] * len(starts)
    periods = [count - start for count, start in zip(periods, dropped, strict=True)]
    kept = [
        record[:, -count * length :] for record, count in zip(samples.records, periods, strict=True)
    ]
    centred = tuple(each - each.mean(axis=1, keepdims=True) for each in kept)
    finding = _settling(length * samples.sample_time_s, periods, dropped, settles=settles)
    return replace(samples, records=centred), periods, finding


def starting_periods(outputs: NDArray[np.float64], length: int) -> int | None:
    """Periods at the beginning in which a start has not died out; None where it never does.

    Differences of neighbouring periods hold noise alone once it has: as long as one is larger than
    the last, by an F test, its first period is dropped.

    Parameters
    ----------
    outputs : ndarray, shape (n_out, n_periods · length)
    length : int
        Samples of a period.

    Returns
    -------
    int or None
        0 for two periods, of which there is one difference: nothing to compare.

    Example
    -------
    >>> settled = np.tile(np.sin(np.arange(50)), 5)[None]
    >>> start = np.exp(-np.arange(250) / 20)
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(250)
    >>> starting_periods(settled + noise, 50), starting_periods(settled + start + noise, 50)
    (0, 2)
    """
    parts = outputs.reshape(len(outputs), -1, length)
    power = np.mean(np.diff(parts, axis=1) ** 2, axis=2)
    power = np.maximum(power, ROUNDING * np.var(outputs, axis=1)[:, None])
    freedom = max(length / COLOURED, 2.0)
    ratio = power / np.maximum(power[:, -1:], np.finfo(float).tiny)
    large = np.any(scipy.special.fdtrc(freedom, freedom, ratio) < STARTING / len(outputs), axis=0)
    moving = np.flatnonzero(large)
    dropped = int(moving[-1]) + 1 if len(moving) else 0
    return None if parts.shape[1] - dropped < FEWEST_PERIODS and dropped else dropped


def _settling(
    period_s: float, periods: Sequence[int], dropped: Sequence[int], *, settles: bool
) -> Finding:
    what = (
        f"inputs repeat every {period_s:.4g} s: response at their harmonics, free of leakage, from "
        f"{', '.join(map(str, periods))} whole periods"
    )
    if not settles:
        return Finding(
            UNSETTLED,
            Light.AMBER,
            f"{what}; in them a start has not died out",
            "fly more periods, or leave the first ones out",
        )
    if any(dropped):
        what += f"; {', '.join(map(str, dropped))} before them left out, where a start dies out"
    return Finding("periodic", Light.GREEN, what)


def _harmonics(
    bins: Sequence[Bins], periods: Sequence[int], n_in: int, omega: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Numbers of the excited harmonics nearest to the wanted frequencies."""
    last = min((len(b.omega) - BESIDE - 1) // p for b, p in zip(bins, periods, strict=True))
    first = -(-(BESIDE + 2) // min(periods))
    if last < first:
        raise DataError(
            "the period has no harmonic with room beside it",
            found=f"{max(periods)} periods in a record of {2 * len(bins[0].omega)} samples",
            needed="periods of many samples",
            action="check period_s, or excite below the Nyquist frequency",
        )
    base = bins[0].omega[periods[0] - 1]
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
