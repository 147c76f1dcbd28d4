"""Kinematic consistency: whether rates, attitude, accelerations and velocities are one motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conditioning.align import align
from flightid.conditioning.consistency_findings import (
    drift_findings,
    findings_of,
)
from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.conditioning.instrument_fit import OutputError, too_steep
from flightid.conditioning.kinematics import (
    FORCES,
    INPUTS,
    OUTPUTS,
    RATES,
    STATES,
    UNITS,
    VELOCITIES,
    KinematicModel,
    rotation_rows,
)
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.record import Record, Step
from flightid.table import Cell
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.estimate import Estimate
from flightid.units import require_match

Array = NDArray[np.float64]
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

    Standard errors carry both the colour of the outputs' own noise and the noise of the rates and
    accelerations, which integrates to random walks in the outputs; its intensity is taken from the
    upper half of the inputs' spectra. Where such a walk is not small against the residual, the
    finding ``"gyro-noise"`` says so: the intervals allow for it, the estimates pay for it. Pairs of
    parameters that the record cannot tell apart are named in the findings.

    Assumes: a rigid body, flat non-rotating earth, white noise of rates and accelerations; with V,
    alpha, beta: still air or steady wind. Intervals are too narrow when: noisy inputs were
    low-passed below a quarter of the sampling frequency. Biased when: sensors
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
        raise too_steep(f"{np.rad2deg(np.max(np.abs(measured['theta']))):.1f} degrees")
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
    theta, prediction, deviations = OutputError(model, observed).fit(theta)
    residuals = observed - prediction.values
    noise = model.input_noise(theta)
    block = RecordBlock.of(
        prediction.slopes / deviations[:, None, None],
        np.zeros((*residuals.shape, 0)),
        residuals / deviations[:, None],
    )
    known = residual_covariance([block], noise=(noise, 1.0 / deviations))
    deviation = np.sqrt(np.diag(known.covariance))
    white = np.sqrt(np.diag(known.white))
    found = {
        name: Estimate(
            name, float(value), _unit(name), float(error), freedom=float(degrees), status="free"
        )
        for name, value, error, degrees in zip(
            parameters, theta, deviation, known.freedom, strict=True
        )
    }
    rms = {name: float(np.sqrt(np.mean(r**2))) for name, r in zip(measured, residuals, strict=True)}
    fit = {
        name: 100 * (1 - rms[name] / float(np.std(values))) if np.std(values) > 0 else None
        for name, values in measured.items()
    }
    correlation = known.white / np.outer(white, white)
    return KinematicConsistency(
        found,
        known.covariance,
        correlation,
        measured,
        dict(zip(measured, prediction.values, strict=True)),
        rms,
        fit,
        _corrected(record, source, found),
        (
            *findings_of(found, correlation, fit, record.sample_time_s),
            *drift_findings(
                dict(zip(INPUTS, noise.deviations, strict=True)),
                rms,
                record.sample_time_s,
                record.n_samples,
            ),
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
        require_match(label, record.unit(label), UNITS[name], record=str(record.name))
    if missing := [name for name in RATES if name not in source]:
        raise DataError(
            "the consistency check needs all three rates",
            found="no " + ", ".join(missing),
            needed="p, q and r",
            action="name the columns that they are: --rename, or channels of check_consistency",
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


def _first_scales(inputs: Mapping[str, Array], measured: Mapping[str, Array]) -> dict[str, float]:
    """A rate that runs against its angle starts reversed: no small step leads through zero gain."""
    scales = {}
    for rate, angle in zip(RATES, ("phi", "theta", "psi"), strict=True):
        if angle in measured:
            slope = np.diff(measured[angle])
            common = float((slope - slope.mean()) @ inputs[rate][:-1])
            scales[f"scale_{rate}"] = -2.0 if common < 0 else 0.0
    return scales


def _unit(parameter: str) -> str:
    if parameter.endswith("_0"):
        return UNITS[parameter.removesuffix("_0")]
    kind, _, name = parameter.partition("_")
    return UNIT_OF_KIND.get(kind, UNITS[name])


def _corrected(record: Record, source: Mapping[str, str], found: Mapping[str, Estimate]) -> Record:
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
