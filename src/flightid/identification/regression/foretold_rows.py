"""Inputs at neighbouring lags beside what a regression leaves of its rows: what they foretell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.regression.harmonics import Harmonics
from flightid.identification.regression.rounds import Rows
from flightid.identification.rival_fits import judged
from flightid.uncertainty.fitted_correlation import LAGS, FittedCorrelation
from flightid.uncertainty.foretold_harmonics import FittedHarmonics, HarmonicResponse

Array = NDArray[np.float64]
SHARE = 4
"""Samples, and rows of harmonics, for each lag."""


@dataclass(frozen=True, eq=False)
class DrivenHarmonics:
    """What moved one record, at the harmonics of its fit.

    Attributes
    ----------
    grid : Harmonics
    inputs : ndarray, shape (n_inputs, n_samples)
    ahead : int
        Samples by which a row answers to inputs that come later: equations of motion hold what
        moves over the interval that begins at a sample.
    """

    grid: Harmonics
    inputs: Array
    ahead: int = 0

    def lagged(self, n_lags: int) -> Array:
        """Transforms at neighbouring lags, (n_inputs, n_lags, 2 n_f)."""
        about = self.inputs - self.inputs.mean(axis=1, keepdims=True)
        samples = np.pad(about, ((0, 0), (0, self.ahead)), mode="edge")[:, self.ahead :]
        return self.grid.lagged(samples, n_lags)


def foretold_harmonics(
    rows: Sequence[Rows], weights: Sequence[Array], driven: Sequence[DrivenHarmonics]
) -> tuple[FittedCorrelation, ...]:
    """Correlations of inputs with what a fit leaves at harmonics; none where nobody asks."""
    if not judged():
        return ()
    fewest = min(min(each.inputs.shape[1], 2 * each.grid.numbers.size) for each in driven)
    n_lags = min(LAGS, fewest // SHARE) + 1
    records = [
        FittedHarmonics(
            each.residuals * weight,
            weight,
            each.slopes * weight[:, :, None],
            each.own,
            moved.lagged(n_lags),
            moved.grid.omega_rad_s,
        )
        for each, weight, moved in zip(rows, weights, driven, strict=True)
    ]
    lags = np.arange(n_lags) - max(each.ahead for each in driven)
    return HarmonicResponse(records, lags).correlations()


def leading(inputs: Array, half_width: int, count: int) -> Array:
    """Inputs beside local means, the last sample that each mean holds at its place."""
    first = 2 * half_width + 1
    return inputs[:, first : first + count]


def of_centres(
    found: Sequence[FittedCorrelation], half_width: int
) -> tuple[FittedCorrelation, ...]:
    """The same correlations with lags from the centre of each local mean."""
    return tuple(replace(each, lags=each.lags - half_width) for each in found)
