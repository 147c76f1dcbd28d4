"""What is said of a correction of the estimator's bias: how it went, and how large it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.uncertainty.response_errors import DECIBEL, DEGREE

Array = NDArray[np.float64]

ENOUGH = 1e-2
"""Last step over the scatter of the residuals at which a correction has settled."""
TOLERABLE = 0.1
"""Such a step at which a correction that ran out of steps is still kept."""


@dataclass(frozen=True)
class Size:
    """Size of a correction over the fitted points of one response, root mean squares.

    Attributes
    ----------
    magnitude_db, phase_deg : float
    standard_errors : float or None
        Size over the standard error of the point; None where that is not known.
    """

    magnitude_db: float
    phase_deg: float
    standard_errors: float | None


@dataclass(frozen=True)
class BiasOutcome:
    """How a correction went.

    Attributes
    ----------
    reason : str
        Why nothing was corrected; empty where it was.
    possible : bool
        Whether the weights of the estimate are known at all.
    steps : int
    last : float
        Last step over the scatter of the residuals.
    sizes : mapping of str to Size
        By response.
    """

    reason: str = ""
    possible: bool = True
    steps: int = 0
    last: float = 0.0
    sizes: Mapping[str, Size] = field(default_factory=dict)

    @property
    def applied(self) -> bool:
        """Whether the bias was taken out."""
        return not self.reason

    @property
    def failed(self) -> bool:
        """Whether it could have been taken out and was not: estimates then have no intervals."""
        return self.possible and not self.applied

    @property
    def converged(self) -> bool:
        """Whether the parameters stood still."""
        return self.applied and self.last <= ENOUGH

    @property
    def withheld(self) -> str:
        """Why there are no intervals; empty where there are."""
        return f"leakage of the estimate is not corrected: {self.reason}" if self.failed else ""

    def findings(self) -> list[Finding]:
        """The verdict."""
        if self.failed:
            return [
                Finding(
                    "estimator-bias-not-corrected",
                    Light.RED,
                    "leakage and resolution of the estimate were not corrected, so there are no "
                    f"intervals: {self.reason}",
                    "estimate the response with longer windows, simplify the model, or fit the "
                    "records themselves with method='output_error'",
                )
            ]
        if not self.applied:
            return [
                Finding(
                    "estimator-bias-not-corrected",
                    Light.AMBER,
                    f"leakage and resolution of the estimate were not corrected: {self.reason}",
                    "fit a response that was estimated from records",
                )
            ]
        texts = []
        for name, size in self.sizes.items():
            errors = size.standard_errors
            share = "" if errors is None else f", {errors:.2g} standard errors"
            texts.append(f"{name} {size.magnitude_db:.2g} dB and {size.phase_deg:.2g}°{share}")
        end = "" if self.converged else f"; the last was {self.last:.2g} of the residuals' scatter"
        return [
            Finding(
                "estimator-bias",
                Light.GREEN if self.converged else Light.AMBER,
                f"estimator's leakage and resolution, taken out in {self.steps} steps{end} (rms): "
                + "; ".join(texts),
                "" if self.converged else "widen the windows or simplify the model",
            )
        ]

    def provenance(self, hold: str) -> dict[str, object]:
        """Plain values of what was done."""
        return {
            "applied": self.applied,
            "reason": self.reason,
            "hold": hold,
            "steps": self.steps,
            "converged": self.converged,
            "responses": {name: vars(size).copy() for name, size in self.sizes.items()},
        }


def sizes(
    before: Sequence[SelectedResponse], after: Sequence[SelectedResponse], errors: ErrorModel
) -> dict[str, Size]:
    """Size of the correction by response."""
    result, known = {}, variances(before, errors)
    for one, other, variance in zip(before, after, known, strict=True):
        ratio = np.log(one.response / other.response)
        distance = np.abs(one.response - other.response)
        share = None
        if variance is not None and np.all(variance > 0.0):
            share = float(np.sqrt(np.mean(distance**2 / variance)))
        result[one.name] = Size(
            float(np.sqrt(np.mean((DECIBEL * ratio.real) ** 2))),
            float(np.sqrt(np.mean((DEGREE * ratio.imag) ** 2))),
            share,
        )
    return result


def variances(selected: Sequence[SelectedResponse], errors: ErrorModel) -> list[Array | None]:
    """Variance of each complex point, by response."""
    result: list[Array | None] = []
    for run, covariance in zip(errors.runs, errors.covariances, strict=True):
        diagonal = np.diag(covariance)
        both = diagonal[: len(diagonal) // 2] + diagonal[len(diagonal) // 2 :]
        counts = [len(each.places) for each in selected[run.first : run.first + run.count]]
        result += np.split(both, np.cumsum(counts)[:-1])
    return result or [None] * len(selected)
