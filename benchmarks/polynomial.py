"""Order scan and single fits against sippy-unipi, statsmodels and a competent NumPy version."""

from __future__ import annotations

import importlib.util
import io
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import lfilter

import flightid as fid
from flightid import Table
from flightid.table import Column

Array = NDArray[np.float64]
TRUTH = fid.PolynomialModel(
    ("u",), "y", 0.1, a=[1, -2.2, 1.9, -0.65], b=[[0.5, 0.3, -0.1]], c=[1, -0.8, 0.3]
)
DEGREES = range(1, 7)
SAMPLED = 9
"""Orders of the scan that a slow peer fits, spread over all 216; its time is scaled up."""
FEW = 10_000
"""Samples below which both sides are timed thrice, and the least counts."""
UNCOUNTED = 7
"""First errors that no loss of the scan counts: as many as the longest lag, and one."""


def flown(seed: int, n: int) -> fid.Record:
    rng = np.random.default_rng(seed)
    u, e = np.sign(rng.standard_normal(n)), 0.3 * rng.standard_normal(n)
    y = lfilter(*TRUTH.transfer("u"), u) + lfilter(*TRUTH.noise_transfer, e)
    return fid.Record.from_arrays(np.arange(n) / 10, inputs={"u": u}, outputs={"y": y})


def _seconds(work: Callable[[], object], repeats: int = 3) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def _shifted(x: Array, lags: range) -> Array:
    return np.array([np.concatenate([np.zeros(k), x[: x.size - k]]) for k in lags]).T


def numpy_armax(y: Array, u: Array, innovations: Array, na: int, nb: int, nc: int) -> float:
    """Gauss-Newton with filtered gradients; loss at the end."""

    def regressors(a: Array, b: Array, c: Array) -> Array:
        parts = _shifted(a, range(1, na + 1)), _shifted(b, range(1, nb + 1))
        return np.hstack([-parts[0], parts[1], _shifted(c, range(1, nc + 1))])

    def errors(theta: Array) -> Array:
        a, b, c = np.split(theta, [na, na + nb])
        left = lfilter([1.0, *a], [1.0], y) - lfilter([0.0, *b], [1.0], u)
        return np.asarray(lfilter([1.0], [1.0, *c], left))

    phi = regressors(y, u, innovations)
    theta = np.linalg.lstsq(phi, y, rcond=None)[0]
    theta[na + nb :] *= 1.0 if np.all(np.abs(np.roots([1.0, *theta[na + nb :]])) < 1) else 0.0
    e = errors(theta)
    loss = float(e @ e)
    for _ in range(20):
        below = [1.0, *theta[na + nb :]]
        psi = regressors(*(lfilter([1.0], below, x) for x in (y, u, e)))
        gram = psi.T @ psi
        step = cho_solve(cho_factor(gram + 1e-10 * np.diag(np.diag(gram))), psi.T @ e)
        for share in (1.0, 0.5, 0.25, 0.1, 0.02):
            trial = theta + share * step
            if np.any(np.abs(np.roots([1.0, *trial[na + nb :]])) >= 1):
                continue
            with np.errstate(over="ignore"):
                moved = errors(trial)
                after = float(moved @ moved)
            if after < loss:
                break
        else:
            break
        done = loss - after < 1e-7 * loss
        theta, e, loss = trial, moved, after
        if done:
            break
    counted = e[UNCOUNTED:]
    return float(counted @ counted) / counted.size


def numpy_scan(y: Array, u: Array) -> dict[tuple[int, int, int], float]:
    """All orders, the long ARX model fitted once through its normal equations."""
    n = 25
    lags = np.hstack([-_shifted(y, range(1, n + 1)), _shifted(u, range(1, n + 1))])
    theta = np.linalg.solve(lags.T @ lags, lags.T @ y)
    innovations = y - lags @ theta
    orders = product(DEGREES, DEGREES, DEGREES)
    return {order: numpy_armax(y, u, innovations, *order) for order in orders}


def _sippy(y: Array, u: Array, na: int, nb: int, nc: int) -> object:
    from sippy_unipi import system_identification  # noqa: PLC0415

    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        return system_identification(
            y, u, "ARMAX", ARMAX_orders=[[na], [[nb]], [nc], [[0]]], tsample=0.1
        )


def _sippy_scan_seconds(y: Array, u: Array) -> float:
    orders = list(product(DEGREES, DEGREES, DEGREES))
    chosen = orders[:: len(orders) // SAMPLED][:SAMPLED]
    _sippy(y[:200], u[:200], 1, 1, 1)  # Its imports are not its speed.
    start = time.perf_counter()
    for order in chosen:
        _sippy(y, u, *order)
    return (time.perf_counter() - start) * len(orders) / len(chosen)


def _scan_rows(n: int) -> list[tuple[str, float, float | None, float | None, str]]:
    training, unseen = flown(0, n), flown(1, n)
    y = training["y"] - training["y"].mean()
    u = training["u"] - training["u"].mean()
    scans: list[fid.OrderScan] = []
    theirs: dict[tuple[int, int, int], float] = {}
    repeats = 3 if n < FEW else 1
    ours = _seconds(
        lambda: scans.append(
            fid.scan_orders(training, unseen, na=DEGREES, nb=DEGREES, nc=DEGREES, starts=1)
        ),
        repeats,
    )
    seconds = _seconds(lambda: theirs.update(numpy_scan(y, u)), repeats)
    best = min(t.criteria.loss for t in scans[0].trials if t.criteria)
    note = f"best loss {best:.6g}, theirs {min(theirs.values()):.6g}"
    rows = [(f"216 ARMAX orders, N = {n}: NumPy", ours, seconds, seconds / ours, note)]
    name = f"216 ARMAX orders, N = {n}: sippy-unipi"
    if importlib.util.find_spec("sippy_unipi") is None:
        return [*rows, (name, ours, None, None, "skipped: sippy-unipi is not installed")]
    seconds = _sippy_scan_seconds(y, u)
    note = f"theirs scaled from {SAMPLED} of 216 orders"
    return [*rows, (name, ours, seconds, seconds / ours, note)]


def _fit_row() -> tuple[str, float, float | None, float | None, str]:
    record = flown(2, 2000)
    structure = fid.PolynomialModel.armax("u", "y", na=3, nb=3, nc=2)
    ours = _seconds(lambda: fid.identify(structure, record))
    name = "one ARMAX(3, 3, 2), N = 2000: statsmodels exact likelihood"
    if importlib.util.find_spec("statsmodels") is None:
        return name, ours, None, None, "skipped: statsmodels is not installed"
    from statsmodels.tsa.arima.model import ARIMA  # noqa: PLC0415

    y, u = record["y"] - record["y"].mean(), record["u"] - record["u"].mean()
    # Its regressors enter beside an ARMA noise, so three lags of the input stand for B.
    exog = _shifted(u, range(1, 4))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = _seconds(lambda: ARIMA(y, exog=exog, order=(3, 0, 2), trend="n").fit(), 1)
    return name, ours, theirs, theirs / ours, "same number of coefficients"


def run() -> Table:
    """Table of times with the ratio to each peer; all of one run on the same data."""
    rows = (*_scan_rows(1200), *_scan_rows(100_000), _fit_row())
    return Table(
        "Polynomial models",
        (
            Column("work"),
            Column("seconds", digits=3),
            Column("peer seconds", digits=3),
            Column("ratio", digits=3),
            Column("note"),
        ),
        rows,
        ("ours with as many threads as RAYON_NUM_THREADS says; the peers use one",),
    )
