"""Records of known innovations models, with and without noise, open and closed loop."""

from __future__ import annotations

import numpy as np

import flightid as fid


def _turn(radius: float, angle: float) -> np.ndarray:
    c, s = radius * np.cos(angle), radius * np.sin(angle)
    return np.array([[c, s], [-s, c]])


_A = np.zeros((4, 4))
_A[:2, :2], _A[2:, 2:] = _turn(0.95, 0.3), _turn(0.8, 1.0)
_DRAWN = np.random.default_rng(0)
PAIR = fid.InnovationsModel(
    ("u", "v"),
    ("y", "z"),
    0.1,
    _A,
    _DRAWN.standard_normal((4, 2)),
    _DRAWN.standard_normal((2, 4)),
    None,
    0.05 * _DRAWN.standard_normal((4, 2)),
    units={"y": "rad", "z": "rad/s", "u": "V", "v": "V"},
)
SINGLE = fid.InnovationsModel(
    ("u",), ("y",), 0.1, _turn(0.94, 0.3), [[1.0], [0.4]], [[1.0, 0.3]], None, [[0.5], [0.2]]
)


def flown(
    model: fid.InnovationsModel,
    seed: int,
    *,
    n: int = 500,
    noise: float = 0.0,
    feedback: float = 0.0,
    warm_up: int = 100,
) -> fid.Record:
    """A record from the middle of a run; feedback of the first output to the first input."""
    drawn = np.random.default_rng(seed)
    a, b, c, d, k = model.matrices
    p, m = c.shape[0], b.shape[1]
    u = drawn.standard_normal((m, n + warm_up))
    e = noise * drawn.standard_normal((p, n + warm_up))
    x, y = np.zeros(model.order), np.zeros((p, n + warm_up))
    for t in range(n + warm_up):
        if feedback and t:
            u[0, t] -= feedback * y[0, t - 1]
        y[:, t] = c @ x + d @ u[:, t] + e[:, t]
        x = a @ x + b @ u[:, t] + k @ e[:, t]
    return fid.Record.from_arrays(
        np.arange(n) * model.sample_time_s,
        inputs=dict(zip(model.inputs, u[:, warm_up:], strict=True)),
        outputs=dict(zip(model.outputs, y[:, warm_up:], strict=True)),
        units=dict(model.units),
    )
