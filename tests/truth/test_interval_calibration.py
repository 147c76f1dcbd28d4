"""Are the 95 % intervals of the demo study what they say? Counted over simulated flights.

Sweeps, windows, band, estimator, cost and starts are read from the demo's own study file; arrays go
straight from the simulator to the record, and only the axis that is counted is flown. The fitted
structures hold the truth: what hold and gyro filter leave beside a pure delay moves no parameter by
more than a tenth of its standard error.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import flightid as fid
from flightid.study.settings import Settings, read_settings
from flightid.study.stages import estimate, fit_equations
from flightid.study.task import Task, load_task
from flightid.study.truth import Truth
from flightid.vehicles import rate_truth
from tests.closeness import assert_close

STUDY = Path(__file__).parent.parent.parent / "examples" / "quadrotor_rig" / "study.toml"
AXES = ("roll", "pitch", "yaw")
START_S = 10.0
N_FLIGHTS = 220


@cache
def _settings() -> Settings:
    return read_settings(STUDY)


@cache
def _task(axis: str) -> Task:
    return load_task(_settings().models[AXES.index(axis)])


def true_values(axis: str) -> dict[str, float]:
    rate = _task(axis).model.outputs[0]
    return Truth({rate: rate_truth(axis)}).parameters(_task(axis).model)


def fit_flight(axis: str, seed: int) -> fid.Fit:
    """One flight of the demo's sweep about one axis, identified as the study does it."""
    settings, task = _settings(), _task(axis)
    plan = settings.flight
    assert plan is not None
    sweep = next(run for run in plan.sweep if run.axis == 10 + AXES.index(axis))
    flown = replace(plan, sweep=(replace(sweep, start_s=START_S),), doublet=(), seed=seed).fly()
    # One second after the mode is entered the chirp starts; the log's segment is the chirp.
    # As logs are read: what moves at the rate of the loop is smooth beside slower samples.
    record = flown.record((START_S + 1.0, START_S + 1.0 + sweep.record_s)).declare(
        hold="band_limited"
    )
    asked, model = task.settings, task.model
    assert asked.band_rad_s is not None
    response = estimate(
        [(record,)], model.inputs, model.outputs, asked.band_rad_s, "instrument", asked.response
    )
    least = asked.response.minimum_coherence
    fitted = fit_equations(model, {"instrument": response}, asked.fit, least, None, None)
    return fitted.fits["instrument"]


@pytest.mark.parametrize("axis", AXES)
def test_the_fitted_structure_holds_the_truth(axis: str) -> None:
    task, truth = _task(axis), rate_truth(axis)
    omega = np.geomspace(*task.settings.band_rad_s, 60)
    exact = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=list(task.model.inputs),
        outputs=list(task.model.outputs),
        units={task.model.outputs[0]: "rad/s"},
        random_error=np.full(60, 0.01),
    )
    fit = fid.identify(task.model, exact, starts=4)
    for name, value in true_values(axis).items():
        found = fit.parameters[name].value
        assert_close(found, value, rtol=2e-3, why=f"{name}: hold and filter act as a delay")


@pytest.mark.parametrize(
    ("axis", "seed"),
    [
        ("roll", 11),
        pytest.param("pitch", 12, marks=pytest.mark.nightly),
        pytest.param("yaw", 13, marks=pytest.mark.nightly),
    ],
)
def test_each_parameter_lies_within_four_standard_errors(axis: str, seed: int) -> None:
    fit = fit_flight(axis, seed)
    for name, value in true_values(axis).items():
        found = fit.parameters[name]
        assert found.stderr is not None
        assert abs(found.value - value) < 4.0 * found.stderr, name
        assert found.stderr < 0.06 * abs(value)


@pytest.mark.slow
@pytest.mark.parametrize("axis", AXES)
def test_intervals_cover_the_truth_as_often_as_they_say(axis: str) -> None:
    true = np.array(list(true_values(axis).values()))
    fits = [fit_flight(axis, 1000 + seed) for seed in range(N_FLIGHTS)]
    estimates, errors, inside = (np.empty((N_FLIGHTS, true.size)) for _ in range(3))
    for row, fit in enumerate(fits):
        for column, name in enumerate(true_values(axis)):
            found = fit.parameters[name]
            assert found.interval95 is not None
            assert found.stderr is not None
            low, high = found.interval95
            estimates[row, column], errors[row, column] = found.value, found.stderr
            inside[row, column] = low <= true[column] <= high
    covered = inside.mean(axis=0)
    assert 0.93 <= covered.mean() <= 0.97, covered
    # Each by itself within what chance would do to a true 95 % in so many flights.
    low, high = binom.ppf([0.0005, 0.9995], N_FLIGHTS, 0.95) / N_FLIGHTS
    assert np.all((covered >= low) & (covered <= high)), covered
    bias = (estimates.mean(axis=0) - true) / estimates.std(axis=0)
    assert np.max(np.abs(bias)) < 0.4, bias
    ratio = estimates.std(axis=0) / np.sqrt(np.mean(errors**2, axis=0))
    assert_close(ratio, np.ones(true.size), atol=0.15, why="scatter is the standard error")
