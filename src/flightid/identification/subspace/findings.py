"""Verdicts on the fit of an innovations model, each with what to do."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction_error.roots import POLE, FittedRoot
from flightid.identification.subspace.order import OrderChoice
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.sampled.recursion import spectral_radius

AT_CIRCLE = 1e-3
PREDICTOR_AT_CIRCLE = (
    "a pole of the predictor may lie on the unit circle, where errors to first order do not hold"
)


def judge_innovations(
    structure: SubspaceStructure,
    model: InnovationsModel,
    order: OrderChoice,
    roots: Sequence[FittedRoot],
    termination: str,
    spare: str,
    at_circle: bool,
) -> tuple[Finding, ...]:
    """All verdicts that the fit itself allows; residual tests say more."""
    return (
        *_ending(structure, termination),
        *_order(order),
        *_spare(spare),
        *_predictor(at_circle=at_circle),
        *_stability(model),
        *_uncertain(roots),
    )


def _ending(structure: SubspaceStructure, termination: str) -> list[Finding]:
    if not structure.refine:
        return [
            Finding(
                "not-refined",
                Light.AMBER,
                "a subspace estimate has no intervals of its own",
                "refine=True continues to prediction errors, which give them",
            )
        ]
    if termination in ("iterations", "rounds"):
        return [
            Finding(
                "not-converged",
                Light.AMBER,
                f"the refinement ended by {termination}",
                "raise maximum_iterations or lower the order",
            )
        ]
    return []


def _predictor(*, at_circle: bool) -> list[Finding]:
    if not at_circle:
        return []
    return [
        Finding(
            "root-at-circle",
            Light.AMBER,
            f"{PREDICTOR_AT_CIRCLE}: poles, zeros and gains have no intervals",
            "difference or detrend the data less, or lower the order",
        )
    ]


def _order(order: OrderChoice) -> list[Finding]:
    others = order.rivals
    if not others:
        return []
    words = ", ".join(f"{name} says {n}" for name, n in others.items())
    return [
        Finding(
            "order-disputed",
            Light.AMBER,
            f"the model has {order.chosen} states; {words}",
            "compare the orders in free run on records not used here",
        )
    ]


def _spare(reason: str) -> list[Finding]:
    if not reason:
        return []
    action = "lower the order: a mode that is not there takes away from what is known of others"
    return [Finding("order-too-high", Light.AMBER, f"{reason}; there are no intervals", action)]


def _stability(model: InnovationsModel) -> list[Finding]:
    a, _, c, _, k = model.matrices
    found = []
    radius = spectral_radius(a)
    if radius >= 1.0:
        found.append(
            Finding(
                "unstable-model",
                Light.AMBER,
                f"the model is unstable: largest |pole| {radius:.4g}",
                "right for an unstable vehicle; otherwise lower the order or take off offsets",
            )
        )
    if spectral_radius(a - k @ c) > 1.0 - AT_CIRCLE:
        found.append(
            Finding(
                "predictor-at-circle",
                Light.AMBER,
                "the predictor hardly forgets: a zero of the noise model lies on the unit circle",
                "look for outputs differenced or detrended, or a lower order",
            )
        )
    return found


def _uncertain(roots: Sequence[FittedRoot]) -> list[Finding]:
    """A mode whose interval of damping or frequency is as wide as its value is not determined."""
    weak = []
    for root in roots:
        omega = root.natural_frequency
        if root.kind == POLE and omega is not None and omega.interval95 is not None:
            low, high = omega.interval95
            if high - low > 2 * omega.value:
                weak.append(root)
    if not weak:
        return []
    places = ", ".join(f"z = {root.z:.4g}" for root in weak)
    return [
        Finding(
            "undetermined-modes",
            Light.AMBER,
            f"natural frequencies whose interval holds zero: {places}",
            "lower the order, or excite these frequencies longer",
        )
    ]
