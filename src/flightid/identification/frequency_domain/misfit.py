"""What a model misses of a response beside the errors of its points, with what these share.

A cost adds decibels and degrees: errors that move all points together, as those of a long
autoregression do, make a large one by chance. A delay that is missing moves them together too, but
along another curve, where errors are small. The form in the inverse of the points' covariance, less
what the fit follows of it, tells the two apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.fit_findings import CERTAIN, CERTAIN_RATIO
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.multistart import DenseEnd
from flightid.uncertainty.response_errors import Sensitivity

Array = NDArray[np.float64]
SMALLEST = 1e-2
"""Directions of errors with a smaller share of the largest variance carry no evidence: what windows
and linear terms leave of them is larger."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class MisfitForm:
    """Squares of what one output's responses miss, by their errors.

    Attributes
    ----------
    name : str
        Of the output.
    ratio : float
        Mean square over independent directions: one on average for a model that misses nothing.
    chance : float
        Of as much by errors whose level is itself an estimate.

    Example
    -------
    >>> MisfitForm("q", 26.0, 1e-30).is_certain, MisfitForm("q", 26.0, 1e-3).is_certain
    (True, False)
    """

    name: str
    ratio: float
    chance: float

    @property
    def is_certain(self) -> bool:
        """Whether no interval by these errors holds: see `why_misfit`."""
        return self.ratio > CERTAIN_RATIO and self.chance < CERTAIN


def misfit_forms(
    end: DenseEnd,
    sensitivity: Sensitivity,
    bias: Array | None,
    errors: ErrorModel,
    selected: Sequence[SelectedResponse],
) -> list[MisfitForm]:
    """By output, what its responses miss.

    Parameters
    ----------
    end : DenseEnd
        Residuals that were minimised, and directions that the fit took out of them.
    sensitivity : Sensitivity
        Derivatives of the residuals by the points.
    bias : ndarray, shape (n_points,), or None
        Of the points, in the order of `sensitivity`: along it nothing is told.
    errors : ErrorModel
        Of the response as it was measured: what a model leaves must not count as noise.
    selected : sequence of SelectedResponse

    Reference
    ---------
    Pintelon & Schoukens, *System Identification*, 2nd ed., section 11.4 (the cost of a model that
    is right); Hotelling (1931), Annals of Mathematical Statistics 2 (levels that are estimated).
    """
    residuals = end.residuals
    edges = np.cumsum([0, *map(len, errors.covariances)])
    spans = [slice(*rows) for rows in pairwise(edges)]
    seen = [np.asarray(np.eye(len(residuals))[span] @ sensitivity) for span in spans]
    answers = [each[:, span] for each, span in zip(seen, spans, strict=True)]
    parts = [a @ each @ a.T for a, each in zip(answers, errors.covariances, strict=True)]
    moved = [] if bias is None else [np.concatenate([each @ bias for each in seen])]
    followed = np.column_stack([end.jacobian, *moved])
    size = np.linalg.norm(followed, axis=0)
    basis = np.linalg.qr(followed[:, size > 0.0] / size[size > 0.0])[0]
    common = sum(basis[s].T @ part @ basis[s] for s, part in zip(spans, parts, strict=True))
    tested, worst = [], []
    for run, span, part, answer in zip(errors.runs, spans, parts, seen, strict=True):
        own = basis[span]
        taken = own @ (own.T @ part)
        left = part - taken - taken.T + own @ common @ own.T
        scale = np.sqrt(np.maximum(np.diag(part), TINY))
        values, axes = np.linalg.eigh(left / np.outer(scale, scale))
        if not values[-1] > 0.0:
            continue
        kept = values > SMALLEST * values[-1]
        along = axes[:, kept].T @ (residuals[span] / scale)
        ratio = float(np.mean(along**2 / values[kept]))
        tested.append((selected[run.first].measured.output, ratio, int(kept.sum())))
        worst.append((axes[:, -1] / scale) @ answer)
    if not worst:
        return []
    # All outputs at once: the kernels of the errors are most of the work, and the same for each.
    freedom = errors.propagated(np.stack(worst), len(worst))[1]
    return [
        MisfitForm(name, ratio, _chance(ratio, size, float(each)))
        for (name, ratio, size), each in zip(tested, freedom, strict=True)
    ]


def why_missed(forms: Sequence[MisfitForm]) -> str:
    """Why intervals by the errors of the points do not hold; empty where they do.

    Example
    -------
    >>> why_missed([MisfitForm("q", 26.0, 1e-30), MisfitForm("p", 1.1, 0.3)])
    'the model misses q by 26 times what errors of its points explain (mean square)'
    """
    certain = [each for each in forms if each.is_certain]
    if not certain:
        return ""
    worst = max(certain, key=lambda each: each.ratio)
    return (
        f"the model misses {worst.name} by {worst.ratio:.2g} times what errors of its points "
        "explain (mean square)"
    )


def _chance(ratio: float, degrees: int, freedom: float) -> float:
    if np.isinf(freedom):
        return float(scipy.special.chdtrc(degrees, ratio * degrees))
    return float(scipy.special.fdtrc(degrees, freedom, ratio))
