"""What a model leaves of the measured outputs, with unknown initial states and trims fitted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.models import GreyBoxModel
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.simulation.model_outputs import (
    Modes,
    between_samples,
    driven_outputs,
    free_outputs,
    split_modes,
    systems_of,
)

Array = NDArray[np.float64]
Places = NDArray[np.intp]

LARGEST_RESIDUAL = 10.0
"""Largest residual, in multiples of the measured output's rms, before a simulation is not believed:
a loop may hold an output well below its disturbances, but no model that is right diverges so."""
_RANK = 1e-9
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class _Motion:
    """One system of a model over records of one length.

    Attributes
    ----------
    modes : list of Modes
    inputs : list of int
        Its inputs among those of the records.
    rows, places : list of int
        Fitted outputs among those of the records, and of the system.
    """

    modes: list[Modes]
    inputs: list[int]
    rows: list[int]
    places: list[int]


@dataclass(frozen=True)
class _Unknown:
    """Motion by unknown initial states and trims in each fitted output, ready for least squares.

    Attributes
    ----------
    bases : ndarray, shape (n_outputs, n, k)
        Orthonormal in each output.
    triangles : ndarray, shape (n_outputs, k, n_unknowns)
        Each output's motion is its basis times its triangle.
    """

    bases: Array
    triangles: Array

    @classmethod
    def of(cls, free: Array) -> _Unknown:
        """Of motions, shape (n_unknowns, n_outputs, n)."""
        free = free - free.mean(axis=2, keepdims=True)
        free = free / np.maximum(np.linalg.norm(free, axis=(1, 2), keepdims=True), TINY)
        bases, triangles = np.linalg.qr(free.transpose(1, 2, 0))
        return cls(bases, triangles)

    def less(self, rest: Array) -> Array:
        """Take out the motion that fits best in all outputs together, shape (n_outputs, n).

        Fitted to each output by itself, so many unknowns would take what little a record says of
        its lowest frequencies with them. Outputs count by what they leave in such a fit of their
        own.
        """
        rest = rest - rest.mean(axis=1, keepdims=True)
        inside = np.einsum("ynk,yn->yk", self.bases, rest, optimize=True)
        scales = []
        for basis, triangle, part, each in zip(
            self.bases, self.triangles, inside, rest, strict=True
        ):
            alone = np.linalg.lstsq(triangle, part, rcond=_RANK)[0]
            scales.append(max(float(np.std(each - basis @ (triangle @ alone))), TINY))
        scale = np.array(scales)
        stacked = self.triangles / scale[:, None, None]
        target = (inside / scale[:, None]).ravel()
        found = np.linalg.lstsq(stacked.reshape(len(target), -1), target, rcond=_RANK)[0]
        moved = (self.bases @ (self.triangles @ found)[:, :, None])[:, :, 0]
        return np.asarray(rest - moved)


@dataclass(frozen=True)
class ModelResiduals:
    """Measured less modelled outputs of all records, for model after model.

    Attributes
    ----------
    linear : LinearEstimate
        Holds the records.
    outputs : tuple of str
        Names of the outputs of the records.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.
    """

    linear: LinearEstimate
    outputs: tuple[str, ...]
    hold: str

    def of(self, model: GreyBoxModel) -> list[Array]:
        """Residuals of each record, shape (n_out, n_samples) each.

        Outputs that no response of the model needs stay as they are. Motion from unknown states
        depends on the length of a record only.

        Raises
        ------
        DataError
            The model diverges on the records.
        """
        fitted = {each.output for each in model.responses}
        kept = np.array([row for row, name in enumerate(self.outputs) if name in fitted])
        known: dict[int, tuple[list[_Motion], _Unknown]] = {}
        found = []
        for measured, between in zip(self.linear.output_records, self._between, strict=True):
            n = measured.shape[1]
            if n not in known:
                known[n] = self._motion(model, kept, n)
            motions, unknown = known[n]
            rest = measured.copy()
            for each in motions:
                driven = driven_outputs(
                    each.modes, between[each.inputs], self.linear.sample_time_s, self.hold
                )
                rest[each.rows] -= driven[each.places]
            if not np.all(np.isfinite(rest)):
                raise self._diverges(kept, "a simulation without bounds")
            rest[kept] = unknown.less(rest[kept])
            self._check(kept, rest, measured)
            found.append(rest)
        return found

    @cached_property
    def _between(self) -> list[Array]:
        """Inputs of each record, with what they do between their samples."""
        return [between_samples(each, self.hold) for each in self.linear.input_records]

    def _motion(self, model: GreyBoxModel, kept: Places, n: int) -> tuple[list[_Motion], _Unknown]:
        step = self.linear.sample_time_s
        motions, free = [], []
        for each in systems_of(model):
            modes = split_modes(each, n * step)
            inputs = [self.linear.inputs.index(name) for name in each.inputs]
            rows = [k for k in kept if self.outputs[k] in each.outputs]
            places = [each.outputs.index(self.outputs[k]) for k in rows]
            motions.append(_Motion(modes, inputs, rows, places))
            moving = free_outputs(modes, n, step)
            wide = np.zeros((len(moving), len(kept), n))
            wide[:, np.searchsorted(kept, rows)] = moving[:, places]
            free.append(wide)
        together = np.concatenate(free)
        if not np.all(np.isfinite(together)):
            raise self._diverges(kept, "a simulation without bounds")
        return motions, _Unknown.of(together)

    def _check(self, kept: Places, left: Array, measured: Array) -> None:
        for row in kept:
            if np.std(left[row]) > LARGEST_RESIDUAL * np.std(measured[row]):
                ratio = float(np.std(left[row]) / max(np.std(measured[row]), TINY))
                found = f"a residual {ratio:.0f} times the measured output"
                raise self._diverges(np.array([row]), found)

    def _diverges(self, rows: Places, found: str) -> DataError:
        names = ", ".join(self.outputs[row] for row in rows)
        return DataError(
            f"the model cannot be followed over the records of output {names}",
            found=found,
            needed="a simulation that stays near the measured output",
            action="check the structure, or fit shorter records",
        )
