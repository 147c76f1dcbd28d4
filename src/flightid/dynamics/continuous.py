"""Discrete models to continuous time and back: zero-order hold, first-order hold, Tustin."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ModelError, OptionError
from flightid.models import InnovationsModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system

Array = NDArray[np.float64]
Four = tuple[Array, Array, Array, Array]
METHODS = ("zero", "first", "tustin")
AT_ORIGIN = 1e-7
"""Poles closer to the origin than this are delays: rounding moves a double pole by its root."""
ROUNDING = 1e-9


def to_continuous(
    source: object,
    hold: str = "zero",
) -> LinearSystem:
    """Continuous-time system whose samples are those of a discrete model.

    Parameters
    ----------
    source : PolynomialModel, InnovationsModel, sampled LinearSystem, or a fit of one
        Its response to the inputs is converted; the noise model has no hold and is left out.
    hold : {"zero", "first", "tustin"}
        Inputs are steps or straight lines between samples (exact), or the bilinear rule, which
        warps frequencies.

    Returns
    -------
    LinearSystem
        With the poles at the origin as delays of the inputs, rad/s and s.

    Raises
    ------
    ModelError
        The model is continuous already; a negative real pole, which has no real continuous
        counterpart; a pole at the origin that is not a delay of an input; with "tustin" one at -1.
    OptionError
        An unknown hold.

    Reference
    ---------
    Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., sections 2.3 and 8.2; Franklin,
    Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., section 4.3.

    Example
    -------
    >>> import math
    >>> roll = InnovationsModel(("aileron",), ("p",), 0.1, [[math.exp(-0.5)]], [[1.0]], [[1.0]])
    >>> round(float(to_continuous(roll).a[0, 0]), 12)
    -5.0
    """
    _require_hold(hold)
    discrete = linear_system(source).with_pade()
    step = discrete.sample_time_s
    if step is None:
        raise ModelError(
            "the model is continuous already", needed="a sampled model, or a fit of one"
        )
    a, b, c, d, lags = _without_delays(*discrete.state_space()[:4])
    if hold == "tustin":
        found = _from_tustin(a, b, c, d, step)
    else:
        _require_counterparts(a, step)
        found = _from_hold(a, b, c, d, step, hold)
    return LinearSystem(*found, discrete.inputs, discrete.outputs, lags * step)


def to_discrete(source: object, sample_time_s: float, hold: str = "zero") -> InnovationsModel:
    """Discrete model of a continuous one, without noise model.

    Parameters
    ----------
    source : Fit or model
        Of any kind with a linear system.
    sample_time_s : float
        Sample time T, s.
    hold : {"zero", "first", "tustin"}
        As for `to_continuous`.

    Returns
    -------
    InnovationsModel
        Delays of the inputs as states, parts of a sample too.

    Raises
    ------
    DataError
        A sample time that is not positive; with "tustin" a delay of part of a sample.
    OptionError
        An unknown hold.

    Reference
    ---------
    Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., section 2.3.

    Example
    -------
    >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> round(float(to_discrete(lag, 0.1).poles()[0].real), 6)
    0.606531
    """
    _require_hold(hold)
    if not sample_time_s > 0:
        raise DataError("the sample time is not positive", found=sample_time_s, needed="seconds")
    system = linear_system(source)
    if hold == "tustin":
        a, b, c, d, delays_s = system.state_space()
        parts = _to_tustin(a, b, c, d, sample_time_s)
        # Delays of a bilinear model stay delays: only whole samples of them have a meaning.
        names = system.inputs, system.outputs, delays_s
        sampled = LinearSystem(*parts, *names, sample_time_s=sample_time_s).with_pade()
    else:
        sampled = system.sampled(sample_time_s, "zero" if hold == "zero" else "first")
    found = sampled.state_space()[:4]
    return InnovationsModel(sampled.inputs, sampled.outputs, sample_time_s, *found)


def _require_hold(hold: str) -> None:
    if hold not in METHODS:
        raise OptionError("unknown hold", found=hold, needed=" or ".join(METHODS))


def _require_counterparts(a: Array, step: float) -> None:
    values = np.linalg.eigvals(a)
    negative = values[(np.abs(values.imag) <= ROUNDING * np.abs(values)) & (values.real < 0)]
    if negative.size:
        raise ModelError(
            "a negative real pole has no real continuous counterpart",
            found=", ".join(f"z = {z.real:.4g}" for z in negative),
            needed=f"no real pole below zero at {step:.4g} s",
            action="lower the order, leave the pole out as one of the noise, or keep the model "
            "discrete",
        )


def _without_delays(
    a: Array, b: Array, c: Array, d: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """The model without its poles at the origin, and the samples of delay of each input."""
    solve: Any = scipy.linalg.schur
    upper, turn, kept = solve(a, output="complex", sort=lambda z: abs(z) > AT_ORIGIN)
    n, m = a.shape[0], b.shape[1]
    if kept == n:
        return a, b, c, d, np.zeros(m)
    split = scipy.linalg.solve_sylvester(
        upper[:kept, :kept], -upper[kept:, kept:], -upper[:kept, kept:]
    )
    to = np.vstack([np.hstack([np.eye(kept), -split]) @ turn.conj().T, turn.conj().T[kept:]])
    parked = (to @ b)[kept:]
    nilpotent = upper[kept:, kept:]
    lags, moved, direct = np.zeros(m), b.copy(), d.copy()
    size = max(float(np.max(np.abs(parked))), 1e-300)
    for j in range(m):
        column = parked[:, j]
        while np.max(np.abs(column)) > ROUNDING * size:
            if np.max(np.abs(direct[:, j])) > ROUNDING * size:
                raise ModelError(
                    "a pole at the origin is not a delay of an input",
                    found=f"an input that acts after {int(lags[j])} samples",
                    needed="poles at the origin that only delay",
                    action="lower the numerator's order, or raise the delay nk",
                )
            column = nilpotent @ column
            direct[:, j] = c @ moved[:, j]
            moved[:, j] = a @ moved[:, j]
            lags[j] += 1
    basis = _real_basis(turn[:, :kept])
    back = np.linalg.pinv(np.hstack([basis, _real_basis((np.linalg.inv(to))[:, kept:])]))[:kept]
    return back @ a @ basis, back @ moved, c @ basis, direct, lags


def _real_basis(columns: NDArray[np.complex128]) -> Array:
    """Real orthonormal basis of a subspace that conjugation leaves in place."""
    both = np.hstack([columns.real, columns.imag])
    return np.asarray(np.linalg.svd(both)[0][:, : columns.shape[1]])


def _holds(a: Array, step: float) -> tuple[Array, Array, Array]:
    """exp(A T), ∫ exp(A s) ds and ∫ exp(A s) (1 - s/T) ds over one sample."""
    n = a.shape[0]
    eye, none = np.eye(n), np.zeros((n, n))
    chain = np.block([[a * step, eye * step, none], [none, none, eye], [none, none, none]])
    made = scipy.linalg.expm(chain)
    return made[:n, :n], made[:n, n : 2 * n], made[:n, 2 * n :]


def _from_hold(a: Array, b: Array, c: Array, d: Array, step: float, hold: str) -> Four:
    logarithm: Any = scipy.linalg.logm(a) if a.size else np.zeros(a.shape)
    rate = np.real(logarithm) / step
    phi, full, ramp = _holds(rate, step)
    if hold == "zero":
        return _arrays(rate, np.linalg.solve(full, b), c, d)
    drive = np.linalg.solve(full + phi @ ramp - ramp, b)
    return _arrays(rate, drive, c, d - c @ ramp @ drive)


def _to_tustin(a: Array, b: Array, c: Array, d: Array, step: float) -> Four:
    inverse = np.linalg.inv(np.eye(a.shape[0]) - a * step / 2)
    ahead = inverse @ b * step
    phi = inverse @ (np.eye(a.shape[0]) + a * step / 2)
    return _arrays(phi, ahead, c @ inverse, d + c @ ahead / 2)


def _from_tustin(a: Array, b: Array, c: Array, d: Array, step: float) -> Four:
    one = np.eye(a.shape[0])
    if a.size and np.min(np.abs(np.linalg.eigvals(a) + 1.0)) < ROUNDING:
        raise ModelError("a pole at -1 has no counterpart under the bilinear rule", found="z = -1")
    inverse = np.linalg.inv(one + a)
    rate = 2.0 / step * inverse @ (a - one)
    return _arrays(rate, 2.0 / step * inverse @ b, 2.0 * c @ inverse, d - c @ inverse @ b)


def _arrays(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Four:
    return np.asarray(a), np.asarray(b), np.asarray(c), np.asarray(d)
