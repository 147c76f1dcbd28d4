"""Linear simulation against SciPy and python-control, and delays against a fine grid."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from flightid import Record, _native
from flightid.models.linear.linear_system import LinearSystem
from flightid.simulation import simulate
from tests.closeness import assert_close
from tests.examples import examples

ROUNDING = "both are exact for this hold; only rounding differs"


def _system(seed: int, n: int = 4, m: int = 2, p: int = 3) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((n, n)) * 5
    a -= np.eye(n) * (np.linalg.eigvals(a).real.max() + 0.5)
    return a, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m))


def _record(seed: int, n_samples: int = 300, sample_s: float = 0.01, m: int = 2) -> Record:
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.standard_normal((m, n_samples)), axis=1) * 0.1
    u[:, 0] = 0.0
    time_s = np.arange(n_samples) * sample_s
    return Record.from_arrays(time_s, inputs={f"u{j}": u[j] for j in range(m)})


def _linear(matrices: tuple[np.ndarray, ...], delays_s: list[float] | None = None) -> LinearSystem:
    m, p = matrices[1].shape[1], matrices[2].shape[0]
    names = tuple(f"u{j}" for j in range(m)), tuple(f"y{i}" for i in range(p))
    return LinearSystem(*matrices, *names, delays_s or [0.0] * m)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_scipy_lsim(seed: int, hold: str) -> None:
    matrices, record = _system(seed), _record(seed)
    x0 = np.arange(4.0)
    ours = simulate(_linear(matrices), record, hold=hold, initial_state=x0)
    _, theirs, _ = scipy.signal.lsim(
        matrices,
        record.matrix(("u0", "u1")).T,
        record.time_s - record.time_s[0],
        X0=x0,
        interp=hold == "first",
    )
    scale = np.abs(theirs).max()
    assert_close(ours.matrix(("y0", "y1", "y2")).T, theirs, atol=1e-10 * scale, why=ROUNDING)


def test_agrees_with_python_control() -> None:
    matrices, record = _system(7), _record(7)
    theirs = control.forced_response(
        control.ss(*matrices), record.time_s, record.matrix(("u0", "u1"))
    )
    ours = simulate(_linear(matrices), record).matrix(("y0", "y1", "y2"))
    assert_close(ours, theirs.outputs, atol=1e-10 * np.abs(ours).max(), why=ROUNDING)


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_fractional_delays_agree_with_a_grid_that_holds_every_corner(hold: str) -> None:
    # On a grid 100 times finer the delays 0.37 T and 2.85 T are whole numbers of samples.
    matrices, record, fine = _system(3), _record(3, n_samples=80), 100
    sample_s = record.sample_time_s
    delays = [0.37 * sample_s, 2.85 * sample_s]
    coarse = simulate(_linear(matrices, delays), record, hold=hold)
    n_fine = (record.n_samples - 1) * fine + 1
    position = np.arange(n_fine) / fine
    u = record.matrix(("u0", "u1"))
    if hold == "first":
        dense = np.array([np.interp(position, np.arange(record.n_samples), row) for row in u])
    else:
        dense = u[:, np.floor(position + 1e-9).astype(int)]
    lagged = np.array(
        [
            np.r_[np.full(lag, row[0]), row[: n_fine - lag]]
            for row, lag in zip(dense, (37, 285), strict=True)
        ]
    )
    time_s = position * sample_s
    fine_record = Record.from_arrays(time_s, inputs={"u0": lagged[0], "u1": lagged[1]})
    exact = simulate(_linear(matrices), fine_record, hold=hold)
    for name in coarse.outputs:
        assert_close(coarse[name], exact[name][::fine], atol=1e-10, why=ROUNDING)


@examples(40)
@given(st.integers(0, 10_000), st.integers(1, 9), st.floats(1e-6, 60.0))
def test_matrix_exponential_agrees_with_scipy(seed: int, n: int, scale: float) -> None:
    matrix = np.random.default_rng(seed).standard_normal((n, n))
    matrix *= scale / np.abs(matrix).sum(axis=0).max()
    theirs = scipy.linalg.expm(matrix)
    ours = _native.matrix_exponential(matrix)
    # The condition of the exponential grows with the norm of its argument.
    assert_close(ours, theirs, atol=1e-13 * (1 + scale) * np.exp(scale), why="condition")
