"""Whether a nonlinear model runs better than the linear model of the same lags."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction.predict import predictor_of
from flightid.identification.prediction.request import Request
from flightid.identification.prediction.result import Prediction

EQUAL = 1e-9
"""Relative difference of errors that is rounding."""


def baseline_of(source: object) -> object | None:
    """The linear model that a fit keeps beside its nonlinear one; None where it has none."""
    details = getattr(source, "details", source)
    return getattr(details, "baseline", None)


def baseline_findings(
    source: object, predictions: Sequence[Prediction], request: Request
) -> tuple[Finding, ...]:
    """A warning for each record on which the linear model of the same lags runs better."""
    baseline = baseline_of(source)
    if baseline is None:
        return ()
    model, way = predictor_of(baseline)
    findings = []
    for made in predictions:
        linear = way(model, made.measured, made.outputs, request)
        for name in made.outputs:
            ours, theirs = made.rms_error[name], linear.rms_error[name]
            if ours > theirs * (1 + EQUAL):
                findings.append(
                    Finding(
                        "loses-to-linear",
                        Light.AMBER,
                        f"{made.measured.name}: the linear model of the same lags runs better "
                        f"(rms {theirs:.4g} against {ours:.4g})",
                        "use the linear model, or train on records that cover the manoeuvre",
                    )
                )
    return tuple(findings)
