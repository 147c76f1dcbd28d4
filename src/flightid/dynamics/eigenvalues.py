"""Eigenvalues of a fitted state-space model, with the intervals that its parameters give them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from flightid.errors import ModelError
from flightid.identification.fit import Fit
from flightid.models import StateSpaceModel
from flightid.table import Cell, Column, Table

REAL = 1e-9
"""Imaginary part, relative to the size, below which an eigenvalue is real."""
CLOSE = 1e-6
"""Relative distance of two eigenvalues below which neither has a derivative."""
NORMAL_95 = 1.959963984540054


@dataclass(frozen=True)
class Eigenvalue:
    """One eigenvalue, or a complex pair by its member with positive imaginary part.

    Attributes
    ----------
    value : complex
        rad/s.
    deviations : tuple of float, or None
        Standard errors of real part, imaginary part (rad/s), natural frequency (rad/s) and damping
        ratio over repeated flights; None where the fit's covariance is not known, and for
        eigenvalues that coincide.

    Example
    -------
    >>> mode = Eigenvalue(-3.0 + 4.0j)
    >>> mode.natural_rad_s, mode.damping
    (5.0, 0.6)
    """

    value: complex
    deviations: tuple[float, float, float, float] | None = None

    @property
    def natural_rad_s(self) -> float:
        """Natural frequency, rad/s."""
        return abs(self.value)

    @property
    def damping(self) -> float:
        """Damping ratio; negative for an unstable mode."""
        return -self.value.real / abs(self.value) if self.value else 1.0

    @property
    def half_widths(self) -> tuple[float, float, float, float] | None:
        """Half 95 % intervals in the order of `deviations`."""
        if self.deviations is None:
            return None
        real, imaginary, natural, damping = (NORMAL_95 * each for each in self.deviations)
        return real, imaginary, natural, damping


def eigenvalues_of(fit: Fit) -> tuple[Eigenvalue, ...]:
    """Eigenvalues of a fitted state-space model, slowest first, with propagated errors.

    Parameters
    ----------
    fit : Fit
        Of a `StateSpaceModel`.

    Returns
    -------
    tuple of Eigenvalue

    Raises
    ------
    ModelError
        The model has no states with names, or its equations do not give every derivative.

    Assumes
    -------
    Errors of the parameters small enough for first order: biased for an eigenvalue that nearly
    meets another, whose derivative has no bound there.

    Reference
    ---------
    Magnus, "On differentiating eigenvalues and eigenvectors", *Econometric Theory* 1 (1985): for a
    simple eigenvalue dλ = wᴴ dA v / wᴴ v.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.load_model("short_period").with_fixed(Malphadot=-0.898)
    >>> omega = np.geomspace(0.3, 30.0, 40)
    >>> data = fid.FrequencyResponse.from_values(
    ...     omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
    ...     units=truth.units, random_error=np.full((len(truth.outputs), 1, 40), 0.02))
    >>> [round(each.natural_rad_s, 3) for each in eigenvalues_of(fid.identify(truth, data))]
    [3.606]
    """
    model = fit.model
    if not isinstance(model, StateSpaceModel):
        raise ModelError(
            "eigenvalues need a state-space model",
            found=type(model).__name__,
            needed="StateSpaceModel",
            action="for a transfer function use factored()",
        )
    a = model.state_space()[0]
    solved: Any = eig(a, left=True, right=True)
    values, left, right = solved
    slopes = _slopes(model, fit.names, a) if fit.covariance is not None else None
    found = []
    for place, value in enumerate(values):
        if value.imag < -REAL * max(abs(value), REAL):
            continue
        real = abs(value.imag) <= REAL * max(abs(value), REAL)
        exact = complex(value.real, 0.0 if real else value.imag)
        deviations = None
        apart = np.delete(np.abs(values - value), place)
        if slopes is not None and np.min(apart, initial=np.inf) > CLOSE * max(abs(value), 1.0):
            w, v = left[:, place].conj(), right[:, place]
            moves = np.array([w @ slope @ v for slope in slopes]) / (w @ v)
            deviations = _deviations(exact, moves, np.asarray(fit.covariance))
        found.append(Eigenvalue(exact, deviations))
    return tuple(sorted(found, key=lambda each: (each.natural_rad_s, each.value.real)))


def eigenvalue_table(found: tuple[Eigenvalue, ...], title: str = "Eigenvalues") -> Table:
    """Table of eigenvalues with natural frequency, damping ratio and half 95 % intervals.

    Parameters
    ----------
    found : tuple of Eigenvalue
    title : str

    Returns
    -------
    Table

    Example
    -------
    >>> eigenvalue_table((Eigenvalue(-3.0 + 4.0j),)).rows[0][:2]
    (-3.0, 4.0)
    """
    columns = (
        Column("real", "rad/s"),
        Column("imaginary", "rad/s"),
        Column("natural frequency", "rad/s"),
        Column("±", "rad/s", 2),
        Column("damping ratio", digits=3),
        Column("±", digits=2),
    )
    rows: list[tuple[Cell, ...]] = []
    for each in found:
        half = each.half_widths or (None, None, None, None)
        damping = (each.damping, half[3]) if each.value.imag else (None, None)
        rows.append((each.value.real, each.value.imag, each.natural_rad_s, half[2], *damping))
    return Table(title, columns, tuple(rows), ("± is half a 95 % interval.",))


def _slopes(
    model: StateSpaceModel, names: tuple[str, ...], a: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Derivatives of A = M⁻¹F by the parameters: M⁻¹(dF − dM A)."""
    m, by_name = model.matrices().m, model.matrix_derivatives()
    return [
        np.asarray(np.linalg.solve(m, by_name[name].f - by_name[name].m @ a), dtype=np.float64)
        for name in names
    ]


def _deviations(
    value: complex, moves: NDArray[np.complex128], covariance: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    size = abs(value)
    if size == 0.0:
        both = np.array([moves.real, moves.imag, np.abs(moves), np.zeros(len(moves))])
    else:
        natural = (value.real * moves.real + value.imag * moves.imag) / size
        damping = (-moves.real * size + value.real * natural) / size**2
        both = np.array([moves.real, moves.imag, natural, damping])
    spread = np.sqrt(np.maximum(np.einsum("ia,ab,ib->i", both, covariance, both), 0.0))
    real, imaginary, natural_error, damping_error = map(float, spread)
    return real, imaginary, natural_error, damping_error
