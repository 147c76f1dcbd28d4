"""Agreement of predictions with their records, in numbers and verdicts over all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding, told_apart
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.prediction.weights import guide_factor, guide_weights, is_vehicle
from flightid.simulation import metrics
from flightid.validation.verification.beside_noise import BesideNoise, beside_noise
from flightid.validation.verification.by_excitation import (
    followed_parts,
    weighed_by_excitation,
)
from flightid.validation.verification.foretold_error import unless_gusts
from flightid.validation.verification.muad import Mismatch
from flightid.validation.verification.of_the_fit import GUSTS, weighed
from flightid.validation.verification.refuted_parameters import QuestionedRuns
from flightid.validation.verification.result import Verification

THEIL_GUIDE = (0.25, 0.30)
THEIL = "verification-theil"
TOGETHER = "all outputs together"
J_RMS_GUIDE = (1.0, 2.0)
MOVE_MORE = "verify on a record that moves the output more"


def judge(
    predictions: tuple[Prediction, ...],
    compared: tuple[str, ...],
    request: Request,
    mismatch: Mismatch | None,
    own: Mapping[str, float],
    gusts: Mapping[str, float],
    asked: QuestionedRuns | None = None,
) -> Verification:
    """Numbers by output over all records together, and verdicts against the guides.

    `own` are errors of the fitted model in the records of its fit, by output, where it has any, and
    `gusts` what the process noise that it found makes of these runs. Gusts excuse no model that is
    refuted beside them by what was `asked`.
    """
    numbers = numbers_of(predictions, compared)
    first = predictions[0].measured
    factors = [guide_factor(first.unit(name)) for name in compared]
    j_rms = None
    if all(factor is not None for factor in factors):
        errors = [
            factor * numbers["rms_error"][name]
            for factor, name in zip(factors, compared, strict=True)
            if factor is not None
        ]
        j_rms = float(np.sqrt(np.mean(np.square(errors))))
    overall = overall_theil(predictions, compared)
    guided = j_rms if is_vehicle([first.unit(name) for name in compared]) else None
    verdicts = weighed(
        _theil_verdicts(overall, numbers["theil"], predictions), numbers["rms_error"], own
    )
    if asked is None or not asked.is_refuted:
        excused = weighed(verdicts, numbers["rms_error"], gusts, GUSTS)
        verdicts = unless_gusts(excused, predictions, () if asked is None else asked.innovations)
        verdicts = weighed_by_excitation(verdicts, followed_parts(predictions))
    found = (*verdicts.values(), *_findings(guided, predictions))
    return Verification(
        outputs=compared,
        predictions=predictions,
        overall_theil=overall,
        j_rms=j_rms,
        horizon=request.horizon,
        initial_state=predictions[0].initial_state,
        state_bias=request.state_bias,
        output_bias=request.output_bias,
        hold=request.hold,
        mismatch=mismatch,
        findings=(
            *(found if request.horizon == FREE_RUN else ()),
            *(() if mismatch is None else mismatch.findings),
        ),
        **numbers,
    )


def numbers_of(
    predictions: Sequence[Prediction], compared: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Coefficients and errors by name and output, over all records together."""
    numbers: dict[str, dict[str, float]] = {
        key: {} for key in ("theil", "rms_error", "mse", "fit_percent", "vaf", "r_squared")
    }
    for name in compared:
        pairs = [each.scored(name) for each in predictions]
        y, y_hat = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
        numbers["theil"][name] = float(metrics.theil(y, y_hat))
        numbers["rms_error"][name] = float(metrics.rms_error(y, y_hat))
        numbers["mse"][name] = float(metrics.mse(y, y_hat))
        numbers["fit_percent"][name] = float(metrics.fit_percent(y, y_hat))
        numbers["vaf"][name] = float(metrics.vaf_percent(y, y_hat))
        numbers["r_squared"][name] = float(metrics.r_squared(y, y_hat))
    return numbers


def overall_theil(predictions: Sequence[Prediction], compared: tuple[str, ...]) -> float:
    """One coefficient for all outputs, each counted in the guide's units, over all records.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eq. 14.8.
    """
    power = []
    for name in compared:
        pairs = [each.scored(name) for each in predictions]
        y, y_hat = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
        power.append([np.mean(np.square(signal)) for signal in (y - y_hat, y, y_hat)])
    weights = guide_weights(predictions[0].measured, compared)
    error, seen, said = np.sqrt(weights @ np.array(power))
    return float(error / (seen + said))


def _theil_verdicts(
    overall: float, theil: dict[str, float], predictions: Sequence[Prediction]
) -> dict[str | None, Finding]:
    """All outputs together, then each; a poor one is no red by itself where all together agree.

    An output that these inputs hardly move is mostly gust and noise, and no model predicts that.
    """
    verdict = light_of(overall, THEIL_GUIDE)
    several = len(theil) > 1
    values: list[tuple[str | None, float]] = [*theil.items()]
    values = [(None, overall), *values] if several else values
    found = {}
    for name, value in values:
        said = ""
        light = light_of(value, THEIL_GUIDE)
        if light is Light.RED and verdict is not Light.RED:
            light = Light.AMBER
        action = "" if light is Light.GREEN else "look where the prediction parts from the record"
        beside = None
        if light is not Light.GREEN and name is not None:
            beside = beside_noise(predictions, name)
        if beside is not None:
            light, said, action = _with_noise(light, beside, action)
        found[name] = Finding(
            THEIL,
            light,
            f"{name or TOGETHER}: Theil coefficient "
            f"{told_apart(value, *THEIL_GUIDE, decimals=3)}, guide at most "
            f"{THEIL_GUIDE[0]:g} to {THEIL_GUIDE[1]:g}{said}",
            action,
        )
    return found


def _with_noise(light: Light, beside: BesideNoise, action: str) -> tuple[Light, str, str]:
    """Light, further words and action of an output whose error is noise in part.

    Noise that no model explains is no misfit; where it hides the motion, nothing is told of either.
    """
    said = f"; white noise of the measurement makes {beside.noise_percent:.3g} % of the error"
    if beside.most <= THEIL_GUIDE[0]:
        return Light.GREEN, f"{said}, without it at most {beside.most:.2g}", ""
    if beside.least > THEIL_GUIDE[0]:
        return (
            light,
            f"{said}, without it at least {told_apart(beside.least, THEIL_GUIDE[0], decimals=2)}",
            action,
        )
    return Light.UNKNOWN, f"{said} and hides whether the rest is within it", MOVE_MORE


def _findings(j_rms: float | None, predictions: tuple[Prediction, ...]) -> list[Finding]:
    """What is said beside the coefficients."""
    found = []
    if j_rms is not None:
        # The guide is in absolute units, for piloted aircraft and modest inputs: no red by itself.
        light = Light.GREEN if j_rms <= J_RMS_GUIDE[1] else Light.AMBER
        found.append(
            Finding(
                "verification-j-rms",
                light,
                f"weighted error {j_rms:.3g}, guide at most {J_RMS_GUIDE[0]:g} "
                f"to {J_RMS_GUIDE[1]:g} (deg, deg/s, ft/s, ft/s²)",
                "" if light is Light.GREEN else "verify with smaller inputs, or mend the model",
            )
        )
    if any(each.shifts.input_bias is not None for each in predictions):
        found.append(
            Finding(
                "verification-nonlinear",
                Light.GREEN,
                "the model is not linear: its equations were integrated",
            )
        )
    found += _shifted_inputs(predictions)
    held = [each for each in predictions if each.diverged_at is not None]
    found += [
        Finding(
            "free-run-unstable",
            Light.RED,
            f"{each.measured.name}: the free run left its range at sample {each.diverged_at} and "
            "was held",
            "use fewer terms or a stable model, or train on records that cover the manoeuvre",
        )
        for each in held
    ]
    untold = [each for each in predictions if each.shifts.is_open]
    if untold:
        found.append(
            Finding(
                "verification-start-untold",
                Light.AMBER,
                f"the beginning of {len(untold)} of {len(predictions)} records does not tell where "
                "all states of the model start, and the run depends on it",
                "settle_s with a longer first stretch, or initial_state='trim'",
            )
        )
    return found


def _shifted_inputs(predictions: tuple[Prediction, ...]) -> list[Finding]:
    """Constants that were added to measured inputs of a nonlinear model."""
    shifts = [each.shifts.input_bias for each in predictions]
    moved = [np.abs(shift) for shift in shifts if shift is not None and np.any(shift)]
    if not moved:
        return []
    largest = np.max(moved, axis=0)
    inputs = predictions[0].predicted.inputs
    sizes = ", ".join(f"{n} {s:.3g}" for n, s in zip(inputs, largest, strict=True))
    return [
        Finding(
            "verification-inputs-shifted",
            Light.AMBER,
            f"the model ran on other inputs than the measured ones: constant shifts up to {sizes}",
            "leave state_bias out, or mend the sensors of the inputs",
        )
    ]


def light_of(value: float, guide: tuple[float, float]) -> Light:
    """Green, amber or red by the two numbers of a guide.

    Example
    -------
    >>> str(light_of(0.27, THEIL_GUIDE))
    'amber'
    """
    good, poor = guide
    return Light.GREEN if value <= good else Light.AMBER if value <= poor else Light.RED
