"""Output error in the frequency domain: a linear model driven by the records' transforms.

With X the transform of the states over a record and c = x(T) − x(0),
(jωM − F) X = G Ũ − M c and Ỹ = H₀ X + H₁ (jωX + c) + D Ũ at the harmonics of the record: the ends
need one constant for each state, estimated beside the parameters. Constants (biases, trims,
reference shifts) have no harmonic and drop out. Nothing is integrated, so unstable models are no
special case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.identification.records.delayed_inputs import delayed_inputs
from flightid.identification.records.nuisance import Nuisance
from flightid.identification.regression.fourier_integral import Harmonics
from flightid.identification.regression.rounds import Rows
from flightid.models import StateSpaceModel
from flightid.record import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class TransformedRecord:
    """One record at its harmonics.

    Attributes
    ----------
    record : Record
    grid : Harmonics
    inputs : ndarray, shape (n_inputs, n_samples)
        Time histories: a delay acts on them before the transform.
    outputs : ndarray of complex, shape (n_outputs, n_f)
        Scaled by the inverse square root of the length.
    """

    record: Record
    grid: Harmonics
    inputs: Array
    outputs: Complex

    @classmethod
    def of(
        cls, record: Record, model: StateSpaceModel, band: tuple[float, float] | None
    ) -> TransformedRecord:
        """Transform the outputs of a record.

        Raises
        ------
        UnknownNameError
            The record lacks a channel of the model.
        OptionError
            A band without meaning for this record.
        DataError
            The band holds too few harmonics.
        """
        grid = Harmonics.inside(band, record.n_samples, record.sample_time_s)
        outputs = grid.integral(record.matrix(model.outputs)) * _scale(grid)
        return cls(record, grid, record.matrix(model.inputs), outputs)


def _scale(grid: Harmonics) -> float:
    return float(1.0 / np.sqrt(grid.n_samples * grid.sample_time_s))


def _split(values: Complex) -> Array:
    """Real parts, then imaginary parts, along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)


@dataclass(frozen=True)
class FourierOutputError:
    """Residuals of all outputs at all harmonics of all records.

    Attributes
    ----------
    model : StateSpaceModel
    records : tuple of TransformedRecord
    hold : str
    """

    model: StateSpaceModel
    records: tuple[TransformedRecord, ...]
    hold: str

    def left(self, place: int) -> Array:
        """Measured transforms of one record."""
        return _split(self.records[place].outputs)

    def in_time(self, place: int, rows: Array) -> Array:
        """What the band holds of one record, back in time, (n_outputs, n_samples)."""
        grid = self.records[place].grid
        real, imaginary = np.split(rows, 2, axis=1)
        return grid.in_time(np.asarray((real + 1j * imaginary) / _scale(grid), np.complex128))

    def reach(self) -> Array:
        """Root mean square of each output's transform."""
        lefts = [self.left(place) for place in range(len(self.records))]
        size = np.sqrt(np.mean(np.concatenate(lefts, axis=1) ** 2, axis=1))
        if np.any(size == 0.0):
            still = [n for n, each in zip(self.model.outputs, size, strict=True) if each == 0.0]
            raise FitError(
                "an output does not move in the band",
                found=", ".join(still),
                needed="motion of every output of the model",
                action="leave the output out of the model, or widen the band",
            )
        return np.asarray(size)

    def rows(self, theta: Array, weights: Sequence[Array]) -> list[Rows]:
        """Residuals and slopes of each record, its ends estimated under the weights."""
        values = self.model.parameters.independent_values()
        free = self.model.parameters.free_indices
        values[free] = theta
        point = np.array([self.model.trim.get(name, 0.0) for name in self.model.point_names])
        slopes = self.model.native.linearise(values, point)[1]
        moved = self.model.native.sensitivities(values, point, free)
        return [
            self._record(values, slopes, moved, each, weight)
            for each, weight in zip(self.records, weights, strict=True)
        ]

    def _record(
        self, values: Array, slopes: Array, moved: Array, data: TransformedRecord, weight: Array
    ) -> Rows:
        n = len(self.model.states)
        grid, scale = data.grid, _scale(data.grid)
        delayed, rates, late = delayed_inputs(
            self.model, values, data.inputs, grid.sample_time_s, self.hold
        )
        driven = grid.integral(delayed) * scale
        s = 1j * grid.omega_rad_s
        # Derivative and state together, as in the frequency responses: rows are left − right.
        dynamic = s[:, None, None] * slopes[:, :n] + slopes[:, n : 2 * n]
        ends_force = np.broadcast_to(-slopes[:n, :n], (len(s), n, n))
        input_force = (-slopes[:n, 2 * n :] @ driven).T[:, :, None]
        forced = np.concatenate([ends_force, input_force], axis=2)
        solved = _solve(dynamic[:, :n], forced)
        ends_output = dynamic[:, n:] @ solved[:, :, :n] + slopes[n:, :n]
        output = (dynamic[:, n:] @ solved[:, :, n:])[:, :, 0].T + slopes[n:, 2 * n :] @ driven
        missing = _split(data.outputs - output)
        directions = _split(np.moveaxis(ends_output, 0, 2)) * weight[:, None, :]
        flat = np.swapaxes(directions, 1, 2).reshape(-1, n)
        ends = Nuisance.best(flat, (missing * weight).ravel())
        state = (solved[:, :, n] + solved[:, :, :n] @ ends.values).T
        whole = np.concatenate([s * state + ends.values[:, None], state, driven])
        by_entry = moved @ whole
        turned = np.swapaxes(dynamic, 1, 2)
        adjoint = np.swapaxes(_solve(turned[:, :, :n], turned[:, :, n:]), 1, 2)
        shift = -(grid.integral(rates) * scale)
        through = -adjoint @ slopes[:n, 2 * n :] + slopes[n:, 2 * n :]
        found = (
            by_entry[:, n:]
            - np.einsum("kpn,qnk->qpk", adjoint, by_entry[:, :n])
            + np.einsum("kpm,mq,mk->qpk", through, late, shift)
        )
        residuals = ends.removed_from((missing * weight).ravel()).reshape(weight.shape) / weight
        moving = -np.moveaxis(_split(found), 0, 2) * weight[:, :, None]
        kept = ends.removed_from(moving.reshape(flat.shape[0], -1)).reshape(moving.shape)
        return Rows(residuals, kept / weight[:, :, None])


def _solve(matrix: NDArray[Any], right: NDArray[Any]) -> Complex:
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError as error:
        raise DataError(
            "the model has no finite response at a harmonic of the record",
            found="a pole on the imaginary axis",
            needed="frequencies that are not poles of the model",
            action="start the parameters elsewhere, or change the band",
        ) from error
