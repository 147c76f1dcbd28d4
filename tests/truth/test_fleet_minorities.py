"""Vehicles that differ alike from all others of their type hide each other no longer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import erfinv

from flightid.conventions import Light
from flightid.fleet.statistics import outliers
from flightid.fleet.statistics.answers import TypeAnswers
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.heterogeneity import VehicleEstimates
from flightid.fleet.statistics.minorities import find_minorities, widest_gaps
from flightid.fleet.statistics.outliers import find_outliers
from flightid.fleet.statistics.population import estimate_population
from flightid.fleet.statistics.spread_search import SpreadFit, search_spreads
from flightid.fleet.vehicle_lights import vehicle_light


def _fleet(values: np.ndarray) -> FlightEstimates:
    """Errors of 1 % of 100."""
    k, p = values.shape
    names = [f"V{i:02}" for i in range(k)]
    return FlightEstimates.of([*"abc"[:p]], names, values, np.tile(np.eye(p), (k, 1, 1)))


def _scores(count: int) -> np.ndarray:
    """Values of a normal type of mean 100 and spread 4, evenly by probability."""
    return np.asarray(
        100.0 + 4.0 * np.sqrt(2.0) * erfinv(2.0 * (np.arange(count) + 0.5) / count - 1.0)
    )


@pytest.mark.parametrize(("minority", "apart"), [(3, 0.3), (4, -0.3), (2, 0.4)])
def test_a_minority_that_differs_alike_is_told_as_one(minority: int, apart: float) -> None:
    """Each widened what is normal for the others: none was odd, and three or more were green."""
    others = 12 - minority
    values = np.concatenate([_scores(others), (1.0 + apart) * _scores(minority)])
    told = find_outliers(estimate_population(_fleet(values[:, None])))
    assert not told.odd
    (found,) = told.minorities
    assert set(found.vehicles) == {f"V{i:02}" for i in range(others, 12)}
    low, high = found.apart.interval95 or (0.0, 0.0)
    assert low < 100.0 * apart < high < low + 20.0
    answered = [TypeAnswers("quad", "roll", _fleet(values[:, None]), None, told, None)]
    lights = [vehicle_light(f"V{i:02}", answered) for i in range(12)]
    assert [each.light for each in lights] == [Light.GREEN] * others + [Light.AMBER] * minority
    side = f" % {'below' if apart < 0.0 else 'above'} the {others} others, alike with V"
    assert side in lights[-1].message
    assert "differ alike from" in told.summary({"a": "roll damping"}).notes[1]
    assert "roll damping" in told.summary({"a": "roll damping"}).notes[1]


def test_a_type_of_one_kind_has_no_minority() -> None:
    assert find_minorities(estimate_population(_fleet(_scores(12)[:, None]))) == ()
    even = np.sort(np.random.default_rng(1).normal(size=(200, 20)), axis=1)
    gaps, places = widest_gaps(even)
    for row, gap, place in zip(even[:20], gaps, places, strict=False):
        sides = row[:place], row[place:]
        within = sum(np.sum((each - each.mean()) ** 2) for each in sides) / 18.0
        assert gap == pytest.approx((row[place] - row[place - 1]) / np.sqrt(within))
        assert 2 <= min(place, 20 - place) <= 6
    five = estimate_population(_fleet(np.array([99.0, 100.0, 101.0, 140.0, 141.0])[:, None]))
    assert find_minorities(five) == ()


def test_of_many_vehicles_few_are_left_out_of_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 120 vehicles 24 were, and 500 of 20 flights took minutes; who is odd stays the same."""
    rng, searched = np.random.default_rng(4), []
    values = 100.0 * (1.0 + 0.04 * rng.normal(size=(120, 2))) + rng.normal(size=(120, 2))
    values[7, 0] *= 1.3
    values[90, 1] *= 0.72
    population = estimate_population(_fleet(values))

    def counted(*args: Any, **options: Any) -> SpreadFit:
        searched.append(1)
        return search_spreads(*args, **options)

    monkeypatch.setattr(outliers, "search_spreads", counted)
    found = find_outliers(population)
    assert {each.vehicle for each in found.odd} == {"V07", "V90"}
    assert 2 <= len(searched) <= 15
    kept, of_all = VehicleEstimates(values[:, 0], np.ones(120)), found.vehicles[-1]
    place = int(of_all.vehicle[1:])
    assert of_all.deviations[0].chance == kept.next_chance(float(values[place, 0]), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "most"), [("normal", 0.05), ("skewed", 0.2)])
def test_few_types_of_one_kind_are_told_to_be_of_two(shape: str, most: float) -> None:
    """Three parameters, 12 and 20 vehicles, 100 types of each."""
    for k in (12, 20):
        rng, told = np.random.default_rng(k), 0
        for _ in range(100):
            scores = rng.normal(size=(k, 3))
            if shape == "skewed":
                scores = (rng.gamma(2.0, 1.0, (k, 3)) - 2.0) / np.sqrt(2.0)
            values = 100.0 * (1.0 + 0.04 * scores) + rng.normal(size=(k, 3))
            told += bool(find_minorities(estimate_population(_fleet(values))))
        assert told <= 100 * most, (k, told)
