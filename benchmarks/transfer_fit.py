"""Transfer-function fits against SciPy on the same residuals, same start, same bounds.

The peers minimise the same weighted dB and degree residuals: SciPy's `least_squares` with its own
finite differences, and with the analytic Jacobian vectorised over frequency in NumPy.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

import flightid as fid
from flightid.identification.frequency_domain.selection import coherence_weight
from flightid.identification.multistart import draw_starts
from flightid.table import Column, Table

OMEGA = np.geomspace(0.5, 60.0, 20)
NAMES = ("Ltphi", "Lp", "T_m", "tau")
DECIBEL, DEGREE = 20.0 / np.log(10.0), 180.0 / np.pi
REPEATS = 5
STARTS = 50


def _model(x: np.ndarray) -> np.ndarray:
    s = 1j * OMEGA
    return x[0] / ((s - x[1]) * (x[2] * s + 1)) * np.exp(-s * x[3])


def _residuals(x: np.ndarray, measured: np.ndarray, db: np.ndarray, deg: np.ndarray) -> np.ndarray:
    ratio = _model(x) / measured
    return np.concatenate([db * np.log(np.abs(ratio)), deg * np.angle(ratio)])


def _jacobian(x: np.ndarray, _: np.ndarray, db: np.ndarray, deg: np.ndarray) -> np.ndarray:
    s = 1j * OMEGA
    slope = np.column_stack([np.full(len(s), 1 / x[0]), 1 / (s - x[1]), -s / (x[2] * s + 1), -s])
    return np.vstack([db[:, None] * slope.real, deg[:, None] * slope.imag])


def _best(call: Callable[[], object]) -> float:
    call()
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def run() -> Table:
    """Seconds of 50 fits from the same starts, and the ratio to the native fit."""
    model = fid.load_model("rate_motor_lag")
    truth = model.with_values({"Ltphi": 320.0, "Lp": -4.0, "T_m": 0.04, "tau": 0.008})
    noise = np.random.default_rng(0).normal(scale=0.05, size=(2, len(OMEGA)))
    measured = truth.frequency_response(OMEGA)[0, 0] * np.exp(noise[0] + 1j * noise[1])
    weight = coherence_weight(np.full(len(OMEGA), 0.9))
    gain, phase = np.sqrt(weight), np.sqrt(0.01745 * weight)
    db, deg = DECIBEL * gain, DEGREE * phase
    free = model.parameters.free
    starts = draw_starts(free, STARTS, seed=0)
    low = np.array([parameter.minimum for parameter in free])
    high = np.array([parameter.maximum for parameter in free])
    values = model.parameters.independent_values()
    data = [(OMEGA, measured, gain, phase)]
    every = model.parameters.free_indices

    def native() -> list[float]:
        ends = model.native.fit(values, every, data, [], starts, low, high, 200)
        return [end[1] for end in ends if not isinstance(end, str)]

    def peer(jacobian: object) -> list[float]:
        return [
            2
            * least_squares(
                _residuals, start, jacobian, (low, high), x_scale="jac", args=(measured, db, deg)
            ).cost
            for start in np.clip(starts, low + 1e-9, high - 1e-9)
        ]

    cases = (
        ("flightid, native", native),
        ("SciPy least_squares, analytic NumPy", lambda: peer(_jacobian)),
        ("SciPy least_squares, finite differences", lambda: peer("2-point")),
    )
    times = [(_best(call), min(call()), call()) for _, call in cases]
    rows = tuple(
        (name, seconds, seconds / times[0][0], best, int(np.sum(np.array(all_) < best * 1.001)))
        for (name, _), (seconds, best, all_) in zip(cases, times, strict=True)
    )
    columns = (
        Column("fit"),
        Column("time", "s", 3),
        Column("times the native", digits=3),
        Column("best cost", digits=8),
        Column("starts that reached it"),
    )
    return Table(f"{STARTS} starts of a 4-parameter transfer function, 20 points", columns, rows)
