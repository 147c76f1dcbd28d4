"""What injected excitations make of the inputs in a closed loop: instruments that know no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.identification.prediction_error.linear_regression import reflected, regress
from flightid.models.polynomial.structure import INSTRUMENTS, REFINED, PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.record import Record
from flightid.record.hold import common_loop
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
LONGEST, ROWS_PER_COEFFICIENT = 30, 20
"""Most lags of the regression from excitation to input, and rows that each coefficient has."""


def with_excitations(
    structure: PolynomialStructure, data: SampledChannels, records: Sequence[Record]
) -> SampledChannels:
    """The channels with what was injected, where a method needs it and the records hold it.

    Instruments need it where a loop was closed, or nothing tells that it was open: in a closed loop
    the inputs carry the noise. A loop that is known to be open keeps its inputs, which tell more.

    Parameters
    ----------
    structure : PolynomialStructure
    data : SampledChannels
        Of the records.
    records : sequence of Record

    Raises
    ------
    DataError
        The records do not hold an excitation for each input, and refined instruments need it.
    """
    if structure.method == REFINED:
        moved = _injected(structure, records)
        if moved is None:
            raise DataError(
                "the records do not tell what was injected",
                found=f"excitations {', '.join(records[0].excitations) or 'none'}",
                needed=f"one that moves for each input, {', '.join(structure.inputs)}",
                action="name what was injected as excitations, or fit by prediction_error: armax "
                "and bj hold a noise model, so that a loop does not bias them",
            )
        return replace(data, excitations=moved)
    known = common_loop([each.input_shape for each in records])
    if structure.method != INSTRUMENTS or known == "open":
        return data
    moved = _injected(structure, records)
    return data if moved is None else replace(data, excitations=moved)


def is_injected(structure: PolynomialStructure, records: Sequence[Record]) -> bool:
    """Whether the records hold an excitation that moves for each input."""
    return _injected(structure, records) is not None


def _injected(structure: PolynomialStructure, records: Sequence[Record]) -> Array | None:
    """Excitations that move, without their means; None where they are fewer than the inputs."""
    names = records[0].excitations
    alike = all(each.excitations == names for each in records)
    if not alike or len(names) < len(structure.inputs):
        return None
    rows = [np.concatenate([each[n] - each[n].mean() for each in records]) for n in names]
    moved = [row for row in rows if np.ptp(row) > 0.0]
    return np.array(moved) if len(moved) >= len(names) else None


def noise_free_inputs(data: SampledChannels) -> Array:
    """Inputs as the excitations alone move them, shape (n_inputs, n_samples).

    A long regression of each input on its own past and the excitations, run free from rest. How
    good it is moves the variance of estimates by instruments, not their consistency. Without
    excitations the inputs themselves.

    Reference
    ---------
    Gilson & Van den Hof, "Instrumental variable methods for closed-loop system identification",
    Automatica 41 (2005), 241-249; Söderström & Stoica (1989), section 10.4.
    """
    injected = data.excitations
    if injected is None:
        return data.inputs
    n = len(injected)
    room = sum(data.lengths) // (ROWS_PER_COEFFICIENT * (n + 1))
    degree = max(1, min(LONGEST, room, min(data.lengths) // 4))
    return np.array([_driven(row, injected, data, degree) for row in data.inputs])


def _driven(row: Array, injected: Array, data: SampledChannels, degree: int) -> Array:
    n = len(injected)
    theta = regress(
        row, injected, data.lengths, degree, [degree] * n, [0] * n, levels=data.levels
    ).shortest
    below = reflected(np.concatenate([[1.0], theta[:degree]]))
    made = np.zeros_like(row)
    for moved, above in zip(injected, np.split(theta[degree:], n), strict=True):
        for span in data.spans:
            made[span] += filtered(above, below, moved[span])
    return made
