"""Term selection against SysIdentPy and two kinds of NumPy, and free runs.

Times are processor time, which other work on the machine lengthens little; with one thread each
(RAYON_NUM_THREADS=1, OPENBLAS_NUM_THREADS=1) they are those of one core.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from flightid import Table, _native
from flightid.table import Column

Array = NDArray[np.float64]
N_TERMS = 50
SLOW = 2.0
"""A peer that takes longer, s, runs once."""


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return sorted(times)[1]


def one_product_a_term(columns: Array, y: Array) -> list[int]:
    """Lengths and products of all candidates updated by one matrix-vector product a term."""
    lengths, products = np.einsum("ij,ij->i", columns, columns), columns @ y
    directions = np.empty((N_TERMS, y.size))
    chosen: list[int] = []
    open_ = np.ones(len(columns), dtype=bool)
    for k in range(N_TERMS):
        ratios = np.where(open_, products**2 / np.maximum(lengths, 1e-300), -1.0)
        best = int(np.argmax(ratios))
        q = columns[best].copy()
        for _ in range(2):
            q -= directions[:k].T @ (directions[:k] @ q)
        q /= np.linalg.norm(q)
        directions[k] = q
        chosen.append(best)
        open_[best] = False
        r = columns @ q
        lengths -= r**2
        products -= r * (q @ y)
    return chosen


def deflation(columns: Array, y: Array) -> list[int]:
    """Modified Gram-Schmidt: every candidate is rewritten for each term."""
    rest = columns.copy()
    chosen: list[int] = []
    for _ in range(N_TERMS):
        lengths = np.einsum("ij,ij->i", rest, rest)
        ratios = (rest @ y) ** 2 / np.maximum(lengths, 1e-300)
        ratios[chosen] = -1.0
        best = int(np.argmax(ratios))
        chosen.append(best)
        w = rest[best].copy()
        rest -= np.outer(rest @ w / (w @ w), w)
    return chosen


def sysidentpy(columns: Array, y: Array) -> list[int]:
    """SysIdentPy's forward regression (FROLS) on the same matrix, in its own layout."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415

    model = FROLS(order_selection=False, n_terms=N_TERMS, basis_function=Polynomial(1))
    model.max_lag = 0
    psi = np.ascontiguousarray(columns.T)
    return [int(i) for i in model.error_reduction_ratio(psi, y[:, None], N_TERMS)[1]]


PEERS = {
    "SysIdentPy FROLS": sysidentpy,
    "NumPy, one product a term": one_product_a_term,
    "NumPy, deflation": deflation,
}


def white(n: int) -> tuple[Array, Array]:
    """Independent candidates, of which twenty make the target."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((n, n))
    return columns, columns[:20].sum(axis=0) + rng.standard_normal(n)


def radial(n: int, lags: int = 8, beta: float = 5.0) -> tuple[Array, Array]:
    """Gaussian functions at all samples of a nonlinear record with noise."""
    rng = np.random.default_rng(0)
    size = n + lags
    u, y = rng.uniform(-1, 1, size), np.zeros(size)
    for t in range(2, size):
        y[t] = 0.8 * np.tanh(1.5 * y[t - 1]) - 0.2 * y[t - 2] + 0.5 * u[t - 1] + 0.3 * u[t - 2] ** 2
        y[t] += 0.1 * rng.standard_normal()
    y, u = (y - y.mean()) / y.std(), (u - u.mean()) / u.std()
    x = np.array([v[lags - i : size - i] for v in (y, u) for i in range(1, lags + 1)]).T
    return np.exp(-cdist(x, x, "sqeuclidean") / beta**2), y[lags:]


Row = tuple[str, float, float | None, float | None, str]


def _selection(name: str, columns: Array, y: Array, peers: tuple[str, ...]) -> list[Row]:
    none = np.empty((0, 1))
    found: list[list[int]] = []
    n = y.size

    def ours() -> None:
        found.append(
            _native.select_terms(
                y, columns, np.empty((n, 1)), none, "gaussian", 1.0, True, 0, "terms", 0.0, N_TERMS
            )[0]
        )

    seconds = _seconds(ours)
    rows: list[Row] = []
    for peer in peers:
        work = f"{name}, {n} × {n}, {N_TERMS} terms: {peer}"
        if peer == "SysIdentPy FROLS" and importlib.util.find_spec("sysidentpy") is None:
            rows.append((work, seconds, None, None, "skipped: sysidentpy is not installed"))
            continue
        start = time.process_time()
        theirs = PEERS[peer](columns, y)
        taken = time.process_time() - start
        if taken < SLOW:
            taken = _seconds(lambda peer=peer: PEERS[peer](columns, y))  # type: ignore[misc]
        same = next((k for k in range(N_TERMS) if theirs[k] != found[0][k]), None)
        note = "same terms" if same is None else f"other term {same + 1}"
        rows.append((work, seconds, taken, taken / seconds, note))
    return rows


def _free_run(n: int = 5000, centres: int = 13, lags: int = 8) -> Row:
    rng = np.random.default_rng(1)
    u, y = rng.standard_normal(n), rng.standard_normal(n)
    points = rng.standard_normal((centres, 2 * lags))
    weights = 0.1 * rng.standard_normal(centres)
    places = [(0, i) for i in range(1, lags + 1)] + [(1, i) for i in range(1, lags + 1)]

    def ours() -> Array:
        return _native.run_narx(
            y, u[None], places, [(0.1, [])], points, weights, "gaussian", 4.0, (-9.0, 9.0), 0
        )[0]

    def theirs() -> Array:
        run = y.copy()
        for t in range(lags, n):
            x = np.concatenate([run[t - lags : t][::-1], u[t - lags : t][::-1]])
            run[t] = 0.1 + weights @ np.exp(-np.sum((points - x) ** 2, axis=1) / 16.0)
        return run

    if not np.allclose(ours(), theirs(), rtol=1e-10, atol=1e-12):
        raise AssertionError("free runs differ")
    fast, slow = _seconds(ours), _seconds(theirs)
    return (
        f"free run, {n} samples, {centres} centres, {2 * lags} lags: NumPy",
        fast,
        slow,
        slow / fast,
        f"{n / fast / 1e6:.2f} million samples/s",
    )


def run() -> Table:
    """Table of times with the ratio to each peer; all of one run on the same data."""
    plain = ("NumPy, one product a term",)
    rows = (
        *_selection("independent", *white(1000), ("NumPy, deflation", *plain)),
        *_selection("independent", *white(3000), plain),
        *_selection("independent", *white(5000), ("SysIdentPy FROLS", *plain)),
        *_selection("radial", *radial(5000), ("SysIdentPy FROLS", *plain)),
        _free_run(),
    )
    columns = (
        Column("work"),
        Column("seconds", digits=3),
        Column("peer seconds", digits=3),
        Column("ratio", digits=3),
        Column("note"),
    )
    threads = "ours with as many threads as RAYON_NUM_THREADS says, NumPy's products as BLAS says"
    return Table("NARX", columns, rows, (threads,))
