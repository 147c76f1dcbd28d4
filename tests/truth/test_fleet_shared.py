"""What a small fleet shares by date: not what half of it did, and wear with direction and size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.fleet.normality import _is_moved
from flightid.fleet.statistics.answers import TypeAnswers
from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.shared_level import shared_level
from flightid.fleet.statistics.shared_trend import SharedTrend
from flightid.fleet.vehicle_lights import vehicle_light

VEHICLES, FLIGHTS = [*"abcdef"], 12


def _fleet(
    seed: int, moved: np.ndarray, events: Sequence[FleetEvent] = ()
) -> tuple[FlightEstimates, FleetDrift]:
    """Six vehicles with twelve flights each, one every second day, with errors of 3 %."""
    rng, shape = np.random.default_rng(seed), (len(VEHICLES), FLIGHTS)
    levels = 140.0 * (1.0 + 0.08 * rng.normal(size=(len(VEHICLES), 1))) * (1.0 + moved)
    values = levels * (1.0 + 0.03 * rng.normal(size=shape))
    data = FlightEstimates.of(
        ["k"],
        np.repeat(VEHICLES, FLIGHTS).tolist(),
        values.reshape(-1, 1),
        ((0.03 * levels) ** 2).reshape(-1, 1, 1),
        time_s=np.tile(2.0 * 86400.0 * np.arange(FLIGHTS), len(VEHICLES)),
    )
    return data, find_drift(data, events=events)


@pytest.mark.parametrize("seed", [10, 34])
def test_half_of_a_small_fleet_is_not_all_of_it(seed: int) -> None:
    """It was "all vehicles changed together by −5 % (6 of 6 vehicles)", and all six were green."""
    moved = np.zeros((len(VEHICLES), FLIGHTS))
    moved[:3, 6:] = -0.1
    data, drift = _fleet(seed, moved)
    assert not drift.shared
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    lights = [vehicle_light(each, answered).light for each in VEHICLES]
    assert set(lights[:3]) <= {Light.RED, Light.AMBER}
    assert Light.RED not in lights[3:]


def test_wear_of_all_has_direction_size_and_dates() -> None:
    """It was "moved together by date, −9 to +7 %", and each vehicle green."""
    worn = -0.2 * np.arange(FLIGHTS) / (FLIGHTS - 1)
    data, drift = _fleet(1, np.tile(worn, (len(VEHICLES), 1)))
    (shared,) = drift.shared
    assert not drift.alarms
    assert shared.trend is not None
    low, high = shared.trend.change.interval(0.95) or (0.0, 0.0)
    assert -26.0 < low < -20.0 < high < -14.0
    said = shared.words({})
    assert said.startswith("k: all vehicles fell by ")
    assert "from 1970-01-01 to 1970-01-23: wear of all, a season, or a change of what" in said
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    for each in VEHICLES:
        found = vehicle_light(each, answered)
        assert found.light is Light.AMBER
        assert "k went with all vehicles, which fell by " in found.message


def test_a_step_of_all_is_amber_on_each_until_an_event_of_all_says_why() -> None:
    """Each vehicle was green beside the type's "all vehicles changed together"."""
    behind = np.arange(FLIGHTS) >= FLIGHTS // 2
    stepped = np.tile(-0.1 * behind, (len(VEHICLES), 1))
    data, drift = _fleet(1, stepped)
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    for each in VEHICLES:
        found = vehicle_light(each, answered)
        assert found.light is Light.AMBER
        assert "k went with all vehicles, which changed together by -" in found.message
        assert "name what was done to all as an event" in found.action
    firmware = FleetEvent("firmware", 2.0 * 86400.0 * (FLIGHTS // 2) - 1.0)
    data, drift = _fleet(1, stepped, [firmware])
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    for each in VEHICLES:
        found = vehicle_light(each, answered)
        assert "at the event “firmware”" in found.message
        assert "went with all vehicles" not in found.message
        assert found.light is not Light.AMBER
    # Where days do not tell a step from wear, the event still says why.
    (shared,), (history,) = drift.shared, [e for e in drift.histories if e.vehicle == "a"]
    wear = SharedTrend(shared.change, 0.0, 2.0 * 86400.0 * FLIGHTS)
    assert not _is_moved(history, replace(shared, is_step=True, trend=wear))
    assert _is_moved(history, replace(shared, is_step=False, trend=wear))
    # Of one vehicle alone it explains nothing of what all did.
    data, drift = _fleet(1, stepped, [FleetEvent("motor", firmware.time_s, ("a",))])
    answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
    assert vehicle_light("a", answered).light is Light.AMBER


def test_what_days_do_not_tell_from_a_step_is_not_called_one() -> None:
    """Wear by 10 % was a step of 5 % in 13 of 200 fleets, a season was one in 53 of 60."""
    course = np.arange(FLIGHTS) / (FLIGHTS - 1)
    for seed in (4, 38):
        _, drift = _fleet(seed, np.tile(-0.1 * course, (len(VEHICLES), 1)))
        (shared,) = drift.shared
        assert shared.trend is not None
        said = shared.words({})
        assert "changed together by -" in said
        assert "or fell by " in said
        assert "their days do not tell which" in said
    wave = np.tile(0.06 * np.sin(2.0 * np.pi * np.arange(FLIGHTS) / FLIGHTS), (len(VEHICLES), 1))
    waves = [_fleet(seed, wave) for seed in range(4)]
    assert not any(drift.shared[0].is_step for _, drift in waves)
    # Whatever shape it has, it is no "no change".
    for data, drift in waves:
        (shared,) = drift.shared
        assert shared.trend is not None or "moved together by date" in shared.words({})
        answered = [TypeAnswers("quad", "roll", data, None, None, drift)]
        assert vehicle_light("a", answered).light is Light.AMBER


def test_a_vehicle_that_does_not_tell_the_step_is_not_said_to_have_gone_along() -> None:
    """Of eight of which one stayed, it "went with all vehicles" in 14 of 48 fleets."""
    behind = np.arange(FLIGHTS) >= FLIGHTS // 2
    data, drift = _fleet(1, np.tile(-0.1 * behind, (len(VEHICLES), 1)))
    (shared,) = drift.shared
    assert set(shared.telling) <= set(VEHICLES)
    assert len(shared.telling) == shared.agreeing
    told = replace(drift, shared=(replace(shared, telling=tuple("abcde")),))
    answered = [TypeAnswers("quad", "roll", data, None, None, told)]
    assert "went with all" in vehicle_light("a", answered).message
    stayed = vehicle_light("f", answered)
    assert stayed.light is Light.AMBER
    assert "went with all" not in stayed.message
    assert "its own flights do not tell that it went along" in stayed.message


def test_a_step_of_all_is_called_one() -> None:
    course = np.arange(FLIGHTS) / (FLIGHTS - 1)
    for seed in (2, 17):
        _, drift = _fleet(seed, np.tile(-0.1 * (course > 0.5), (len(VEHICLES), 1)))
        assert drift.shared[0].is_step
        assert drift.shared[0].trend is None


def test_few_fleets_that_share_nothing_are_said_to() -> None:
    """By the signs of agreeing vehicles 12 of 100 fleets of eight were, with all eight amber."""
    found = []
    for seed in range(40):
        values = 140.0 * (1.0 + 0.03 * np.random.default_rng((8, seed)).normal(size=(8, FLIGHTS)))
        data = FlightEstimates.of(
            ["k"],
            np.repeat([*"abcdefgh"], FLIGHTS).tolist(),
            values.reshape(-1, 1),
            np.full((8 * FLIGHTS, 1, 1), 17.6),
            time_s=np.tile(2.0 * 86400.0 * np.arange(FLIGHTS), 8),
        )
        found.append(shared_level(data, 0))
    assert sum(each is not None for each in found) <= 3
