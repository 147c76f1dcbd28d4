"""Gauss–Newton search with the estimator inside: there is one cost, which no step raises."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.bias_findings import ENOUGH
from flightid.identification.frequency_domain.bias_objective import Curves, Objective
from flightid.identification.frequency_domain.estimator_bias import OUTSIDE
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]

MOST_STEPS = 40
ROUNDING = 1e-9
"""Relative step of every parameter below which nothing moves."""
CURVED = 0.5
"""Share of a step's effect that its derivatives missed, from which on they are worked out anew."""
NEARBY = 1.0
"""Size of all steps since the estimator's slopes were worked out, up to which they serve for the
errors of the estimates."""
ACROSS = 0.01
"""Share of a sample by which the other side of a jump is tried."""
STRETCH, NEAR = 4.0, 0.3
"""Most by which a step is stretched or shortened, and the share below which it stays."""
SMALLEST_DAMPING, LARGEST_DAMPING = 1e-9, 1e6


@dataclass(frozen=True)
class SearchOutcome:
    """Where a search with the estimator inside ended.

    Attributes
    ----------
    end : DenseEnd
        With the residuals and derivatives of what the estimator makes of the model.
    estimates : list of ndarray
        That itself, by response.
    step : float
        Last Gauss–Newton step over the scatter of the residuals.
    begun : float
        Cost at the start.
    reason : str
        Why the search did not settle; empty where it did.
    """

    end: DenseEnd
    estimates: Curves
    step: float
    begun: float
    reason: str = ""


@dataclass
class SearchPoint:
    """A point of the search.

    Attributes
    ----------
    x : ndarray
        Values of the free parameters.
    estimates : list of ndarray
        What the estimator makes of the model there, by response.
    residuals : ndarray
    cost : float
        Their sum of squares.
    """

    x: Array
    estimates: Curves
    residuals: Array
    cost: float

    @classmethod
    def of(cls, objective: Objective, x: Array) -> SearchPoint | None:
        """At these values; None where the model cannot be followed over the records."""
        try:
            estimates = objective.estimates(x)
        except OUTSIDE:
            return None
        with np.errstate(all="ignore"):
            residuals = objective.residuals(estimates)
        if not np.all(np.isfinite(residuals)):
            return None
        return cls(x, estimates, residuals, float(residuals @ residuals))


def search(objective: Objective, start: Array) -> SearchOutcome:
    """Minimise from one start.

    The slopes that the estimator adds to the model's own change slowly: they are kept while steps
    do what they were to do.

    Raises
    ------
    FitError
        The model cannot be followed over the records at the start, or has no slopes on the way.

    Reference
    ---------
    Madsen, Nielsen & Tingleff, *Methods for Non-linear Least Squares Problems* (2004), §3.2.
    """
    here = SearchPoint.of(objective, start)
    if here is None:
        objective.estimates(start)  # says why, if it is a simulation that cannot be
        raise FitError(
            "the model cannot be followed over the records",
            found="a response of zero, or without bounds",
            needed="a simulation that stays near the measured outputs",
            action="check the structure, or fit shorter records",
        )
    free = objective.model.parameters.free
    limits = np.array([p.minimum for p in free]), np.array([p.maximum for p in free])
    bounds, begun = limits, here.cost
    # Until a step shows what the estimator adds to the slopes, they are the model's own.
    extra: Curves = [np.zeros((len(start), len(each)), complex) for each in here.estimates]
    damping, step, away = 0.0, np.inf, np.inf
    jacobian = np.zeros((0, len(start)))
    for count in range(MOST_STEPS):
        jacobian = jacobian_at(objective, here, extra)
        whole = _step(jacobian, here, bounds, 0.0)
        step = _size(jacobian, whole, here)
        small = np.all(np.abs(whole) <= ROUNDING * np.maximum(np.abs(here.x), 1e-300))
        if step <= ENOUGH or small:
            if away > NEARBY:
                extra, away = added_slopes(objective, here.x), 0.0
                continue
            step = step if step <= ENOUGH else 0.0
            beyond = None if bounds is limits else _beyond(objective, here, bounds, limits)
            if beyond is None:
                return SearchOutcome(
                    _end(here, jacobian, count, "step"), here.estimates, step, begun
                )
            here, bounds, away = beyond, limits, np.inf
            continue
        tried = _step(jacobian, here, bounds, damping) if damping else whole
        there = SearchPoint.of(objective, np.clip(here.x + tried, *bounds))
        if there is None or there.cost >= here.cost:
            cell = (
                objective.correction.cells.around(objective.at(here.x))
                if bounds is limits
                else None
            )
            if cell is not None:
                bounds = np.maximum(cell[0], limits[0]), np.minimum(cell[1], limits[1])
            elif away > 0.0:
                extra, away = added_slopes(objective, here.x), 0.0
            else:
                damping = max(10.0 * damping, 1e-3)
                if damping > LARGEST_DAMPING:
                    break
            continue
        effect = jacobian @ (there.x - here.x)
        missed = np.linalg.norm(there.residuals - here.residuals - effect)
        extra = learned_slopes(objective, extra, here, there, np.linalg.norm(jacobian, axis=0))
        away += _size(jacobian, there.x - here.x, there)
        here = _along(objective, here, there, jacobian, bounds)
        damping = 0.0 if damping <= 1e-3 else 0.1 * damping
        if missed > CURVED * np.linalg.norm(effect):
            extra, away = added_slopes(objective, here.x), 0.0
    reason = f"the search stopped {step:.2g} of the residuals' scatter away from a minimum"
    return SearchOutcome(
        _end(here, jacobian, MOST_STEPS, "stalled"), here.estimates, step, begun, reason
    )


def _along(
    objective: Objective,
    here: SearchPoint,
    there: SearchPoint,
    jacobian: Array,
    bounds: tuple[Array, Array],
) -> SearchPoint:
    """The better of a step and its stretch to the lowest point of the parabola along it.

    Where residuals curve, steps overshoot or fall short by the same share again and again.
    """
    way = there.x - here.x
    slope = 2.0 * float(here.residuals @ (jacobian @ way))
    bend = there.cost - here.cost - slope
    if bend <= 0.0:
        return there
    share = min(max(-0.5 * slope / bend, 1.0 / STRETCH), STRETCH)
    if abs(share - 1.0) < NEAR:
        return there
    better = SearchPoint.of(objective, np.clip(here.x + share * way, *bounds))
    return there if better is None or better.cost >= there.cost else better


def _beyond(
    objective: Objective,
    here: SearchPoint,
    bounds: tuple[Array, Array],
    limits: tuple[Array, Array],
) -> SearchPoint | None:
    """A lower cost just across a jump at which the search stands."""
    best = None
    for edge, limit, way in zip(bounds, limits, (-1.0, 1.0), strict=True):
        for place in np.flatnonzero((here.x == edge) & (edge != limit)):
            x = here.x.copy()
            x[place] += way * ACROSS * (bounds[1][place] - bounds[0][place])
            there = SearchPoint.of(objective, np.clip(x, *limits))
            if there is not None and there.cost < (best or here).cost:
                best = there
    return best


def _end(place: SearchPoint, jacobian: Array, count: int, termination: str) -> DenseEnd:
    return DenseEnd(place.x, place.cost, count, termination, place.residuals, jacobian)


def added_slopes(objective: Objective, x: Array) -> Curves:
    """What the estimator adds to the model's own slopes, by response, shape (n_free, n) each."""
    both = zip(objective.slopes(x), objective.model_slopes(x), strict=True)
    return [whole - own for whole, own in both]


def learned_slopes(
    objective: Objective, extra: Curves, here: SearchPoint, there: SearchPoint, scale: Array
) -> Curves:
    """The slopes that the estimator adds, made to give what the last step did.

    Reference
    ---------
    Broyden, "A class of methods for solving nonlinear simultaneous equations", *Mathematics of
    Computation* 19 (1965), of the estimator's own part alone.
    """
    way = there.x - here.x
    along = way * scale**2
    power = float(way @ along)
    if power <= 0.0:
        return extra
    found = []
    slopes = objective.model_slopes(here.x), objective.model_slopes(there.x)
    for place, known in enumerate(extra):
        own = 0.5 * (slopes[0][place] + slopes[1][place])
        missed = there.estimates[place] - here.estimates[place] - way @ (own + known)
        found.append(known + np.multiply.outer(along / power, missed))
    return found


def jacobian_at(objective: Objective, here: SearchPoint, extra: Curves) -> Array:
    """Derivatives of the residuals, from the model's own slopes and what the estimator adds.

    Raises
    ------
    FitError
        They are not finite.
    """
    own = objective.model_slopes(here.x)
    # What no fitted pair answers to leakage alone would move, until no run can be followed.
    seen = np.any([np.any(slope != 0.0, axis=1) for slope in own], axis=0)[:, None]
    slopes = [(a + b) * seen for a, b in zip(own, extra, strict=True)]
    found = objective.jacobian(here.estimates, slopes)
    if not np.all(np.isfinite(found)):
        raise FitError(
            "the responses have no finite slope where the search went",
            needed="a simulation that stays near the measured outputs",
            action="check start values and bounds, or fit shorter records",
        )
    return found


def _size(jacobian: Array, step: Array, place: SearchPoint) -> float:
    """Effect of a step on the residuals, a parameter, over their scatter."""
    scatter = np.sqrt(place.cost / len(place.residuals) * len(step))
    return float(np.linalg.norm(jacobian @ step) / max(scatter, 1e-300))


def _step(jacobian: Array, here: SearchPoint, bounds: tuple[Array, Array], damping: float) -> Array:
    """Damped Gauss–Newton step; parameters at a bound that they press against stay there."""
    gradient = jacobian.T @ here.residuals
    low, high = bounds
    held = ((here.x <= low) & (gradient > 0.0)) | ((here.x >= high) & (gradient < 0.0))
    scale = np.linalg.norm(jacobian, axis=0)
    held |= scale == 0.0
    step = np.zeros_like(here.x)
    kept = np.flatnonzero(~held)
    scaled = jacobian[:, kept] / scale[kept]
    wide = np.vstack([scaled, np.sqrt(max(damping, SMALLEST_DAMPING**2)) * np.eye(len(kept))])
    target = np.concatenate([-here.residuals, np.zeros(len(kept))])
    step[kept] = np.linalg.lstsq(wide, target, rcond=None)[0] / scale[kept]
    return step
