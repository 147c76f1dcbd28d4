"""Output-error fit of the instrument errors: Levenberg-Marquardt on the triangle of a QR.

A loop of its own beside the native one of model fits: kinematics give outputs and slopes in one
pass, so a trial point is a linearisation already, and the measured inputs, noise and all, drive it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.conditioning.consistency_findings import require_separable
from flightid.conditioning.kinematics import KinematicModel, KinematicOutputs
from flightid.errors import DataError, FitError, OptionError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
ROUNDS = 8
LARGEST_STEPS = 60
SETTLED = 1e-9
MOST_DAMPING = 1e9


@dataclass(frozen=True)
class _FitPoint:
    """A point of the fit with its prediction and the sum of its weighed squares."""

    theta: Array
    prediction: KinematicOutputs
    cost: float


@dataclass(frozen=True)
class OutputError:
    """Least squares of weighed residuals.

    Attributes
    ----------
    model : KinematicModel
        Model of the outputs.
    observed : ndarray, shape (n_outputs, n)
        Measured outputs.
    """

    model: KinematicModel
    observed: Array

    def fit(self, theta: Array) -> tuple[Array, KinematicOutputs, Array]:
        """Estimate, its prediction, and the residual deviations by which it weighed the outputs.

        Raises
        ------
        SingularError
            Parameters that the record cannot tell apart.
        DataError
            The reconstructed pitch angle reaches 90 degrees at the start values.
        FitError
            The iteration does not settle.
        """
        reach = np.maximum(np.ptp(self.observed, axis=1), 1e-9)
        deviations = 0.1 * reach
        try:
            prediction = self.model.predict(theta)
        except OptionError as error:
            raise too_steep(str(error)) from error
        for _ in range(ROUNDS):
            theta, prediction = self._settle(theta, prediction, deviations)
            residuals = self.observed - prediction.values
            # The floor keeps an output that fits to rounding from taking all the weight.
            fresh = np.maximum(np.sqrt(np.mean(residuals**2, axis=1)), 1e-7 * reach)
            settled = bool(np.all(np.abs(fresh / deviations - 1) < 1e-3))
            deviations = fresh
            if settled:
                break
        return theta, prediction, deviations

    def _settle(
        self, theta: Array, prediction: KinematicOutputs, deviations: Array
    ) -> tuple[Array, KinematicOutputs]:
        """Best parameters for these weights."""
        place = _FitPoint(theta, prediction, self._cost(prediction, deviations))
        damping = 0.0
        for _ in range(LARGEST_STEPS):
            triangle, target, size = self._triangle(place.prediction, deviations)
            trial, gain = None, 0.0
            while trial is None:
                step = _damped(triangle, target, damping)
                gain = float(np.sum((triangle @ step) ** 2))
                trial = self._trial(place, step / size, deviations)
                if trial is None and (gain <= SETTLED * place.cost or damping > MOST_DAMPING):
                    return place.theta, place.prediction
                if trial is None:
                    damping = max(10 * damping, 1e-3)
            place = trial
            damping = damping / 10 if damping > 1e-8 else 0.0
            if gain <= SETTLED * place.cost:
                return place.theta, place.prediction
        raise FitError(
            "the consistency fit does not settle",
            found=f"{LARGEST_STEPS} steps",
            action="estimate fewer instrument errors, or take a calmer record",
        )

    def _triangle(
        self, prediction: KinematicOutputs, deviations: Array
    ) -> tuple[Array, Array, Array]:
        """Triangle of the weighed slopes at unit columns, its right side, and the columns' size."""
        slopes = (prediction.slopes / deviations[:, None, None]).reshape(
            -1, prediction.slopes.shape[-1]
        )
        residual = ((self.observed - prediction.values) / deviations[:, None]).ravel()
        size = np.linalg.norm(slopes, axis=0)
        scaled = slopes / np.where(size > 0, size, 1.0)
        # The residual rides as one more column: no orthogonal factor is formed.
        whole = np.asarray(np.linalg.qr(np.column_stack((scaled, residual)), mode="r"))
        triangle = whole[:-1, :-1]
        require_separable(self.model.parameters, size, triangle)
        return triangle, whole[:-1, -1], size

    def _trial(self, place: _FitPoint, step: Array, deviations: Array) -> _FitPoint | None:
        """The place after a step, or None where it is no better or not reachable."""
        try:
            prediction = self.model.predict(place.theta + step)
        except OptionError:
            return None
        cost = self._cost(prediction, deviations)
        return _FitPoint(place.theta + step, prediction, cost) if cost < place.cost else None

    def _cost(self, prediction: KinematicOutputs, deviations: Array) -> float:
        return float(np.sum(((self.observed - prediction.values) / deviations[:, None]) ** 2))


def _damped(triangle: Array, target: Array, damping: float) -> Array:
    n = target.size
    rows = np.vstack((triangle, np.sqrt(damping) * np.eye(n)))
    return np.asarray(np.linalg.lstsq(rows, np.concatenate((target, np.zeros(n))), rcond=None)[0])


def too_steep(found: str) -> DataError:
    """Refusal of an attitude that Euler angles cannot describe."""
    return DataError(
        "the attitude cannot be rebuilt in Euler angles",
        found=found,
        needed="pitch angles inside ±85 degrees",
        action="take a segment without such pitch, or check the units of the rates",
    )
