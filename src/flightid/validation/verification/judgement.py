"""Agreement of predictions with their records, in numbers and verdicts over all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.units import conversion_factor, same_dimension
from flightid.validation import metrics
from flightid.validation.verification.muad import Mismatch
from flightid.validation.verification.result import Prediction, Verification
from flightid.validation.verification.shifts import Freedom

ANGULAR = {"rad": "deg", "deg": "deg", "rad/s": "deg/s", "deg/s": "deg/s"}
LINEAR = ("ft/s", "ft/s^2")
"""One deg, deg/s, ft/s and ft/s² count the same in J_rms (Tischler & Remple, section 14.4)."""
THEIL_GUIDE = (0.25, 0.30)
J_RMS_GUIDE = (1.0, 2.0)

GROWTH_E_FOLDS = 4.6
"""Growth by a factor of 100 over a record: less leaves its beginning in command of its end."""


def guide_weights(record: Record, compared: tuple[str, ...]) -> NDArray[np.float64]:
    """Guide weights; by the deviation of the channel where it is of another kind."""
    found = []
    for name in compared:
        factor = _guide_factor(record.unit(name))
        if factor is None:
            spread = float(np.std(record[name]))
            factor = 1.0 / spread if spread > 0 else 1.0
        found.append(factor**2)
    return np.array(found)


def _guide_factor(unit: str) -> float | None:
    """What one of `unit` counts in J_rms; None where the guide does not name its kind."""
    # Angles have no dimension, so they go by name: a percentage is not an angle.
    if unit in ANGULAR:
        return conversion_factor(unit, ANGULAR[unit])
    for guide in LINEAR:
        if same_dimension(unit, guide):
            return conversion_factor(unit, guide)
    return None


def judge(
    predictions: tuple[Prediction, ...],
    compared: tuple[str, ...],
    initial_state: str,
    freedom: Freedom,
    hold: str,
    mismatch: Mismatch | None,
) -> Verification:
    """Numbers by output over all records together, and verdicts against the guides."""
    numbers: dict[str, dict[str, float]] = {
        key: {} for key in ("theil", "rms_error", "mse", "fit_percent", "vaf", "r_squared")
    }
    power = []
    for name in compared:
        # About the mean of each measured record: how a constant is shared between trim, bias and
        # reference shift must not change a number, and an offset must not flatter it.
        y, y_hat = (
            np.concatenate(
                [getattr(each, side)[name] - np.mean(each.measured[name]) for each in predictions]
            )
            for side in ("measured", "predicted")
        )
        numbers["theil"][name] = float(metrics.theil(y, y_hat))
        numbers["rms_error"][name] = float(metrics.rms_error(y, y_hat))
        numbers["mse"][name] = float(metrics.mse(y, y_hat))
        numbers["fit_percent"][name] = float(metrics.fit_percent(y, y_hat))
        numbers["vaf"][name] = float(metrics.vaf_percent(y, y_hat))
        numbers["r_squared"][name] = float(metrics.r_squared(y, y_hat))
        power.append([np.mean(np.square(signal)) for signal in (y - y_hat, y, y_hat)])
    first = predictions[0].measured
    factors = [_guide_factor(first.unit(name)) for name in compared]
    j_rms = None
    if all(factor is not None for factor in factors):
        errors = [
            factor * numbers["rms_error"][name]
            for factor, name in zip(factors, compared, strict=True)
            if factor is not None
        ]
        j_rms = float(np.sqrt(np.mean(np.square(errors))))
    # One number for all outputs, each counted in the guide's units: the verdict of the reference.
    error, seen, said = np.sqrt(guide_weights(first, compared) @ np.array(power))
    overall = float(error / (seen + said))
    return Verification(
        outputs=compared,
        predictions=predictions,
        overall_theil=overall,
        j_rms=j_rms,
        initial_state=initial_state,
        state_bias=freedom.bias,
        output_bias=freedom.reference,
        hold=hold,
        mismatch=mismatch,
        findings=(
            *_findings(overall, numbers["theil"], j_rms, predictions),
            *(() if mismatch is None else mismatch.findings),
        ),
        **numbers,
    )


def _theil_findings(overall: float, theil: dict[str, float]) -> list[Finding]:
    """All outputs together, then each; a poor one is no red by itself where all together agree.

    An output that these inputs hardly move is mostly gust and noise, and no model predicts that.
    """
    verdict = _light(overall, THEIL_GUIDE)
    several = len(theil) > 1
    values = {"all outputs together": overall, **theil} if several else theil
    found = []
    for name, value in values.items():
        light = _light(value, THEIL_GUIDE)
        if light is Light.RED and verdict is not Light.RED:
            light = Light.AMBER
        action = "" if light is Light.GREEN else "look where the prediction parts from the record"
        found.append(
            Finding(
                "verification-theil",
                light,
                f"{name}: Theil coefficient {value:.3f}, guide at most {THEIL_GUIDE[0]:g} "
                f"to {THEIL_GUIDE[1]:g}",
                action,
            )
        )
    return found


def _findings(
    overall: float,
    theil: dict[str, float],
    j_rms: float | None,
    predictions: tuple[Prediction, ...],
) -> tuple[Finding, ...]:
    found = _theil_findings(overall, theil)
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
    if any(each.shifts.input_shift is not None for each in predictions):
        found.append(
            Finding(
                "verification-nonlinear",
                Light.GREEN,
                "the model is not linear: its equations were integrated, and a state bias is a "
                "constant shift of each input",
            )
        )
    short = [each for each in predictions if each.shifts.rank < each.shifts.n_free]
    if short:
        found.append(
            Finding(
                "verification-shifts-not-unique",
                Light.UNKNOWN,
                f"{len(short)} of {len(predictions)} records cannot tell all shifts apart; the "
                "smallest were taken, and the prediction does not depend on the choice",
            )
        )
    return (*found, *_growth(predictions))


def _growth(predictions: tuple[Prediction, ...]) -> tuple[Finding, ...]:
    longest = max(
        (each.shifts.e_folds for each in predictions if np.any(each.shifts.initial_state)),
        default=0.0,
    )
    if longest < GROWTH_E_FOLDS:
        return ()
    return (
        Finding(
            "verification-growth",
            Light.UNKNOWN,
            f"a mode grows by exp({longest:.3g}) over a record, so its part of the free run is "
            "set by the whole record, not by its beginning: it is explained rather than predicted",
            "cut the record into shorter ones to see it predicted",
        ),
    )


def _light(value: float, guide: tuple[float, float]) -> Light:
    good, poor = guide
    return Light.GREEN if value <= good else Light.AMBER if value <= poor else Light.RED
