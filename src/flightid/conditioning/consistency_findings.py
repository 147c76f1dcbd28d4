"""Verdicts of the consistency check: instrument errors, correlated pairs, poor fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import SingularError
from flightid.findings import Finding
from flightid.uncertainty.estimate import Estimate

CORRELATED = 0.9
INSEPARABLE = 0.99
LARGEST_CONDITION = 1e9
RATE_BIAS_RAD_S = np.deg2rad(0.5)
FORCE_BIAS_M_S2 = 0.3
SCALE_ERROR = 0.05
POOR_FIT_PERCENT = 70.0
LARGEST_DRIFT = 0.15
SMALLEST_DRIFT_RAD = 1e-4


VANES = ("alpha", "beta")
VANE = (
    "; a vane ahead of the centre of gravity looks alike: move it there first "
    "(conditioning.air_data_at_cg, or air_data_m of [[conditioning]])"
)


def require_separable(
    parameters: Sequence[str], size: NDArray[np.float64], triangle: NDArray[np.float64]
) -> None:
    """Refuse parameters whose effects on the outputs cannot be told apart.

    `size` is the norm of each effect; `triangle` is R of the effects at unit norm.

    Raises
    ------
    SingularError
        A parameter without effect, or a combination of parameters without effect.
    """
    idle = [name for name, value in zip(parameters, size, strict=True) if not value > 0]
    if idle:
        raise SingularError(
            "parameters have no effect on the outputs",
            found=", ".join(idle),
            action="leave them out of estimate=[...]",
        )
    _, values, rows = np.linalg.svd(triangle)
    if values[0] > LARGEST_CONDITION * values[-1]:
        mixed = [p for p, part in zip(parameters, rows[-1], strict=True) if abs(part) > 0.1]
        raise SingularError(
            "the record cannot tell parameters apart",
            found=", ".join(mixed),
            needed="motion that separates them",
            action="leave one of them out of estimate=[...]",
        )


def findings_of(
    parameters: Mapping[str, Estimate],
    correlation: NDArray[np.float64],
    fit_percent: Mapping[str, float | None],
    sample_time_s: float,
) -> tuple[Finding, ...]:
    """All verdicts, in the order: instruments, pairs, fits."""
    found = [
        finding
        for parameter in parameters.values()
        if parameter.is_significant and not parameter.name.endswith("_0")
        for finding in _of_parameter(parameter, sample_time_s)
    ]
    names = list(parameters)
    for i, j in zip(*np.nonzero(np.triu(np.abs(correlation) > CORRELATED, k=1)), strict=True):
        value = float(correlation[i, j])
        found.append(
            Finding(
                "correlated-pair",
                Light.RED if abs(value) > INSEPARABLE else Light.AMBER,
                f"{names[i]} and {names[j]} are correlated by {value:.3f}",
                "fly more motion of these axes, or leave one of the two out of the estimate",
            )
        )
    for name, percent in fit_percent.items():
        if percent is not None and percent < POOR_FIT_PERCENT:
            found.append(
                Finding(
                    "poor-fit",
                    Light.RED if percent < 0 else Light.AMBER,
                    f"{name} is rebuilt to {percent:.3g} % only",
                    "check units, signs, sensor position and wind; try a shorter segment",
                )
            )
    if not found:
        found.append(
            Finding("consistent", Light.GREEN, "rates, attitude and accelerations show one motion")
        )
    return tuple(found)


def drift_findings(
    noise: Mapping[str, float],
    residual_rms: Mapping[str, float],
    sample_time_s: float,
    n_samples: int,
) -> tuple[Finding, ...]:
    """Notice of integrated gyro noise that shows in the attitude."""
    found = []
    for rate, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if angle not in residual_rms:
            continue
        drift = noise[rate] * sample_time_s * np.sqrt(n_samples)
        if drift > LARGEST_DRIFT * residual_rms[angle] and drift > SMALLEST_DRIFT_RAD:
            found.append(
                Finding(
                    "gyro-noise",
                    Light.AMBER,
                    f"noise of {rate} drifts {angle} by {drift:.2g} rad over the record, beside a "
                    f"residual of {residual_rms[angle]:.2g} rad; the interval of bias_{rate} "
                    "allows for it as white noise",
                    "take a longer record for a better bias, a shorter one for a better attitude",
                )
            )
    return tuple(found)


def _of_parameter(parameter: Estimate, sample_time_s: float) -> list[Finding]:
    kind, _, channel = parameter.name.partition("_")
    half = parameter.half_width95 or 0.0
    text = f"{parameter.value:.4g} ± {half:.2g} {parameter.unit}"
    size = abs(parameter.value)
    if kind == "bias":
        limit = {"rad/s": RATE_BIAS_RAD_S, "m/s^2": FORCE_BIAS_M_S2}.get(parameter.unit)
        if limit is not None and size > limit:
            return [
                Finding(
                    "bias",
                    Light.AMBER,
                    f"{channel} has a bias of {text}",
                    "use the corrected record",
                )
            ]
    elif kind == "scale" and size > SCALE_ERROR:
        gain = 1 + parameter.value
        if gain < 0:
            return [
                Finding(
                    "sign-reversed",
                    Light.RED,
                    f"{channel} reads {gain:.3g} of the truth",
                    "check the sign convention; conditioning.flip_sign or convert_axes",
                )
            ]
        light = Light.RED if not 0.5 < gain < 2 else Light.AMBER
        return [
            Finding(
                "scale-factor",
                light,
                f"{channel} reads {gain:.4g} ± {half:.2g} of the truth",
                "check the unit" if light is Light.RED else "use the corrected record",
            )
        ]
    elif kind == "delay" and size > sample_time_s:
        return [
            Finding(
                "delay",
                Light.AMBER,
                f"{channel} lags the rates by {text}",
                f"use the corrected record, which is aligned{VANE * (channel in VANES)}",
            )
        ]
    return []
