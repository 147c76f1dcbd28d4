"""What a fitted model leaves of a response's records, asked of when gains or files need it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.estimator_bias import OUTSIDE, Correction
from flightid.models import GreyBoxModel
from flightid.responses.estimators.by_window import NarrowResidual


@dataclass(frozen=True, eq=False)
class AnswerBySize:
    """How far a response lies from that of small motion, as the size of the records moves it.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    share : ndarray, shape (n_f,)
        Of the response, with two standard errors of the term that makes it.
    ratio : float
        Of that term to its standard error.
    """

    omega_rad_s: NDArray[np.float64]
    share: NDArray[np.float64]
    ratio: float


@dataclass(frozen=True, eq=False)
class LeftByModel:
    """Errors of a fitted model that its parameters do not hold, by ``"output/input"``.

    Attributes
    ----------
    correction : Correction
        Of the response as it was measured.
    fitted : GreyBoxModel
        With the estimates.
    band_rad_s : tuple of float
        In which it was fitted.
    """

    correction: Correction
    fitted: GreyBoxModel
    band_rad_s: tuple[float, float]

    def __getstate__(self) -> dict[str, object]:
        # Weights of an estimate are functions, which no other process can be given.
        return {"narrow": self.narrow, "by_size": self.by_size}

    @cached_property
    def narrow(self) -> dict[str, list[NarrowResidual]]:
        """What each of the longest windows alone makes of what the model leaves."""
        try:
            found = self.correction.left_by_window(self.fitted, self.band_rad_s)
        except OUTSIDE:
            return {}
        omega = self.correction.data.omega_rad_s
        return {
            name: [each.relative(*place, curve, omega) for each in found]
            for name, place, curve in self._pairs
        }

    @cached_property
    def by_size(self) -> dict[str, AnswerBySize]:
        """Pairs whose answer depends on the size of the motion beyond chance."""
        try:
            found = self.correction.size_terms(self.fitted, self.band_rad_s[0])
            if not any(each.stands_out for each in found):
                return {}
            seen = self.correction.estimated([each.answers for each in found])
        except OUTSIDE:
            return {}
        made = {}
        for name, (row, column), curve in self._pairs:
            term = found[row]
            if term.stands_out:
                share = term.most * np.abs(seen[row, column] / curve)
                made[name] = AnswerBySize(self.correction.data.omega_rad_s, share, term.ratio)
        return made

    @cached_property
    def _pairs(self) -> list[tuple[str, tuple[int, int], NDArray[np.complex128]]]:
        """Name, place in the response and curve of each response of the model that it holds."""
        data, model = self.correction.data, self.fitted
        curves = model.frequency_response(data.omega_rad_s)
        made = []
        for each in model.responses:
            place = data.outputs.index(each.output), data.inputs.index(each.input)
            curve = curves[model.outputs.index(each.output), model.inputs.index(each.input)]
            if np.all(curve != 0.0):
                made.append((f"{each.output}/{each.input}", place, curve))
        return made
