"""Poles, zeros and gains of a fitted innovations model with intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.identification.prediction_error.roots import (
    DOUBLE,
    POLE,
    ZERO,
    Errors,
    FittedRoot,
    fitted_root,
    propagated,
)
from flightid.models.innovations.model import InnovationsModel
from flightid.models.sampled.discrete_modes import discrete_modes
from flightid.responses.pair import quotient_unit
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import half_width

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ALL = "all responses"


def innovations_roots(
    model: InnovationsModel, errors: Errors, *, direct: bool
) -> tuple[FittedRoot, ...]:
    """Poles, shared by all responses and slowest first, then the zeros of each response.

    Parameters
    ----------
    model : InnovationsModel
    errors : Errors
        Of the entries of A, B, C, (D,) K row by row, in the model's units.
    direct : bool
        Whether D was fitted.

    Reference
    ---------
    Magnus, "On differentiating eigenvalues and eigenvectors", *Econometric Theory* 1 (1985).
    """
    poles = dict(_poles(model, direct=direct))
    order = [mode.z for mode in discrete_modes(list(poles), model.sample_time_s)]
    found = [fitted_root(ALL, errors, POLE, z, poles[z]) for z in order]
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            zeros = model.zeros()[f"{output}/{name}"]
            for z in zeros[zeros.imag >= 0]:
                slope = _zero_slope(model, i, j, complex(z), direct=direct)
                found.append(fitted_root(f"{output}/{name}", errors, ZERO, complex(z), slope))
    return tuple(found)


def innovations_gains(
    model: InnovationsModel, errors: Errors, *, direct: bool
) -> dict[str, Estimate]:
    """Steady gains C (I - A)⁻¹ B + D with intervals; none with an integrator."""
    a, b, c, _, _ = model.matrices
    values, found = model.gains(), {}
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            value = values[f"{output}/{name}"]
            if value is None:
                continue
            rest = np.eye(model.order) - a
            left, right = np.linalg.solve(rest.T, c[i]), np.linalg.solve(rest, b[:, j])
            gradient = _entries(model, i, j, left, right, 1.0, 1.0, direct=direct).real
            units = (model.units.get(output, "1"), model.units.get(name, "1"))
            unit = quotient_unit(*units)
            key = f"{output}/{name}"
            found[key] = propagated(f"gain {key}", unit, value, gradient, errors)
    return found


def may_reach_circle(model: InnovationsModel, covariance: Array, *, direct: bool) -> bool:
    """Whether a real eigenvalue of A - K C may lie on the unit circle, or lies beyond it.

    It is a zero of the noise model: see `prediction_error.roots.farthest`. What is judged is
    det(e I - A + K C) at e = 1 and -1 against its own error, not each eigenvalue: states that only
    hold a delay put several at zero, and eigenvalues beside each other move by the root of what
    their product moves by.

    Parameters
    ----------
    model : InnovationsModel
    covariance : ndarray
        Of the entries of A, B, C, (D,) K row by row, in the model's units.
    direct : bool
        Whether D was fitted.

    Reference
    ---------
    Jacobi's formula: d ln det M = tr(M⁻¹ dM).
    """
    a, b, c, d, k = model.matrices
    predictor = a - k @ c
    found = np.linalg.eigvals(predictor)
    if np.any(np.abs(found[found.imag == 0.0]) >= 1.0):
        return True
    for end in (1.0, -1.0):
        inverse = np.linalg.inv(end * np.eye(model.order) - predictor)
        of_b, of_d = np.zeros(b.shape), np.zeros(d.shape if direct else (0, 0))
        slopes = inverse.T, of_b, -(inverse @ k).T, of_d, -(c @ inverse).T
        rate = np.concatenate([each.ravel() for each in slopes])
        if half_width() ** 2 * float(rate @ covariance @ rate) >= 1.0:
            return True
    return False


def _poles(model: InnovationsModel, *, direct: bool) -> Iterator[tuple[complex, Complex | None]]:
    solved: Any = scipy.linalg.eig(model.matrices[0], left=True, right=True)
    values, left, right = solved
    for place, z in enumerate(values):
        if z.imag < 0.0:
            continue
        w, v = left[:, place].conj(), right[:, place]
        across = w @ v
        if abs(across) <= DOUBLE:
            yield complex(z), None
            continue
        yield complex(z), _entries(model, 0, 0, w / across, v, 0.0, 0.0, direct=direct)


def _zero_slope(
    model: InnovationsModel, i: int, j: int, z: complex, *, direct: bool
) -> Complex | None:
    """Dz = lᵀ dP r / (lₓᵀ rₓ) for the null vectors of the system matrix P at the zero."""
    a, b, c, d, _ = model.matrices
    n = model.order
    pencil = np.block(
        [[a - z * np.eye(n), b[:, j : j + 1]], [c[i : i + 1], d[i : i + 1, j : j + 1]]]
    )
    left, _, right = np.linalg.svd(pencil)
    l_vector, r_vector = left[:, -1].conj(), right[-1].conj()
    across = l_vector[:n] @ r_vector[:n]
    if abs(across) <= DOUBLE * np.linalg.norm(l_vector[:n]) * np.linalg.norm(r_vector[:n]):
        return None
    lead, last = l_vector / across, r_vector
    return _entries(
        model, i, j, lead[:n], last[:n], complex(lead[n]), complex(last[n]), direct=direct
    )


def _entries(
    model: InnovationsModel,
    i: int,
    j: int,
    left: NDArray[Any],
    right: NDArray[Any],
    output: complex,
    drive: complex,
    *,
    direct: bool,
) -> Complex:
    """Gradient of lᵀ [A b; c d] r by the entries of all matrices, l = (left, output)."""
    slopes = [np.zeros(matrix.shape, dtype=np.complex128) for matrix in model.matrices]
    slopes[0][:] = np.outer(left, right)
    slopes[1][:, j] = np.asarray(left) * drive
    slopes[2][i] = np.asarray(right) * output
    slopes[3][i, j] = output * drive
    return np.concatenate([s.ravel() for k, s in enumerate(slopes) if direct or k != 3])
