"""Verdicts on the fit of a polynomial model, each with what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from flightid.conventions import Light
from flightid.evidence.gather import OVERFIT
from flightid.findings import Finding
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.roots import POLE, ZERO, FittedRoot
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.discrete_modes import polynomial_roots
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import LEVEL, half_width

CONVERGED = {"gradient", "step", "cost", "zero", "regression", "instruments", "kernel"}
SAMPLES_PER_COEFFICIENT = 10
AT_CIRCLE = 1e-4
SAME_MINIMUM = 1e-4
QUANTILE = half_width(LEVEL)
HARDLY_SEEN = 0.5
"""Largest share by which a pole and its zero may change the response anywhere and still be said to
cancel; a pair that may change it by more was not shown to."""

NOISE_AT_CIRCLE = "a root of C may lie on the unit circle, where errors to first order do not hold"
ELSEWHERE = "another minimum far away fits as well within chance: bars about either hold nothing"
CANCELLATION = "pole-zero-cancellation"
CANCELS = "a pole and a zero cancel within their errors, which are not Gaussian then"


def judge_polynomial(
    structure: PolynomialStructure,
    model: PolynomialModel,
    parameters: Mapping[str, Estimate],
    pairs: Sequence[tuple[FittedRoot, FittedRoot, float]],
    minima: Sequence[LocalMinimum],
    n_samples: int,
    reason: str = "",
) -> tuple[Finding, ...]:
    """All verdicts that the fit itself allows; residual tests say more."""
    return (
        *_ending(minima, reason),
        *_circle(model, reason),
        *_stability(structure, model),
        *(_cancels(*pair) for pair in pairs),
        *_overfit(structure, parameters, n_samples),
    )


def _ending(minima: Sequence[LocalMinimum], reason: str) -> list[Finding]:
    best = minima[0]
    found = []
    if best.termination not in CONVERGED:
        found.append(
            Finding(
                "not-converged",
                Light.RED,
                f"the best start ended by {best.termination}, not at a minimum",
                "raise maximum_iterations, lower the orders or give more starts",
            )
        )
    others = [
        m for m in minima[1:] if abs(m.objective - best.objective) > SAME_MINIMUM * best.objective
    ]
    if reason == ELSEWHERE:
        action = "lower the orders, fit a noise model (Box-Jenkins), or take longer records"
        found.append(Finding("local-minima", Light.AMBER, reason, action))
    elif others:
        found.append(
            Finding(
                "local-minima",
                Light.GREEN if best.count > 1 else Light.AMBER,
                f"starts found {1 + len(others)} minima; the best, found {best.count} times, "
                f"{_beside(best, min(others, key=lambda each: each.objective))}",
                "" if best.count > 1 else "give more starts to see whether it is found again",
            )
        )
    return found


def _beside(best: LocalMinimum, other: LocalMinimum) -> str:
    if not best.objective > 0.0:
        return "follows the records to the last digit, the next does not"
    ratio = other.objective / best.objective
    if ratio >= 1.0:
        return f"is {ratio:.4g} times below the next"
    return (
        f"is {1.0 / ratio:.4g} times above another, which chance explains; its errors are likelier "
        "with their colour taken out"
    )


def _circle(model: PolynomialModel, reason: str) -> list[Finding]:
    action = "difference or detrend the data less, or lower the order"
    found = [
        f"a root of F of {name} lies at the unit circle, where intervals do not hold"
        for name, row in zip(_over_each(model), model.distinct_f, strict=True)
        if np.max(np.abs(polynomial_roots(row)), initial=0.0) > 1.0 - AT_CIRCLE
    ]
    if reason == NOISE_AT_CIRCLE:
        found.append(f"{reason}: they have no intervals")
    return [Finding("root-at-circle", Light.AMBER, words, action) for words in found]


def _over_each(model: PolynomialModel) -> tuple[str, ...]:
    """Inputs over each F."""
    alone = len(model.distinct_f) == len(model.inputs)
    return model.inputs if alone else (", ".join(model.inputs),)


def _stability(structure: PolynomialStructure, model: PolynomialModel) -> list[Finding]:
    size = np.max(np.abs(polynomial_roots(np.asarray(model.a))), initial=0.0)
    if structure.enforce_stability and size > 1.0 - AT_CIRCLE:
        return [
            Finding(
                "stability-enforced",
                Light.AMBER,
                f"A was held inside the unit circle (largest root {size:.6f}); without that it "
                "would leave it",
                "compare with enforce_stability=False; the vehicle may be unstable or drifting",
            )
        ]
    if size > 1.0:
        return [
            Finding(
                "unstable-model",
                Light.AMBER,
                f"A has a root of size {size:.6g}: the free run grows",
                "judge it by predictions a few samples ahead, or take enforce_stability=True",
            )
        ]
    return []


def cancelling(
    model: PolynomialModel, roots: Sequence[FittedRoot]
) -> list[tuple[FittedRoot, FittedRoot, float]]:
    """Pairs whose difference their joint error explains and that hardly change the response.

    On the unit circle a pole p and a zero q multiply the response by (z - q)/(z - p) =
    1 + (p - q)/(z - p), which is at most |p - q|/|1 - |p|| from one. That share, which comes with
    each pair, has to be small up to the end of the gap's interval: a zero that may lie anywhere
    cancels nothing.
    """
    found: list[tuple[FittedRoot, FittedRoot, float]] = []
    covariance = model.covariance
    if covariance is None:
        return found
    for pole in (root for root in roots if root.kind == POLE):
        for zero in (root for root in roots if root.kind == ZERO):
            if pole.response != zero.response or pole.gradient is None or zero.gradient is None:
                continue
            if (pole.z.imag == 0.0) != (zero.z.imag == 0.0):
                continue
            gap = pole.z - zero.z
            rate = pole.gradient - zero.gradient
            n = 2 if pole.z.imag else 1
            rows = np.array([rate.real, rate.imag][:n])
            errors = rows @ covariance @ rows.T
            distance = np.array([gap.real, gap.imag][:n])
            statistic = float(distance @ np.linalg.pinv(errors) @ distance)
            # Rounding leaves a pair that cannot move apart a variance below zero.
            widest = max(float(np.max(np.linalg.eigvalsh(errors))), 0.0)
            spread = QUANTILE * float(np.sqrt(widest))
            seen = (abs(gap) + spread) / abs(1.0 - abs(pole.z))
            if statistic < scipy.special.chdtri(n, 0.05) and seen < HARDLY_SEEN:
                found.append((pole, zero, seen))
    return found


def _cancels(pole: FittedRoot, zero: FittedRoot, seen: float) -> Finding:
    return Finding(
        CANCELLATION,
        Light.AMBER,
        f"{pole.response}: pole {pole.z:.4g} and zero {zero.z:.4g} cancel within their errors and "
        f"change the response by {100 * seen:.2g} % at most: they have no intervals",
        f"lower na or nf and nb by {2 if pole.z.imag else 1}: the data do not show this mode",
    )


def _overfit(
    structure: PolynomialStructure, parameters: Mapping[str, Estimate], n_samples: int
) -> list[Finding]:
    found = []
    d = structure.n_parameters
    if n_samples < SAMPLES_PER_COEFFICIENT * d and structure.kernel is None:
        found.append(
            Finding(
                "few-samples",
                Light.AMBER,
                f"{n_samples} samples for {d} coefficients",
                f"use at least {SAMPLES_PER_COEFFICIENT * d} samples, fewer coefficients, or "
                "kernel='tc' for ARX",
            )
        )
    last = [f"{letter}{n}" for letter, n in zip("acd", _degrees(structure), strict=True) if n]
    useless = [name for name in last if _covers_zero(parameters[name])]
    if useless:
        found.append(
            Finding(
                OVERFIT,
                Light.GREEN,
                f"the last coefficient of a polynomial may be zero: {', '.join(useless)}",
                "try the next lower order (flightid.scan_orders ranks them by free run)",
            )
        )
    return found


def _degrees(structure: PolynomialStructure) -> tuple[int, int, int]:
    return structure.na, structure.nc, structure.nd


def _covers_zero(parameter: Estimate) -> bool:
    if parameter.interval95 is None:
        return False
    return parameter.interval95[0] <= 0.0 <= parameter.interval95[1]
