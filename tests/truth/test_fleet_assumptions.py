"""Fleets that break what drift assumes: spread between flights, season, few flights, new ones."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.flight_estimates import FlightEstimates

DAY_S = 86400.0


def _drift(
    seed: int,
    vehicles: int,
    n: int,
    *,
    least: float = 0.02,
    understated: float = 1.0,
    spread: float = 0.0,
    season: float = 0.0,
    change: float = 0.0,
    changed: int = 0,
    last: int = 0,
) -> FleetDrift:
    """Flights three days apart, errors up to 5 %; the last ones of the first vehicles change."""
    rng = np.random.default_rng(seed)
    errors = rng.uniform(least, 0.05, (vehicles, n))
    moved = understated * errors * rng.normal(size=(vehicles, n))
    moved += spread * rng.normal(size=(vehicles, n))
    moved += season * np.sin(2.0 * np.pi * np.arange(n) / n)
    moved[:changed, n - last :] += change
    base = 10.0 * (1.0 + 0.1 * rng.normal(size=(vehicles, 1)))
    return find_drift(
        FlightEstimates.of(
            ["Lp"],
            np.repeat([f"{i:03}" for i in range(vehicles)], n).tolist(),
            (base * (1.0 + moved)).reshape(-1, 1),
            ((base * errors) ** 2).reshape(-1, 1, 1),
            time_s=np.tile(3.0 * DAY_S * np.arange(n), vehicles),
        )
    )


def _alarmed(found: FleetDrift) -> set[int]:
    return {int(each.vehicle) for each in found.alarms}


@pytest.mark.parametrize(
    ("least", "spread", "season"), [(0.005, 0.03, 0.0), (0.01, 0.05, 0.0), (0.02, 0.0, 0.03)]
)
def test_what_differs_by_flight_or_by_season_is_no_change(
    least: float, spread: float, season: float
) -> None:
    """As a factor of stated errors, and without the season, a fifth to nine tenths were red."""
    options = {"least": least, "spread": spread, "season": season}
    assert len(_alarmed(_drift(3, 24, 40, **options))) <= 1
    alarmed = _alarmed(_drift(4, 24, 40, change=0.15, changed=3, last=14, **options))
    assert alarmed >= {0, 1, 2}
    assert len(alarmed) <= 4


def test_a_change_of_all_is_said_and_is_no_vehicles_own() -> None:
    found = _drift(7, 30, 40, change=-0.08, changed=30, last=16)
    assert not found.alarms
    (one,) = found.shared
    assert one.is_step
    assert one.change.value == pytest.approx(-8.0, abs=4.0 * (one.change.stderr or 0.0))
    assert one.since_s == 24 * 3.0 * DAY_S
    assert "all vehicles changed together by -8" in one.words({})
    assert "from 1970-03-14" in found.summary().notes[1]
    assert not _drift(7, 30, 40, change=-0.1, changed=12, last=16).shared


def test_few_flights_tell_that_their_errors_are_understated() -> None:
    """Of 30 vehicles alone with errors told half as large 16 were red while 20 steps were asked."""
    found = [_drift(seed, 1, 12, understated=2.0) for seed in range(30)]
    assert sum(bool(each.alarms) for each in found) <= 5
    assert np.median([each.errors["Lp"].factor for each in found]) == pytest.approx(2.0, rel=0.2)
    wide = next(each for each in found if not each.alarms and each.errors["Lp"].typical > 1.5)
    assert "times as stated" in wide.summary().notes[-1]


@pytest.mark.parametrize(("last", "change"), [(1, -0.3), (2, -0.3), (2, -0.2)])
def test_the_newest_flights_are_believed(last: int, change: float) -> None:
    """One alone is told as such and is no change; two are, with their size."""
    found = _drift(6, 30, 20, change=change, changed=15, last=last)
    off, alarmed = {int(each.vehicle) for each in found.newest_off}, _alarmed(found)
    assert len({*off, *alarmed} - set(range(15))) <= 1
    if last == 1:
        assert off >= set(range(15))
        assert not alarmed & set(range(15))
        assert "fly again" in found.newest_off[0].words({})
        return
    assert alarmed >= set(range(15))
    ends = [each.change_percent.interval95 for each in found.alarms if int(each.vehicle) < 15]
    assert sum(low <= 100.0 * change <= high for low, high in filter(None, ends)) >= 12
