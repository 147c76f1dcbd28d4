"""Subspace estimates against sippy-unipi: same record, same order and horizon."""

from __future__ import annotations

import importlib.util
import io
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from flightid import Table
from flightid.table import Column

ORDER, HORIZON = 4, 15
TRUTH = fid.PolynomialModel(
    ("u",), "y", 0.1, a=[1, -2.6, 3.0, -1.8, 0.5], b=[[0.5, 0.3, -0.1, 0.2]], c=[1, -0.8, 0.3]
)


def flown(seed: int, n: int) -> fid.Record:
    rng = np.random.default_rng(seed)
    u, e = np.sign(rng.standard_normal(n)), 0.3 * rng.standard_normal(n)
    y = lfilter(*TRUTH.transfer("u"), u) + lfilter(*TRUTH.noise_transfer, e)
    return fid.Record.from_arrays(np.arange(n) / 10, inputs={"u": u}, outputs={"y": y})


def _seconds(work: Callable[[], object], repeats: int = 3) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def _peer(record: fid.Record, method: str) -> object:
    from sippy_unipi import system_identification  # noqa: PLC0415

    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        return system_identification(
            record["y"], record["u"], method.upper(), SS_fixed_order=ORDER, SS_f=HORIZON,
            tsample=0.1,
        )  # fmt: skip


def run() -> Table:
    """Processor seconds of one estimate without refinement, and of the refinement alone."""
    has_peer = importlib.util.find_spec("sippy_unipi") is not None
    rows = []
    for n in (2_000, 20_000):
        record = flown(1, n)
        for method in ("moesp", "n4sid", "cva"):
            structure = fid.InnovationsModel.subspace(
                "u", "y", ORDER, method=method, horizon=HORIZON, offsets="none", refine=False
            )
            ours = _seconds(lambda s=structure, r=record: fid.identify(s, r))
            theirs = _seconds(lambda m=method, r=record: _peer(r, m)) if has_peer else None
            rows.append((method, n, ours, theirs, None if theirs is None else theirs / ours))
    columns = (
        Column("method"),
        Column("samples"),
        Column("flightid", "s", 3),
        Column("sippy-unipi", "s", 3),
        Column("ratio", digits=3),
    )
    notes = () if has_peer else ("sippy-unipi is not installed: pip install 'flightid[bench]'",)
    return Table("Subspace estimates, order 4, 15 block rows", columns, tuple(rows), notes)
