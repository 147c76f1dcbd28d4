"""Term selection against NumPy (one product a term, and textbook deflation), and free runs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightid import Table, _native
from flightid.table import Column

Array = NDArray[np.float64]
N_TERMS = 50


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
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


def _selection(n: int, *, textbook: bool) -> list[tuple[str, float, float, float]]:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((n, n))
    y = columns[:20].sum(axis=0) + rng.standard_normal(n)
    none = np.empty((0, 1))
    found: list[list[int]] = []

    def ours() -> None:
        found.append(
            _native.select_terms(
                y, columns, np.empty((n, 1)), none, "gaussian", 1.0, 0, "terms", 0.0, N_TERMS
            )[0]
        )

    seconds = _seconds(ours)
    peers = {"one product a term": one_product_a_term}
    if textbook:
        peers["deflation"] = deflation
    rows = []
    for name, peer in peers.items():
        if peer(columns, y) != found[0]:
            raise AssertionError(f"{name} chose other terms")
        theirs = _seconds(lambda peer=peer: peer(columns, y))  # type: ignore[misc]
        rows.append(
            (f"{n} × {n}, {N_TERMS} terms: NumPy {name}", seconds, theirs, theirs / seconds)
        )
    return rows


def _free_run(n: int = 5000, centres: int = 13, lags: int = 8) -> tuple[str, float, float, float]:
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
    )


def run() -> Table:
    """Table of times with the ratio to each peer."""
    free = _free_run()
    rows = (*_selection(1000, textbook=True), *_selection(3000, textbook=False), free)
    return Table(
        "NARX",
        (Column("work"), Column("seconds"), Column("peer seconds"), Column("ratio", digits=3)),
        rows,
        (f"the free run makes {5000 / free[1] / 1e6:.2f} million samples/s",),
    )
