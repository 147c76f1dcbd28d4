"""Frequency responses against SciPy: 4 inputs, 9 outputs, 12 records, 5 windows, 200 frequencies.

SciPy has no transform at log-spaced frequencies; its peer here is `scipy.signal.csd`'s own recipe,
vectorised: all windows of all channels through one `scipy.fft.rfft`, then spectra at the bins (so
it answers at other frequencies, and fewer of them at the low end). The exact peer is the same sum
as a plain matrix product in NumPy, at the same frequencies; deviations are from that.

Times are processor time of one thread, which other work on the machine does not lengthen.

Measured on one core of a 2.6 GHz EPYC that was shared with other work: plain complex matrix
product 0.54 to 0.60 s, folded real products alone 0.21 to 0.24 s, FFTs of the windows at their own
bins 0.14 to 0.21 s. Zero-padded FFTs, before any interpolation between bins, 0.13 s at 1.25 and 1.5
times the length and 0.18 s at twice. On a busy core with AVX-512, of rows halved again and again
(ours): halving records 8 ms, rows 46, products of matrices 43, spectra of transforms 15.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from collections.abc import Callable

import numpy as np
import scipy.fft
from numpy.lib.stride_tricks import sliding_window_view

from flightid import FrequencyResponse, Record, Table, estimate_response
from flightid.responses.spectra import average_spectra
from flightid.responses.windows.halving import Halves
from flightid.responses.windows.transform import FoldedBasis, WindowPlan
from flightid.table import Column

N_INPUTS, N_OUTPUTS, N_RECORDS, N_SAMPLES, N_FREQUENCIES = 4, 9, 12, 10_000, 200
SAMPLE_TIME_S = 0.01
LENGTHS = (5000, 2940, 1740, 1020, 600)
REPEATS = 3


def make_samples() -> list[np.ndarray]:
    """Noise in all channels of each record."""
    rng = np.random.default_rng(0)
    return [rng.standard_normal((N_INPUTS + N_OUTPUTS, N_SAMPLES)) for _ in range(N_RECORDS)]


def _omega() -> np.ndarray:
    return np.geomspace(0.3, 125.0, N_FREQUENCIES)


def _ours(records: list[np.ndarray]) -> list[np.ndarray]:
    found, halves = [], [Halves(record) for record in records]
    for length in LENGTHS:
        basis = FoldedBasis.of(WindowPlan(length, 2), _omega() * SAMPLE_TIME_S)
        found.append(average_spectra(halves, basis, SAMPLE_TIME_S).matrix)
    return found


def _exact(records: list[np.ndarray]) -> list[np.ndarray]:
    found = []
    for length in LENGTHS:
        plan = WindowPlan(length, 2)
        basis = plan.taper() * np.exp(
            -1j * np.multiply.outer(_omega() * SAMPLE_TIME_S, np.arange(length))
        )
        total, count = 0.0, 0
        for record in records:
            windows = sliding_window_view(record, length, axis=1)[:, :: plan.hop]
            spectra = np.tensordot(basis, windows, axes=(1, 2))
            total = total + spectra.conj() @ spectra.transpose(0, 2, 1)
            count += windows.shape[1]
        found.append(total * 2 * SAMPLE_TIME_S / (3 / 8 * length * count))
    return found


def _scipy(records: list[np.ndarray]) -> list[np.ndarray]:
    found = []
    for length in LENGTHS:
        plan = WindowPlan(length, 2)
        total, count = 0.0, 0
        for record in records:
            windows = sliding_window_view(record, length, axis=1)[:, :: plan.hop] * plan.taper()
            spectra = scipy.fft.rfft(windows, axis=2).transpose(2, 0, 1)
            total = total + spectra.conj() @ spectra.transpose(0, 2, 1)
            count += windows.shape[1]
        found.append(total * 2 * SAMPLE_TIME_S / (3 / 8 * length * count))
    return found


def flights(records: list[np.ndarray]) -> list[Record]:
    """The samples as records."""
    time_s = np.arange(N_SAMPLES) * SAMPLE_TIME_S
    return [
        Record.from_arrays(
            time_s,
            inputs={f"u{k}": record[k] for k in range(N_INPUTS)},
            outputs={f"y{k}": record[N_INPUTS + k] for k in range(N_OUTPUTS)},
        )
        for record in records
    ]


def estimate(made: list[Record], **options: bool) -> FrequencyResponse:
    """The verb over all windows and frequencies."""
    windows = [length * SAMPLE_TIME_S for length in LENGTHS]
    return estimate_response(made, omega_rad_s=_omega(), window_s=windows, **options)


def _whole(records: list[np.ndarray], *, covariance: bool, points: bool = False) -> float:
    """Least seconds of the verb, of records nobody has looked at."""
    times = []
    for _ in range(REPEATS):
        made = flights(records)
        start = time.process_time()
        response = estimate(made, covariance=covariance)
        if points:
            response.covariance_at(np.geomspace(0.5, 100.0, 20))
        times.append(time.process_time() - start)
    return min(times)


def _best(work: Callable[[], object]) -> tuple[float, object]:
    times, found = [], None
    for _ in range(REPEATS):
        start = time.process_time()
        found = work()
        times.append(time.process_time() - start)
    return min(times), found


def run() -> Table:
    """Measure and compare."""
    records = make_samples()
    ours_s, ours = _best(lambda: _ours(records))
    exact_s, exact = _best(lambda: _exact(records))
    scipy_s, _ = _best(lambda: _scipy(records))
    deviation = max(
        float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in zip(ours, exact, strict=True)
    )
    whole_s = _whole(records, covariance=False)
    errors_s = _whole(records, covariance=True)
    covariance_s = _whole(records, covariance=True, points=True)
    rows = (
        ("spectra, flightid", ours_s, 1.0, deviation),
        ("spectra, plain matrix product", exact_s, exact_s / ours_s, 0.0),
        ("spectra at bins, vectorised SciPy FFT", scipy_s, scipy_s / ours_s, None),
        ("estimate_response without covariance", whole_s, whole_s / ours_s, None),
        ("… with what error bars are made of", errors_s, errors_s / ours_s, None),
        ("… with covariance at 20 frequencies", covariance_s, covariance_s / ours_s, None),
    )
    return Table(
        "Frequency responses: 13 channels, 12 x 10 000 samples, 5 windows, 200 frequencies",
        (
            Column("work"),
            Column("processor time", "s"),
            Column("ratio to flightid's spectra"),
            Column("largest relative deviation", digits=2),
        ),
        rows,
    )
