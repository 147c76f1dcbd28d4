"""The composite of several window lengths: one smooth estimate without splicing by hand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.responses.estimators.conditioned import ConditionalSpectra

COHERENCE_WEIGHT = 5.0
"""Weight of the coherence among the five terms of the cost."""
SMALLEST_PART = 0.05
"""A real or imaginary part is scaled by itself, but by no less than this share of the magnitude.

The published cost divides by each part; near 0° or 90° one of them vanishes and would take the
whole weight.
"""
MAXIMUM_STEPS = 40
MAXIMUM_HALVINGS = 30
TOLERANCE = 1e-11
ROUNDING = 1e-13


@dataclass(frozen=True)
class Composite:
    """Composite spectra of each (output, input) pair, shape (n_out, n_in, n_f) each.

    Attributes
    ----------
    input_auto, output_auto : ndarray
    cross : ndarray of complex
    n_independent : ndarray
        Weighted number of independent windows.
    weights : ndarray, shape (n_windows, n_out, n_in, n_f)
        Weight of each window length; zero where it does not hold two cycles.
    parts : tuple of ConditionalSpectra
        One for each window length.
    scale : ndarray, shape (5, n_out, n_in, n_f)
        Scales of the four unknowns and of the coherence.
    """

    input_auto: NDArray[np.float64]
    output_auto: NDArray[np.float64]
    cross: NDArray[np.complex128]
    n_independent: NDArray[np.float64]
    weights: NDArray[np.float64]
    parts: tuple[ConditionalSpectra, ...]
    scale: NDArray[np.float64]

    @property
    def response(self) -> NDArray[np.complex128]:
        """Composite response."""
        return self.cross / self.input_auto

    @property
    def coherence(self) -> NDArray[np.float64]:
        """Composite partial coherence."""
        power = np.maximum(self.input_auto * self.output_auto, np.finfo(float).tiny)
        return np.clip(np.abs(self.cross) ** 2 / power, 0.0, 1.0)

    @cached_property
    def sensitivity(self) -> NDArray[np.float64]:
        """Change of the response with that of each window length.

        Shape (n_windows, 2, 2, n_out, n_in, n_f).

        ``[i, a, b]``: change of part a (real, imaginary) of the composite response for a change of
        part b of the response of window length i.
        """
        solution = [self.input_auto, self.output_auto, self.cross.real, self.cross.imag]
        unknown = np.array(solution) / self.scale[:4]
        return _sensitivity(self.parts, self.weights, unknown, self.scale)


def combine(parts: Sequence[ConditionalSpectra], valid: NDArray[np.bool_]) -> Composite:
    """Solve the composite problem at every frequency of every pair.

    The cost is a sum over windows of squares of the unknowns less each window's value, so it
    depends on the windows through weighted means alone: at each frequency four unknowns meet five
    residuals, and the Gauss–Newton matrix is the identity plus one outer product.

    Parameters
    ----------
    parts : sequence of ConditionalSpectra
        One for each window length.
    valid : ndarray of bool, shape (n_windows, n_f)
        Where a window length may be used; at least one at each frequency.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., equations
    10.9–10.14.
    """
    weights = _weights(parts, valid)
    total = weights.sum(axis=0)
    cross = np.array([part.cross for part in parts])
    values = np.array(
        [
            [part.input_auto for part in parts],
            [part.output_auto for part in parts],
            np.real(cross),
            np.imag(cross),
            [part.coherence for part in parts],
        ]
    )
    squared = weights**2
    start = (values * squared).sum(axis=1) / squared.sum(axis=0)
    target = (values * weights).sum(axis=1) / total
    scale = _scales(start)
    unknown = _solve(start[:4] / scale[:4], target / scale, scale)
    solution = unknown * scale[:4]
    n_independent = np.array([part.n_independent for part in parts])
    return Composite(
        solution[0],
        solution[1],
        solution[2] + 1j * solution[3],
        np.tensordot(n_independent, weights, 1) / total,
        weights / total,
        tuple(parts),
        scale,
    )


def _weights(parts: Sequence[ConditionalSpectra], valid: NDArray[np.bool_]) -> NDArray[np.float64]:
    """``(ε_i / ε_min)⁻⁴``, zero where a window length is not valid."""
    error = np.array([part.random_error for part in parts])
    error = np.maximum(error, np.finfo(float).eps)
    usable = np.broadcast_to(valid[:, None, None, :], error.shape)
    smallest = np.min(np.where(usable, error, np.inf), axis=0)
    return np.asarray(np.where(usable, (error / smallest) ** -4.0, 0.0))


def _scales(start: NDArray[np.float64]) -> NDArray[np.float64]:
    tiny = np.finfo(float).tiny
    floor = SMALLEST_PART * np.hypot(start[2], start[3])
    scale = np.abs(start)
    scale[2:4] = np.maximum(scale[2:4], floor)
    return np.maximum(scale, tiny)


def _coherence_and_slope(
    x: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coherence over its scale at the scaled unknowns, and its gradient."""
    a, b = x[0], x[1]
    re, im = x[2] * scale[2], x[3] * scale[3]
    power = a * b * scale[0] * scale[1] * scale[4]
    # A channel that never moves has no power, and its coherence is not a number.
    with np.errstate(divide="ignore", invalid="ignore"):
        value = (re**2 + im**2) / power
        slope = np.stack(
            [-value / a, -value / b, 2.0 * re * scale[2] / power, 2.0 * im * scale[3] / power]
        )
    return value, slope


def _solve(
    start: NDArray[np.float64], target: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Gauss–Newton at every place by itself, steps halved where the cost would rise."""
    found = _native.composite(
        np.ascontiguousarray(start).reshape(-1),
        np.ascontiguousarray(target).reshape(-1),
        np.ascontiguousarray(scale).reshape(-1),
        coherence_weight=COHERENCE_WEIGHT,
        steps=MAXIMUM_STEPS,
        halvings=MAXIMUM_HALVINGS,
        tolerance=TOLERANCE,
        rounding=ROUNDING,
    )
    return found.reshape(start.shape)


def _sensitivity(
    parts: Sequence[ConditionalSpectra],
    shares: NDArray[np.float64],
    x: NDArray[np.float64],
    scale: NDArray[np.float64],
) -> NDArray[np.float64]:
    """First-order change of the composite with each window's response, weights held fixed.

    Output noise moves a window's cross-spectrum by ``G_xx δH``, its output spectrum by
    ``2 G_xx Re(H* δH)`` and so its coherence; the implicit function theorem does the rest.
    """
    _, slope = _coherence_and_slope(x, scale)
    bent = 1.0 + COHERENCE_WEIGHT * np.sum(slope**2, axis=0)
    input_auto = x[0] * scale[0]
    response = (x[2] * scale[2] + 1j * x[3] * scale[3]) / input_auto
    found = np.empty((len(parts), 2, 2, *response.shape))
    for index, part in enumerate(parts):
        output_auto = np.maximum(part.output_auto, np.finfo(float).tiny)
        for column, direction in enumerate((1.0, 1.0j)):
            along = np.real(np.conj(part.response) * direction)
            output_change = 2.0 * part.input_auto * along
            coherence_change = output_change * (1.0 - part.coherence) / output_auto
            change = np.stack(
                [
                    np.zeros_like(along),
                    output_change / scale[1],
                    part.input_auto * np.real(direction) / scale[2],
                    part.input_auto * np.imag(direction) / scale[3],
                ]
            )
            pull = change + COHERENCE_WEIGHT * slope * (coherence_change / scale[4])
            pull -= COHERENCE_WEIGHT * slope * np.sum(slope * pull, axis=0) / bent
            pull *= shares[index]
            cross = pull[2] * scale[2] + 1j * pull[3] * scale[3]
            moved = cross / input_auto - response * pull[0] * scale[0] / input_auto
            found[index, 0, column], found[index, 1, column] = moved.real, moved.imag
    return found
