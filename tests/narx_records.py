"""Records of a quadratic system whose NARX terms are known."""

from __future__ import annotations

import numpy as np

import flightid as fid


def quadratic(n: int = 400, seed: int = 0, noise: float = 0.0, name: str = "q") -> fid.Record:
    """y(t) = 0.5 y(t-1) + 0.6 u(t-1) - 0.3 u(t-2)² + 0.1 + e, offset and scale on both channels."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, n)
    e = noise * rng.standard_normal(n)
    y = np.zeros(n)
    for t in range(2, n):
        y[t] = 0.5 * y[t - 1] + 0.6 * u[t - 1] - 0.3 * u[t - 2] ** 2 + 0.1 + e[t]
    return fid.Record.from_arrays(
        np.arange(n) / 5,
        inputs={"u": 2 * u + 7},
        outputs={"y": 3 * y - 4},
        units={"u": "V", "y": "rad"},
        name=name,
    )
