"""The table [flight] of a study: every field of the simulator by its type, nothing else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.errors import StudyError
from flightid.models import load_model
from flightid.study.flight import FlightPlan, read_flight
from flightid.study.reading import TableReader
from flightid.study.truth import Truth, recovered
from flightid.vehicles import Autopilot, QuadrotorParameters, fly


def _plan(text: str) -> FlightPlan:
    plain = tomllib.loads('simulate = "quadrotor"\n' + text)
    return read_flight(TableReader(plain, "[flight]"), Path())


def test_defaults_are_the_simulators() -> None:
    plan = _plan("")
    assert (plan.vehicle, plan.autopilot) == (QuadrotorParameters(), Autopilot())
    assert (plan.sweep, plan.doublet, plan.log_every, plan.seed) == ((), (), 1, 0)


def test_fields_are_read_by_their_type() -> None:
    plan = _plan(
        "seed = 3\nlog_every = 2\n"
        "[[sweep]]\naxis = 10\nstart_s = 5\n"
        '[[doublet]]\naxis = "yaw"\nstart_s = 190\namplitude = 0.5\n'
        "[vehicle]\non_rig = false\ninertia_kg_m2 = [0.01, 0.012, 0.02]\n"
        "[turbulence]\nrate_rad_s = 0.0\n"
    )
    assert plan.sweep[0].axis == 10
    assert plan.sweep[0].start_s == 5.0
    assert plan.doublet[0].axis == "yaw"
    assert not plan.vehicle.on_rig
    assert plan.vehicle.inertia_kg_m2 == (0.01, 0.012, 0.02)
    assert plan.turbulence.rate_rad_s == 0.0
    assert (plan.seed, plan.log_every) == (3, 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("wind = 3", "[flight]: there is no key 'wind'"),
        ("[vehicle]\nmas_kg = 1", "Next: write 'mass_kg'"),
        ("[vehicle]\nmass_kg = '1'", "[flight.vehicle]: mass_kg has no meaning"),
        ("[vehicle]\non_rig = 1", "needed true or false"),
        ("[vehicle]\ninertia_kg_m2 = [1, 2]", "needed three numbers"),
        ("[[sweep]]\naxis = 10", "[[flight.sweep]] number 1: start_s is missing"),
        ("[[sweep]]\naxis = 1.5\nstart_s = 1", "needed a whole number"),
        ("[[doublet]]\naxis = 'x'\nstart_s = 1\namplitude = 1", "'roll' or 'pitch' or 'yaw'"),
        ("[autopilot]\nrate = 3", "there is no key 'rate'"),
    ],
)
def test_each_fault_is_named(text: str, said: str) -> None:
    with pytest.raises(StudyError, match=re.escape(said)):
        _plan(text)


def test_a_value_without_meaning_is_the_simulators_error() -> None:
    with pytest.raises(StudyError, match="cannot lift the vehicle"):
        _plan("[vehicle]\nmass_kg = 9")


def test_truth_belongs_to_models_that_can_follow_it() -> None:
    truth = Truth.of_flight(fly(duration_s=1.0))
    known = truth.parameters(load_model("rate_motor_lag", axis="pitch"))
    assert known == pytest.approx(
        {
            "Mttheta": truth.rates["q"].gain_rad_s2,
            "Mq": truth.rates["q"].damping_1_s,
            "T_m": truth.rates["q"].motor_lag_s,
            "tau": truth.rates["q"].effective_delay_s(),
        }
    )
    assert truth.parameters(load_model("rate_first_order", axis="roll")) == {}
    assert truth.parameters(load_model("rate_motor_lag", axis="yaw")) == {}
    assert truth.parameters(load_model("rate_gain_lag", axis="roll")) == {}
    assert truth.parameters(load_model("attitude_first_order", axis="roll")) == {}
    assert truth.response(load_model("attitude_first_order", axis="roll"), np.ones(1)) is None


# Honest intervals miss 2 of 13 in 14 % of flights, 3 in 2.5 %, 4 in 0.3 %.
@pytest.mark.parametrize(
    ("missed", "light"),
    [(0, Light.GREEN), (2, Light.GREEN), (3, Light.AMBER), (4, Light.RED), (6, Light.RED)],
)
def test_misses_are_judged_by_how_rare_they_are(missed: int, light: Light) -> None:
    inside = np.arange(13) >= missed
    finding = recovered(inside)
    assert finding.light is light
    assert f"{13 - missed} of 13" in finding.message
