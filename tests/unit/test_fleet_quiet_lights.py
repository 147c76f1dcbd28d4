"""Vehicles without an alarm: green only where every model and parameter of the type was judged."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.fleet.drift_lights import shared_lights
from flightid.fleet.normality import normal_light, quiet_light
from flightid.fleet.page import fleet_vehicles
from flightid.fleet.statistics.answers import TypeAnswers, answer_questions
from flightid.fleet.statistics.drift import find_drift
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.least_difference import least_differences
from flightid.fleet.statistics.outliers import find_outliers
from flightid.fleet.statistics.population import estimate_population
from flightid.fleet.vehicle_lights import vehicle_light
from tests.fleet_rows import fleet_rows

UNKNOWN = Light.UNKNOWN
SAID = {
    "v02": (Light.GREEN, "like its type"),
    "v03": (UNKNOWN, "model “pitch” (red in 10 of its 10 flights with it)"),
    "v04": (UNKNOWN, "its newest flight, of which model “pitch” is red"),
    "v05": (Light.AMBER, "model “pitch” is red in its newest 4 flights, and in 4 of 10"),
    "v06": (UNKNOWN, "model “pitch” (none of its flights gives one that counts)"),
    "v07": (UNKNOWN, "(its flights do not tell roll damping)"),
}


@pytest.mark.slow
def test_nothing_that_was_not_judged_is_green() -> None:
    """Of these v03 to v06 were green, and v07 was called like its type."""
    rows, other = fleet_rows(3, 8, 10), fleet_rows(5, 8, 10)
    for each in (*rows["parameters"], *other["parameters"]):  # One far off hides the others.
        each["value"] /= 1.4 if (each["vehicle"], each["name"]) == ("v01", "Ltphi") else 1.0
    pitch = [_spoilt(e | {"model": "pitch"}) for e in other["parameters"]]
    told = (e for e in pitch if e["vehicle"] != "v06")
    rows["parameters"] += [e for e in told if (e["vehicle"], e["name"]) != ("v07", "Lp")]
    rows["covariances"] += [each | {"model": "pitch"} for each in other["covariances"]]
    found = fleet_vehicles(answer_questions(rows, covariates=["battery"]))
    assert {name: found[name].light for name in SAID} == {k: v[0] for k, v in SAID.items()}
    for name, (_, words) in SAID.items():
        assert words in found[name].message


def test_one_that_did_not_change_beside_all_others_is_said_to_be_that() -> None:
    """All 6 of 6 "changed together" beside one that was red for the other way."""
    rng, left = np.random.default_rng(1), np.repeat(np.arange(6), 12) == 5
    behind = np.tile(np.arange(12), 6) >= 7
    values = 140.0 * (1.0 + 0.02 * rng.normal(size=72)) * np.where(behind & ~left, 1.15, 1.0)
    ids, time_s = np.repeat([*"abcdef"], 12).tolist(), 2.0 * 86400.0 * np.tile(np.arange(12.0), 6)
    errors = np.full((72, 1, 1), 2.8**2)
    data = FlightEstimates.of(["k"], ids, values[:, None], errors, time_s=time_s)
    drift = find_drift(data)
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    (light,) = shared_lights(drift, {})
    assert "most vehicles changed together by +1" in light.message
    assert "(5 of 6 vehicles; f may be one that did not)" in light.message
    found = vehicle_light("f", answered)
    assert found.light is Light.AMBER
    assert "beside what the others did: it may be one that did not change" in found.message
    assert "a: no change beside what the others did (80 %" in vehicle_light("a", answered).message


def test_many_green_vehicles_say_which_steps_would_be_found() -> None:
    """It was "93 vehicles neither changed nor are unlike", with three that had fallen by 10 %."""
    rng, ids = np.random.default_rng(4), np.repeat([*"abcdef"], 12).tolist()
    values = 140.0 * (1.0 + 0.02 * rng.normal(size=72))
    time_s, errors = 2.0 * 86400.0 * np.tile(np.arange(12.0), 6), np.full((72, 1, 1), 2.8**2)
    data = FlightEstimates.of(["k"], ids, values[:, None], errors, time_s=time_s)
    answered = TypeAnswers("quad", "roll", data, None, None, find_drift(data))
    said = normal_light({*"abcde"}, [answered]).message
    assert re.match(r"5 vehicles: no change of any was found \(80 % of such steps", said)
    assert re.search(r"from k [\d.]+ % to k [\d.]+ %", said)


def test_like_its_type_says_which_difference_would_be_found() -> None:
    """One of four 20 % below the others was green in 9 of 12 fleets, and nothing said why."""
    four = 140.0 * np.array([1.0, 1.03, 0.98, 1.01])
    found = {}
    for spread in (1.0, 12.0):
        values = 140.0 + spread * (four - 140.0)
        data = FlightEstimates.of(["k"], [*"abcd"], values[:, None], np.full((4, 1, 1), 2.0))
        population = estimate_population(data)
        one = TypeAnswers("quad", "roll", data, None, find_outliers(population), None)
        least = replace(one, least_differences=least_differences(population))
        found[spread] = quiet_light("c", [least])
    assert found[1.0].light is Light.GREEN
    (size,) = re.findall(r"80 % of such differences would be found: k (\d+) %", found[1.0].message)
    assert 10.0 < float(size) < 50.0
    assert found[12.0].light is UNKNOWN
    assert "of 4 vehicles only differences above these would show: k " in found[12.0].message


def _spoilt(row: dict[str, Any]) -> dict[str, Any]:
    """Red in every flight of v03, in the newest of v04, and in the newest four of v05."""
    since = {"v03": "2026-01-05", "v04": "2026-01-17T11", "v05": "2026-01-14"}
    red = row["flown_at"] >= since.get(row["vehicle"], "2027")
    return row | {"light": "red"} if red else row
