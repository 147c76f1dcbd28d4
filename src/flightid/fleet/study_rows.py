"""Rows of the catalogue from what a study made of one log."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.from_log import axis_loop_of
from flightid.control.margins.margins import margins
from flightid.conventions import Light
from flightid.dynamics.modes.modes import modes
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.fleet.catalogue.schema import lower_triangle
from flightid.fleet.fitted_points import response_rows
from flightid.fleet.parameter_words import meaning
from flightid.identification import Fit
from flightid.logs import Log
from flightid.models.save import model_as_toml
from flightid.review import FlightReview
from flightid.study import Study
from flightid.uncertainty.estimate import Reading

Row = dict[str, Any]
AXIS_OF = {"p": "roll", "q": "pitch", "r": "yaw"}
"""Axis of an autopilot's rate loop, by the rate that it holds."""
LOWEST_RAD_S = 0.2


def study_rows(study: Study, log: Log | None) -> dict[str, list[Row]]:
    """Rows of every table but `logs` and `failures`, without the columns that all have.

    Parameters
    ----------
    study : Study
    log : Log or None
        The gains that flew.

    Returns
    -------
    dict of str to list of dict
        By table; rows of a model carry its own light.
    """
    of_models = {each for item in study.identified for each in item.findings}
    others = (each for each in study.findings if each not in of_models)
    rows: dict[str, list[Row]] = {"findings": list(_findings(None, others))}
    for item in study.identified:
        fit = item.fit
        rows["findings"] += _findings(item.name, item.findings)
        if fit is None:
            continue
        common = {"model": item.name, "light": str(fit.evidence.light)}
        for name, made in _of_fit(fit, log).items():
            rows.setdefault(name, []).extend({**common, **row} for row in made)
        rows.setdefault("models", []).append({**common, "file": model_as_toml(fit)})
        told = ({**common, **row} for row in response_rows(fit, item.response))
        rows.setdefault("responses", []).extend(told)
    if study.review is not None:
        rows["gains_flown"] = list(_gains(study.review))
        rows["covariates"] = list(_covariates(study.review, log))
    return rows


def usable(fit: Fit | None) -> bool:
    """Whether a fit counts in a fleet: it is not red and has a covariance."""
    return fit is not None and fit.evidence.light is not Light.RED and fit.covariance is not None


def _of_fit(fit: Fit, log: Log | None) -> dict[str, Iterable[Row]]:
    made: dict[str, Iterable[Row]] = {"parameters": list(_parameters(fit))}
    if fit.covariance is not None:
        lower = lower_triangle(fit.covariance.tolist())
        made["covariances"] = [{"names": list(fit.names), "lower": lower}]
    # What cannot be computed of one model is missing of it alone.
    for name, work in (("modes", _modes), ("margins", _margins)):
        try:
            made[name] = list(work(fit, log))
        except (FlightidError, ArithmeticError, np.linalg.LinAlgError):
            made[name] = []
    return made


def _parameters(fit: Fit) -> Iterator[Row]:
    at = {name: place for place, name in enumerate(fit.names)}
    for name, each in fit.parameters.items():
        yield {
            "name": name,
            "value": _plain(each.value),
            "stderr": _plain(each.stderr),
            "freedom": _plain(each.freedom),
            "unit": each.unit,
            "status": each.status,
            "position": at.get(name),
            "meaning": meaning(name, fit.model.parameters[name].note),
        }


def _modes(fit: Fit, log: Log | None) -> Iterator[Row]:
    del log
    found = [mode for mode in modes(fit).modes if mode.eigenvalue is not None]
    found.sort(key=lambda mode: abs(mode.eigenvalue or 0.0))
    for number, mode in enumerate(found):
        yield {
            "number": number,
            "name": mode.name or None,
            "real_rad_s": _plain(mode.real.value),
            "imag_rad_s": _plain(abs(mode.imaginary.value or 0.0)),
            "frequency_rad_s": _plain(mode.natural_frequency.value),
            "frequency_stderr": _plain(mode.natural_frequency.stderr),
            "damping": _plain(mode.damping_ratio.value),
            "damping_stderr": _plain(mode.damping_ratio.stderr),
        }


def _margins(fit: Fit, log: Log | None) -> Iterator[Row]:
    """Margins of the rate loop of a model's axis, with the gains that flew."""
    model = fit.model
    outputs = [name for name in getattr(model, "outputs", ()) if name in AXIS_OF]
    if log is None or len(outputs) != 1 or len(model.inputs) != 1:
        return
    axis = AXIS_OF[outputs[0]]
    loop = axis_loop_of(log, axis)

    def feedback(s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return np.asarray(loop.feedback(np.abs(s.imag)))

    band = (LOWEST_RAD_S, 0.8 * np.pi * loop.loop_rate_hz)
    found = margins(fit, model.inputs[0], outputs[0], controller=feedback, band_rad_s=band)
    for each in found.quantities:
        low, high = each.interval() or (None, None)
        yield {
            "axis": axis,
            "name": each.name,
            "value": _plain(each.value),
            "stderr": _plain(each.stderr),
            "low": _plain(low),
            "high": _plain(high),
            "unit": each.unit,
        }


def _gains(review: FlightReview) -> Iterator[Row]:
    for axis, gains in review.identity.gains.items():
        for name, value in gains.items():
            yield {"axis": axis, "name": name, "value": _plain(value)}


def _covariates(review: FlightReview, log: Log | None) -> Iterator[Row]:
    battery = review.identity.battery
    if battery is not None:
        yield _covariate("battery_start_v", battery.start_v, "V")
        yield _covariate("battery_least_v", battery.least_v, "V")
        yield _covariate("battery_mean_a", battery.mean_a, "A")
    if review.throttle is not None:
        yield _covariate("throttle", float(np.mean(review.throttle.values)), "1")
    hover = None if log is None else log.parameters.get("MOT_THST_HOVER")
    yield _covariate("hover_throttle", hover, "1")
    yield {"name": "firmware", "text": review.firmware or None, "unit": "1", "source": "log"}


def _covariate(name: str, value: float | None, unit: str) -> Row:
    return {"name": name, "value": _plain(value), "unit": unit, "source": "log"}


def told_covariates(told: Mapping[str, str]) -> Iterator[Row]:
    """Columns of the fleet's own tables, as numbers where they are."""
    for name, text in told.items():
        try:
            number = _plain(float(text))
        except ValueError:
            number = None
        words = text if number is None else None
        yield {"name": name, "value": number, "text": words, "unit": "1", "source": "table"}


def _findings(model: str | None, findings: Iterable[Finding]) -> Iterator[Row]:
    for each in dict.fromkeys(findings):
        yield {"model": model, **each.to_dict()}


def _plain(value: float | Reading | None) -> float | None:
    """A finite number; None for all else."""
    if value is None or not np.isfinite(float(value)):  # type: ignore[arg-type]
        return None
    return float(value)  # type: ignore[arg-type]
