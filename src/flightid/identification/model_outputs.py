"""A model's outputs on measured inputs, without noise (native side: `linear_simulation.rs`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from flightid import _native
from flightid.errors import ModelError
from flightid.models import TransferFunctionModel
from flightid.models.realisation import canonical_form

Array = NDArray[np.float64]
HOLDS = ("band_limited", "first", "zero")
FINER = 4
"""Steps within a sample in which a band-limited input is followed."""
SPLINE_DEGREE = 5


@dataclass(frozen=True)
class PairSystem:
    """State space of one response.

    Attributes
    ----------
    output, input : str
    matrices : tuple of ndarray
        A (n, n), B (n, 1), C (1, n), D (1, 1).
    delay_s : float
    """

    output: str
    input: str
    matrices: tuple[Array, ...]
    delay_s: float

    @property
    def growth_1_s(self) -> float:
        """Largest real part of a pole, 1/s; minus infinity without states."""
        poles = np.linalg.eigvals(self.matrices[0])
        return float(np.max(poles.real, initial=-np.inf))


def pair_systems(model: TransferFunctionModel) -> list[PairSystem]:
    """State spaces of the responses, one by one, so that each may have a delay of its own.

    Raises
    ------
    ModelError
        More zeros than poles, or a negative delay.
    """
    systems = []
    for response, (gain, above, below, delay) in zip(
        model.responses, model.factored().values(), strict=True
    ):
        if delay < 0.0:
            raise ModelError(
                "a negative delay cannot be simulated", found=f"{delay:g} s", needed="0 s or more"
            )
        matrices = canonical_form((1, 1), [(0, 0, gain, above, below)])
        systems.append(PairSystem(response.output, response.input, matrices, delay))
    return systems


def driven_output(system: PairSystem, values: Array, sample_time_s: float, hold: str) -> Array:
    """Output of one response from rest.

    Parameters
    ----------
    system : PairSystem
    values : ndarray, shape (n_samples,)
        The measured input.
    sample_time_s : float
    hold : {"band_limited", "first", "zero"}
        What the input does between its samples.

    Returns
    -------
    ndarray, shape (n_samples,)

    Reference
    ---------
    Unser, "Splines: a perfect fit for signal and image processing", *IEEE Signal Processing
    Magazine* 16 (1999): an interpolating spline tends to the band-limited interpolation.
    """
    if hold != "band_limited":
        return _simulate(system, values, sample_time_s, first=hold == "first")
    n = len(values)
    fine = np.arange(FINER * (n - 1) + 1) / FINER
    dense = np.asarray(make_interp_spline(np.arange(n), values, k=min(SPLINE_DEGREE, n - 1))(fine))
    # Straight lines between points weaken ω by sinc²(ωT/2) = 1 − (ωT)²/12 + …: given back here.
    dense[1:-1] -= np.diff(dense, 2) / 12.0
    return _simulate(system, dense, sample_time_s / FINER, first=True)[::FINER]


def free_outputs(system: PairSystem, n_samples: int, sample_time_s: float) -> Array:
    """What unknown states and an unknown input trim add, shape (n_samples, n_states + 1)."""
    a, b, c, d = system.matrices
    still, steady = np.zeros(n_samples), np.ones(n_samples)
    columns = [
        _run((a, b, c, d), still, start, 0.0, sample_time_s, first=True) for start in np.eye(len(a))
    ]
    columns.append(_simulate(system, steady, sample_time_s, first=True))
    return np.stack(columns, axis=1)


def _simulate(system: PairSystem, values: Array, sample_time_s: float, *, first: bool) -> Array:
    start = np.zeros(len(system.matrices[0]))
    return _run(system.matrices, values, start, system.delay_s, sample_time_s, first=first)


def _run(
    matrices: Sequence[Array],
    values: Array,
    start: Array,
    delay_s: float,
    sample_time_s: float,
    *,
    first: bool,
) -> Array:
    a, b, c, d = (np.ascontiguousarray(matrix, dtype=np.float64) for matrix in matrices)
    driven = np.ascontiguousarray(values, dtype=np.float64)[None]
    _, found = _native.simulate_linear(
        a, b, c, d, np.array([delay_s]), driven, np.ascontiguousarray(start), sample_time_s, first
    )
    return np.asarray(found[0])
