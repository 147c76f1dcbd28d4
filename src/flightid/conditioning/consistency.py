"""Kinematic consistency: whether rates, attitude, accelerations and velocities are one motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from flightid.conditioning.align import align
from flightid.conditioning.coloured_residuals import corrected_covariance
from flightid.conditioning.consistency_findings import (
    drift_findings,
    findings_of,
    require_separable,
)
from flightid.conditioning.consistency_result import InstrumentParameter, KinematicConsistency
from flightid.conditioning.kinematics import (
    FORCES,
    INPUTS,
    OUTPUTS,
    RATES,
    STATES,
    UNITS,
    VELOCITIES,
    KinematicModel,
    Prediction,
    rotation_rows,
)
from flightid.errors import DataError, FitError, OptionError, UnknownNameError
from flightid.record import Record, Step
from flightid.table import Cell
from flightid.units import require_match

Array = NDArray[np.float64]
ROUNDS = 6
STEEPEST_RAD = np.deg2rad(85.0)
UNIT_OF_KIND = {"scale": "1", "delay": "s"}


def check_consistency(
    record: Record,
    *,
    channels: Mapping[str, str] | None = None,
    estimate: Iterable[str] | None = None,
) -> KinematicConsistency:
    """Rebuild attitude and velocity from rates and accelerations; estimate instrument errors.

    The kinematic equations φ̇ = p + tan θ (q sin φ + r cos φ), …, u̇ = r v − q w − g sin θ + a_x, …
    are integrated from the measured rates and specific forces and compared with the measured
    outputs. Biases, scale factors, delays and the initial state are estimated by output error with
    exact derivatives; each output is weighed by its own residual, in rounds. Input: ``measured =
    (1 + scale) true + bias``. Output: ``measured(t) = (1 + scale) true(t − delay) + bias``, so a
    delay is the lag of an output behind the rates.

    Standard errors are corrected for coloured residuals. Pairs of parameters that the record cannot
    tell apart are named in the findings. Where noise of the gyros, integrated over the record, is
    not small against the attitude's own noise, the finding ``"gyro-noise"`` says so: intervals of
    the rate biases are then too narrow (a random walk is no stationary residual).

    Assumes: a rigid body, flat non-rotating earth, rates and accelerations whose noise is small
    against the outputs' own; with V, alpha, beta: still air or steady wind. Biased when: sensors
    sit away from the centre of gravity (use `accelerations_at_cg` first), or the attitude comes
    from an estimator that is itself driven by these gyros and has already removed their bias.

    Parameters
    ----------
    record : Record
        Data in rad, rad/s, m/s, m/s². Needs p, q, r and at least one of phi, theta, psi; velocities
        (u, v, w; vn, ve, vd; V, alpha, beta) are used if ax, ay, az are there as well.
    channels : mapping of str to str, optional
        Channel of the record by the name used here, where the two differ.
    estimate : iterable of str, optional
        Instrument errors to estimate: ``"bias_p"``, ``"scale_q"``, ``"delay_phi"``, …; default:
        biases of all inputs, scale factors of the rates whose angle is measured, delays of all
        outputs. Initial states are always estimated.

    Returns
    -------
    KinematicConsistency

    Raises
    ------
    UnknownNameError
        A channel or parameter that is not there.
    UnitError
        A channel in another unit.
    DataError
        Too few channels or samples, or attitude beyond 90 degrees of pitch.
    SingularError
        Parameters that the record cannot tell apart at all; the message names them.
    FitError
        The iteration does not settle.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 10 (data compatibility); Jategaonkar,
    Flight Vehicle System Identification, chapter 10; Morelli & Klein (1997), J. Guidance 20(1).

    Example
    -------
    >>> time_s = np.arange(1500) / 50
    >>> rate = np.cos(time_s)
    >>> record = Record.from_arrays(time_s, outputs={"p": 1.05 * rate + 0.02, "q": 0 * rate,
    ...     "r": 0 * rate, "phi": np.sin(time_s), "theta": 0 * rate},
    ...     units={"p": "rad/s", "q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad"})
    >>> found = check_consistency(record, estimate=["bias_p", "scale_p"])
    >>> {name: round(p.value, 4) for name, p in found.parameters.items() if "p" == name[-1]}
    {'bias_p': 0.02, 'scale_p': 0.05}
    """
    source = _sources(record, channels or {})
    inputs = {name: record[source[name]] for name in INPUTS if name in source}
    measured = {name: record[source[name]] for name in OUTPUTS if name in source}
    for name in {"phi", "psi"} & set(measured):
        measured[name] = np.unwrap(measured[name])
    if "theta" in measured and np.max(np.abs(measured["theta"])) > STEEPEST_RAD:
        raise _too_steep(f"{np.rad2deg(np.max(np.abs(measured['theta']))):.1f} degrees")
    errors = _chosen(estimate, inputs, measured)
    states = [name for name in STATES if _is_seen(name, measured)]
    parameters = (*(f"{name}_0" for name in states), *errors)
    if record.n_samples < 10 * len(parameters):
        raise DataError(
            "the record is too short for the parameters",
            found=f"{record.n_samples} samples, {len(parameters)} parameters",
            needed="ten samples for each parameter",
        )
    model = KinematicModel(record.time_s, inputs, tuple(measured), parameters)
    observed = np.array(list(measured.values()))
    start = _first_state(measured)
    start |= _first_scales(inputs, measured)
    theta = np.array([start.get(name.removesuffix("_0"), 0.0) for name in parameters])
    theta, deviations = _fit(model, observed, theta)
    prediction = model.predict(theta)
    residuals = observed - prediction.values
    white, covariance = corrected_covariance(prediction.slopes, residuals, deviations)
    spread = np.sqrt(np.diag(white))
    found = {
        name: InstrumentParameter(name, float(value), float(error), _unit(name))
        for name, value, error in zip(parameters, theta, np.sqrt(np.diag(covariance)), strict=True)
    }
    rms = {name: float(np.sqrt(np.mean(r**2))) for name, r in zip(measured, residuals, strict=True)}
    fit = {
        name: 100 * (1 - rms[name] / float(np.std(values))) if np.std(values) > 0 else None
        for name, values in measured.items()
    }
    correlation = white / np.outer(spread, spread)
    return KinematicConsistency(
        found,
        covariance,
        correlation,
        dict(zip(measured, prediction.values, strict=True)),
        rms,
        fit,
        _corrected(record, source, found),
        (
            *findings_of(found, correlation, fit, record.sample_time_s),
            *drift_findings(inputs, rms, record.sample_time_s),
        ),
    )


def _sources(record: Record, channels: Mapping[str, str]) -> dict[str, str]:
    """Channel of the record by canonical name; units are checked."""
    for name in channels:
        if name not in UNITS:
            raise UnknownNameError(
                "no kinematic channel has this name",
                found=name,
                needed="one of " + ", ".join(UNITS),
            )
    source = {name: channels.get(name, name) for name in UNITS}
    source = {name: label for name, label in source.items() if name in channels or label in record}
    for name, label in source.items():
        require_match(record.unit(label), UNITS[name], subject=f"channel {label}")
    if missing := [name for name in RATES if name not in source]:
        raise DataError(
            "the consistency check needs all three rates",
            found="no " + ", ".join(missing),
            needed="p, q and r",
            action="name the channels with channels={...}",
        )
    if not all(name in source for name in FORCES):
        source = {k: v for k, v in source.items() if k not in (*FORCES, *VELOCITIES)}
    elif not any(name in source for name in VELOCITIES):
        source = {k: v for k, v in source.items() if k not in FORCES}
    if not any(name in source for name in ("phi", "theta", "psi")):
        raise DataError(
            "the consistency check needs an attitude", needed="at least one of phi, theta, psi"
        )
    return source


def _is_seen(state: str, measured: Mapping[str, Array]) -> bool:
    """Tell whether a state shows in the measured outputs."""
    if state == "psi":
        return bool({"psi", "vn", "ve"} & set(measured))
    return state in ("phi", "theta") or bool(set(VELOCITIES) & set(measured))


def _chosen(
    estimate: Iterable[str] | None, inputs: Mapping[str, Array], measured: Mapping[str, Array]
) -> tuple[str, ...]:
    angle_of = dict(zip(RATES, ("phi", "theta", "psi"), strict=True))
    if estimate is None:
        return (
            *(f"bias_{name}" for name in inputs),
            *(f"scale_{rate}" for rate, angle in angle_of.items() if angle in measured),
            *(f"delay_{name}" for name in measured),
        )
    allowed = [f"{kind}_{name}" for kind in ("bias", "scale") for name in (*inputs, *measured)]
    allowed += [f"delay_{name}" for name in measured]
    chosen = tuple(dict.fromkeys(estimate))
    for name in chosen:
        if name not in allowed:
            raise OptionError(
                "this instrument error cannot be estimated here",
                found=name,
                needed="one of " + ", ".join(allowed),
            )
    return chosen


def _first_state(measured: Mapping[str, Array]) -> dict[str, float]:
    """States at the first sample, from what is measured of them."""
    first = {name: float(values[0]) for name, values in measured.items()}
    state = {name: first.get(name, 0.0) for name in STATES}
    if {"vn", "ve", "vd"} <= set(first):
        angles = [np.array([state[name]]) for name in ("phi", "theta", "psi")]
        rows = np.array(rotation_rows(angles[0], angles[1], angles[2]))[:, :, 0]
        body = rows.T @ np.array([first["vn"], first["ve"], first["vd"]])
        state.update(zip(("u", "v", "w"), body.tolist(), strict=True))
    elif "V" in first and "u" not in first:
        alpha, beta = first.get("alpha", state["theta"]), first.get("beta", 0.0)
        state["u"] = first["V"] * np.cos(alpha) * np.cos(beta)
        state["v"] = first["V"] * np.sin(beta)
        state["w"] = first["V"] * np.sin(alpha) * np.cos(beta)
    return state


@dataclass(frozen=True)
class _Problem:
    """Weighed residuals and their Jacobian, in the form that SciPy takes."""

    model: KinematicModel
    observed: Array
    deviations: Array
    _kept: dict[bytes, Prediction] = field(default_factory=dict)

    def residuals(self, theta: Array) -> Array:
        values = self._prediction(theta).values
        return ((values - self.observed) / self.deviations[:, None]).ravel()

    def jacobian(self, theta: Array) -> Array:
        slopes = self._prediction(theta).slopes / self.deviations[:, None, None]
        return slopes.reshape(-1, theta.size)

    def _prediction(self, theta: Array) -> Prediction:
        """The last prediction, kept: SciPy asks for values and slopes at the same place."""
        key = theta.tobytes()
        if key not in self._kept:
            self._kept.clear()
            self._kept[key] = self.model.predict(theta)
        return self._kept[key]


def _first_scales(inputs: Mapping[str, Array], measured: Mapping[str, Array]) -> dict[str, float]:
    """A rate that runs against its angle starts reversed: no small step leads through zero gain."""
    scales = {}
    for rate, angle in zip(RATES, ("phi", "theta", "psi"), strict=True):
        if angle in measured:
            slope = np.diff(measured[angle])
            common = float((slope - slope.mean()) @ inputs[rate][:-1])
            scales[f"scale_{rate}"] = -2.0 if common < 0 else 0.0
    return scales


def _fit(model: KinematicModel, observed: Array, theta: Array) -> tuple[Array, Array]:
    """Output-error estimate, and the residual deviations by which it weighed the outputs."""
    reach = np.maximum(np.ptp(observed, axis=1), 1e-9)
    deviations = 0.1 * reach
    for _ in range(ROUNDS):
        problem = _Problem(model, observed, deviations)
        solution = least_squares(
            problem.residuals,
            theta,
            jac=problem.jacobian,
            x_scale=_sizes(problem, theta),
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
        if not solution.success:
            raise FitError(
                "the consistency fit does not settle",
                found=solution.message,
                action="estimate fewer instrument errors, or take a calmer record",
            )
        theta = np.asarray(solution.x)
        residuals = observed - model.predict(theta).values
        # The floor keeps an output that fits to rounding from taking all the weight.
        fresh = np.maximum(np.sqrt(np.mean(residuals**2, axis=1)), 1e-7 * reach)
        settled = bool(np.all(np.abs(fresh / deviations - 1) < 1e-3))
        deviations = fresh
        if settled:
            break
    return theta, deviations


def _sizes(problem: _Problem, theta: Array) -> Array:
    """Step of each parameter that moves the residuals by one; refuses what cannot be told apart."""
    try:
        jacobian = problem.jacobian(theta)
    except OptionError as error:
        raise _too_steep(str(error)) from error
    require_separable(problem.model.parameters, jacobian)
    return np.asarray(1 / np.linalg.norm(jacobian, axis=0))


def _too_steep(found: str) -> DataError:
    return DataError(
        "the attitude cannot be rebuilt in Euler angles",
        found=found,
        needed="pitch angles inside ±85 degrees",
        action="take a segment without such pitch, or check the units of the rates",
    )


def _unit(parameter: str) -> str:
    if parameter.endswith("_0"):
        return UNITS[parameter.removesuffix("_0")]
    kind, _, name = parameter.partition("_")
    return UNIT_OF_KIND.get(kind, UNITS[name])


def _corrected(
    record: Record, source: Mapping[str, str], found: Mapping[str, InstrumentParameter]
) -> Record:
    """The record without the estimated instrument errors."""
    samples = {}
    delays = {}
    for name, label in source.items():
        bias, scale = (
            found[key].value if (key := f"{kind}_{name}") in found else 0.0
            for kind in ("bias", "scale")
        )
        if bias or scale:
            samples[label] = (record[label] - bias) / (1 + scale)
        if f"delay_{name}" in found:
            delays[label] = found[f"delay_{name}"].value
    options: dict[str, Cell] = {
        name: p.value for name, p in found.items() if not name.endswith("_0")
    }
    done = record.replace(samples, step=Step("conditioning.check_consistency", options))
    return align(done, delays) if delays else done
