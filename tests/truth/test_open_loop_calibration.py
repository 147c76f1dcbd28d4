"""Bare-airframe derivatives from flights with the augmentation on: unbiased, intervals honest."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.excitation import sweep
from flightid.models import Output, Parameter, Parameters
from flightid.vehicles import Disturbance, FlightConditions, fly_closed_loop
from tests.closeness import assert_close

L = fid.loops
GAIN, WASHOUT_RAD_S, LATE_S = 0.35, 0.5, 0.02
TRUE = {"Lp": -1.2, "Llat": 8.0}


def bare() -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"p": "rad/s"}, input_units={"lat": "in"},
        measurements={"p": Output("p", "rad/s")},
        equations={"p'": "Lp*p + Llat*lat"},
        parameters=Parameters([Parameter("Lp", TRUE["Lp"], "1/s", minimum=-10.0, maximum=2.0),
                               Parameter("Llat", TRUE["Llat"], "rad/(s^2*in)")]),
        name="bare roll",
    )  # fmt: skip


def damper() -> list[L.Block]:
    return [
        L.delay("p", "p_late", LATE_S, units={"p": "rad/s"}),
        L.washout("p_late", "p_w", WASHOUT_RAD_S),
        L.gain("p_w", "lat", -GAIN, units={"lat": "in"}),
    ]


def fly(seed: int) -> fid.Record:
    """The simulator's own loop, with a gust and noise that the damper feeds back."""
    law = fid.LinearSystem(
        [[-WASHOUT_RAD_S]], [[1.0]], [[GAIN * WASHOUT_RAD_S]], [[-GAIN]], ("p",), ("lat",),
        [LATE_S],
    )  # fmt: skip
    chirp = sweep(band_rad_s=(0.4, 20.0), amplitude=0.3, duration_s=90.0, sample_rate_hz=50.0,
                  name="lat", unit="in")  # fmt: skip
    conditions = FlightConditions(gusts={"p": Disturbance(0.15, 0.8)}, noise={"p": 0.01})
    return fly_closed_loop(bare(), law, chirp, conditions=conditions, seed=seed)


def augmented(flown: fid.Record) -> fid.Record:
    """What a log holds of it: the stick, and the rate."""
    return fid.Record.from_arrays(
        flown.time_s, inputs={"lat": flown["sweep_lat"]}, outputs={"p": flown["p"]},
        units={"lat": "in", "p": "rad/s"},
    ).declare(hold="first")  # fmt: skip


def test_the_controller_flown_again_gives_the_actuators_commands() -> None:
    flown = fly(3)
    opened = fid.open_loop(augmented(flown), damper())
    # The simulator's damper had seen the first sample for ever; the washout forgets it.
    late = flown.time_s > 50.0
    assert_close(opened["lat"][late], flown["lat"][late], atol=1e-9, why="the same law")
    assert_close(opened["lat"], flown["lat"], atol=1e-4, why="a first sample of 0.01 rad/s")


def estimate(record: fid.Record) -> fid.Fit:
    response = fid.estimate_response(
        fid.open_loop(record, damper()), inputs=["lat"], outputs=["p"],
        excitations=["lat_stick"], estimator="instrument", omega_rad_s=np.geomspace(0.5, 15.0, 25),
    )  # fmt: skip
    return fid.identify(bare(), response)


def test_the_bare_airframe_is_found_and_not_the_augmented_one() -> None:
    fit = estimate(augmented(fly(1)))
    for name, right in TRUE.items():
        assert abs(fit.parameters[name].value - right) < 0.15 * abs(right)
    # Without opening the loop the damper's share is taken for the vehicle's.
    blind = fid.estimate_response(
        augmented(fly(1)), inputs=["lat"], outputs=["p"], omega_rad_s=np.geomspace(0.5, 15.0, 25)
    )
    assert fid.identify(bare(), blind).parameters["Lp"].value < -3.0


@pytest.mark.slow
def test_bare_derivatives_are_unbiased_and_their_intervals_cover() -> None:
    runs = 200
    fits = [estimate(augmented(fly(100 + seed))) for seed in range(runs)]
    report = []
    for name, right in TRUE.items():
        values = np.array([fit.parameters[name].value for fit in fits])
        error = (values.mean() - right) / (values.std() / np.sqrt(runs))
        inside = np.mean([
            low <= right <= high
            for low, high in (fit.parameters[name].interval95 for fit in fits)
        ])  # fmt: skip
        report.append((name, values.mean(), error, inside))
    assert all(abs(error) < 3.0 for *_, error, _ in report), report
    assert all(0.915 <= inside <= 0.985 for *_, inside in report), report
    print(report)  # noqa: T201 — figures for the record, shown with -s
