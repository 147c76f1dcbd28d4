"""Output error in the frequency domain: a linear model driven by the records' transforms.

Between samples the inputs are what their hold says, so the states at the samples obey
x⁺ = Φ x + q exactly (`records/held_model.py`). With z = exp(jωT), X and Q the sums of states and
of q times z⁻ᵏ over a record and c = x(T) − x(0), (zI − Φ) X = Q − z c and Y = C X + V at its
harmonics: the ends need one constant for each state, estimated beside the parameters. Constants
(biases, trims, reference shifts) have no harmonic and drop out. Nothing is integrated, so unstable
models are no special case.

Reference: Pintelon & Schoukens, *System Identification*, 2nd ed., §6.3.2 (the plant's extended
transfer function in the z domain: exact for held inputs).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.frozen import dataclass
from flightid.identification.records.held_model import HeldModel, LinearPoint
from flightid.identification.records.nuisance import Nuisance
from flightid.identification.regression.harmonics import Harmonics
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
        Time histories: hold and delay act on them before the transform.
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
        outputs = grid.total(record.matrix(model.outputs)) * _scale(grid)
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

    def renewed(self, theta: Array) -> FourierOutputError:  # noqa: ARG002
        """Nothing is held."""
        return self

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
        values[self.model.parameters.free_indices] = theta
        point = LinearPoint.of(self.model, values)
        steps = {each.grid.sample_time_s for each in self.records}
        held = {step: HeldModel.of(point, step, self.hold) for step in steps}
        return [
            self._record(held[each.grid.sample_time_s], each, weight)
            for each, weight in zip(self.records, weights, strict=True)
        ]

    @staticmethod
    def _record(held: HeldModel, data: TransformedRecord, weight: Array) -> Rows:
        grid, phi, seen = data.grid, held.transition, held.output
        taps = grid.total(held.taps(data.inputs)) * _scale(grid)
        pushes, through = held.weighed(taps)
        dynamic = grid.turn[:, None, None] * np.eye(phi.shape[1]) - phi[0]
        # One row of C (zI − Φ)⁻¹ for each output; what the ends add follows it.
        adjoint = np.swapaxes(
            _solve(
                np.swapaxes(dynamic, 1, 2),
                np.broadcast_to(seen[0].T, (len(dynamic), *seen[0].T.shape)),
            ),
            1,
            2,
        )
        forced = _solve(dynamic, pushes[0].T[:, :, None])[:, :, 0].T
        missing = _split(data.outputs - seen[0] @ forced - through[0])
        ends_output = -grid.turn[:, None, None] * adjoint
        directions = _split(np.moveaxis(ends_output, 0, 2)) * weight[:, None, :]
        flat = np.swapaxes(directions, 1, 2).reshape(-1, phi.shape[1])
        ends = Nuisance.best(flat, (missing * weight).ravel())
        late = np.multiply.outer(grid.turn, ends.values)[:, :, None]
        state = forced - _solve(dynamic, late)[:, :, 0].T
        moved = phi[1:] @ state + pushes[1:]
        found = np.einsum("kpn,qnk->qpk", adjoint, moved) + seen[1:] @ state + through[1:]
        residuals = ends.removed_from((missing * weight).ravel()).reshape(weight.shape) / weight
        moving = -np.moveaxis(_split(found), 0, 2) * weight[:, :, None]
        kept = ends.removed_from(moving.reshape(flat.shape[0], -1)).reshape(moving.shape)
        own = ends.space.reshape(*weight.shape, -1)
        return Rows(residuals, kept / weight[:, :, None], own)


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
