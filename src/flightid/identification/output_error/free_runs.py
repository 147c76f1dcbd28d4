"""Free runs of a fitted model beside its records, made one by one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.output_error.equation_records import EquationRuns
from flightid.identification.records.setup import OwnNumbers, RecordSet
from flightid.models import GreyBoxModel

Array = NDArray[np.float64]


def runs_by_record(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    own: Sequence[OwnNumbers],
) -> Iterator[tuple[Array, Array]]:
    """Outputs and slopes by record, made as they are asked for: of long records they are large."""
    for place, numbers in enumerate(own):
        yield run_with_slopes(fitted, prepared, runs_of, place, numbers)


def keeping_outputs(
    runs: Iterable[tuple[Array, Array]], outputs: list[Array]
) -> Iterator[tuple[Array, Array]]:
    """The same runs; their outputs are kept beside."""
    for found, slopes in runs:
        outputs.append(found)
        yield found, slopes


def runs_of_own(
    prepared: RecordSet, runs: Iterable[tuple[Array, Array]], noise: Array
) -> list[Array]:
    """Free runs beside which noise on the states is looked for, where records differ.

    Each at its own estimates, one step of Gauss and Newton from the common ones: what vehicles
    differ by follows the model's modes too, and is no turbulence.
    """
    whitener = np.linalg.inv(np.linalg.cholesky(noise))
    found = []
    for (_, measured, _), (outputs, slopes) in zip(prepared.arrays, runs, strict=True):
        white = np.tensordot(whitener, slopes, axes=1).reshape(measured.size, -1)
        size = np.linalg.norm(white, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        residual = (whitener @ (measured - outputs)).ravel()
        found.append(outputs + slopes @ (np.linalg.lstsq(white / size, residual)[0] / size))
    return found
