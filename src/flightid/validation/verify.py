"""The verb `verify`: drive a model with recorded inputs and compare, shifts aside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import ModelError, OptionError, UnitError, UnknownNameError
from flightid.findings import Finding
from flightid.record import Channel, Record, Step
from flightid.simulation.simulate import Hold, LinearModel
from flightid.units import canonical, conversion_factor, same_dimension
from flightid.validation import metrics
from flightid.validation.shifts import Freedom, Shifts, predict
from flightid.validation.verification import Prediction, Verification

ANGULAR = {"rad": "deg", "deg": "deg", "rad/s": "deg/s", "deg/s": "deg/s"}
LINEAR = ("ft/s", "ft/s^2")
"""One deg, deg/s, ft/s and ft/s² count the same in J_rms (Tischler & Remple, section 14.4)."""
THEIL_GUIDE = (0.25, 0.30)
J_RMS_GUIDE = (1.0, 2.0)


def verify(
    model: object,
    records: Record | Sequence[Record],
    *,
    free_bias: bool = True,
    free_reference: bool = True,
    initial: Literal["trim", "fit"] = "trim",
    outputs: Sequence[str] | None = None,
    hold: Hold = "first",
) -> Verification:
    """Drive a model with the measured inputs of records and compare its outputs.

    ``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) + y_ref``: a free run over the
    whole record. Nothing of the model changes; state biases b, reference shifts y_ref and, with
    ``initial="fit"``, the initial state are solved for by weighted least squares in each record,
    since they belong to the record. u_ref is the record's declared trim, or zero.

    Assumes: records that were not used in the fit, and start in trim unless the initial state is
    fitted. Biased when the record is short against the slowest mode: a free initial state can then
    imitate a response. For an unstable model fit the initial state and keep records short.

    Parameters
    ----------
    model : Fit or model
        A fit, or anything with inputs, outputs and state_space().
    records : Record or sequence of Record
        What to predict; they hold the model's inputs and outputs by name and unit.
    free_bias, free_reference : bool
        Solve for state biases and reference shifts.
    initial : {"trim", "fit"}
        Start at rest, or from a state that is solved for.
    outputs : sequence of str, optional
        Outputs to compare; default: those of the model that every record holds.
    hold : {"first", "zero"}
        What inputs do between samples, as for `flightid.simulate`.

    Returns
    -------
    Verification

    Raises
    ------
    ModelError
        The model cannot be simulated.
    OptionError
        No record, or an option that is not known.
    UnknownNameError
        A record lacks an input, or none of the outputs.
    UnitError
        A unit of the model and one of a record differ.
    DataError
        The free run diverges, or an output does not change.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., chapter 14.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.simulation.simulate import LinearSystem, simulate
    >>> time_s = np.arange(500) * 0.02
    >>> lag = LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> truth = simulate(lag, Record.from_arrays(time_s, inputs={"u": np.sign(np.sin(time_s))}))
    >>> slower = LinearSystem([[-1.6]], [[1.6]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> result = verify(slower, truth.replace({"y": truth["y"] + 5.0}))
    >>> 0.02 < result.theil["y"] < 0.06
    True
    """
    flown = (records,) if isinstance(records, Record) else tuple(records)
    if not flown:
        raise OptionError("there is nothing to verify on", needed="one record or more")
    if initial not in ("trim", "fit"):
        raise OptionError("initial is not known", found=initial, needed="'trim' or 'fit'")
    if hold not in ("first", "zero"):
        raise OptionError("hold is not known", found=hold, needed="'first' or 'zero'")
    linear = _linear_model(model)
    compared = _compared(linear, flown, outputs)
    for record in flown:
        _require_units(linear, record, compared)
    freedom = Freedom(free_bias, free_reference, initial == "fit")
    predictions = tuple(_predict(linear, record, compared, freedom, hold) for record in flown)
    return _judged(predictions, compared, initial, freedom, hold)


def _linear_model(model: object) -> LinearModel:
    """The model itself, or the one inside a fit."""
    inner = getattr(model, "model", model)
    if not isinstance(inner, LinearModel):
        raise ModelError(
            "the model cannot be simulated",
            found=type(model).__name__,
            needed="a fit, or an object with inputs, outputs and state_space()",
        )
    return inner


def _compared(
    model: LinearModel, records: tuple[Record, ...], outputs: Sequence[str] | None
) -> tuple[str, ...]:
    for name in outputs or ():
        if name not in model.outputs:
            raise UnknownNameError(
                "the model has no such output", found=name, needed=", ".join(model.outputs)
            )
    wanted = tuple(model.outputs if outputs is None else outputs)
    held = tuple(name for name in wanted if all(name in record for record in records))
    if not held or (outputs is not None and held != wanted):
        raise UnknownNameError(
            "a record lacks what the model predicts",
            found=", ".join(records[0].channels),
            needed=", ".join(wanted),
        )
    return held


def _require_units(model: LinearModel, record: Record, compared: tuple[str, ...]) -> None:
    units = getattr(model, "units", None) or {}
    for name in (*model.inputs, *compared):
        expected = units.get(name)
        if expected is not None and canonical(expected) != record.unit(name):
            raise UnitError(
                f"channel {name!r} has another unit in the record than in the model",
                found=record.unit(name),
                needed=canonical(expected),
                action="convert the record with to_units",
            )


def _predict(
    model: LinearModel,
    record: Record,
    compared: tuple[str, ...],
    freedom: Freedom,
    hold: Hold,
) -> Prediction:
    a, b, c, d, delays_s = (np.ascontiguousarray(m, dtype=np.float64) for m in model.state_space())
    rows = [list(model.outputs).index(name) for name in compared]
    trim = record.trim
    measured = record.matrix(compared)
    offset = np.array([[trim.get(name, 0.0)] for name in compared])
    driven = record.matrix(model.inputs)
    driven = driven - np.array([[trim.get(name, 0.0)] for name in model.inputs])
    predicted, shifts = predict(
        (a, b, np.ascontiguousarray(c[rows]), np.ascontiguousarray(d[rows]), delays_s),
        driven,
        measured - offset,
        record.sample_time_s,
        freedom=freedom,
        weights=_weights(record, compared),
        first_order_hold=hold == "first",
    )
    total = Shifts(
        shifts.bias,
        shifts.reference + offset[:, 0],
        shifts.initial_state,
        shifts.n_free,
        shifts.rank,
    )
    known = record.channels
    channels = [known[name] for name in model.inputs]
    channels += [
        Channel(name, known[name].unit, known[name].role, "predicted") for name in compared
    ]
    made = record.replace(
        dict(zip(compared, predicted + offset, strict=True)),
        channels=channels,
        step=Step("verify", {"hold": hold}),
    )
    return Prediction(record, made, total)


def _weights(record: Record, compared: tuple[str, ...]) -> NDArray[np.float64]:
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


def _judged(
    predictions: tuple[Prediction, ...],
    compared: tuple[str, ...],
    initial: str,
    freedom: Freedom,
    hold: str,
) -> Verification:
    numbers: dict[str, dict[str, float]] = {
        key: {} for key in ("theil", "rms_error", "mse", "fit_percent", "vaf", "r_squared")
    }
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
    return Verification(
        outputs=compared,
        predictions=predictions,
        j_rms=j_rms,
        initial=initial,
        free_bias=freedom.bias,
        free_reference=freedom.reference,
        hold=hold,
        findings=_findings(numbers["theil"], j_rms, predictions),
        **numbers,
    )


def _findings(
    theil: dict[str, float], j_rms: float | None, predictions: tuple[Prediction, ...]
) -> tuple[Finding, ...]:
    found = []
    for name, value in theil.items():
        light = _light(value, THEIL_GUIDE)
        found.append(
            Finding(
                "verification-theil",
                light,
                f"{name}: Theil coefficient {value:.3f}, guide at most {THEIL_GUIDE[0]:g} "
                f"to {THEIL_GUIDE[1]:g}",
                "" if light is Light.GREEN else "look where the prediction parts from the record",
            )
        )
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
    return tuple(found)


def _light(value: float, guide: tuple[float, float]) -> Light:
    good, poor = guide
    return Light.GREEN if value <= good else Light.AMBER if value <= poor else Light.RED
