"""Records and halves of each, compared by the weights of chosen terms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.narx.candidates import product_columns
from flightid.identification.narx.details import ChosenTerm
from flightid.identification.narx.regressors import Regressors
from flightid.models.narx.structure import NarxStructure
from flightid.uncertainty.agreement import AgreementTest
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import white_covariance

Array = NDArray[np.float64]


def compare_weights(
    structure: NarxStructure, chosen: Sequence[ChosenTerm], data: Regressors, covariance: Array
) -> AgreementTest | None:
    """Compare parts of the samples that the weights were estimated on.

    Parameters
    ----------
    structure : NarxStructure
    chosen : sequence of ChosenTerm
    data : Regressors
    covariance : ndarray, shape (n, n)
        Of the weights, by white errors.

    Returns
    -------
    AgreementTest or None
        None where radial functions were chosen, or more terms than samples.

    Assumes
    -------
    White errors one step ahead, and terms as chosen.
    """
    spare = data.target.size - len(chosen)
    if spare < 1 or any(item.term.centre for item in chosen):
        return None
    columns = product_columns([item.term for item in chosen], structure, data.vectors).T
    errors = data.target - columns @ np.array([item.weight for item in chosen])
    size = float(np.sqrt(errors @ errors / spare))
    if not size > 0.0:
        return None
    ends = np.cumsum(data.lengths)[:-1]
    blocks = [
        RecordBlock.of(part[None] / size, np.zeros((1, len(part), 0)), rest[None] / size)
        for part, rest in zip(np.split(columns, ends), np.split(errors, ends), strict=True)
    ]
    return white_covariance(blocks, covariance, float(spare))
