"""Fleets that break what drift assumes: spread between flights, season, few flights, new ones."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
import pytest

from flightid.fleet.drift_lights import errors_lights, persistent_lights
from flightid.fleet.statistics.change_kind import DRIFT
from flightid.fleet.statistics.days import shared_by_day
from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.memory_evidence import (
    CHANGING,
    SPREADS,
    DayGroup,
    change_shapes,
    evidence,
)
from flightid.fleet.statistics.odd_flights import without_odd_flights
from flightid.fleet.statistics.population import estimate_population
from flightid.fleet.statistics.repeats import days_of
from flightid.fleet.statistics.shared_level import shared_level
from flightid.fleet.vehicle_lights import going_on_words

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
    first_understated: float = 1.0,
    a_day: int = 1,
    days: float = 0.0,
    relative: float | None = None,
    hour: float = 0.0,
    memory: float = 0.0,
    events: Sequence[FleetEvent] = (),
) -> FleetDrift:
    """Days of flights three days apart, errors up to 5 %; the last of the first vehicles change.

    Where errors are relative they are of that size, and stated of each estimate.
    """
    rng = np.random.default_rng(seed)
    errors = rng.uniform(least, 0.05, (vehicles, n))
    if relative is not None:
        errors[:] = relative
    moved = understated * errors * rng.normal(size=(vehicles, n))
    moved[0] *= first_understated
    moved += spread * rng.normal(size=(vehicles, n))
    moved += season * np.sin(2.0 * np.pi * np.arange(n) / n)
    moved[:changed, n - last :] += change
    by_day = days * rng.normal(size=(vehicles, n // a_day))
    for day in range(1, n // a_day):
        by_day[:, day] *= np.sqrt(1.0 - memory**2)
        by_day[:, day] += memory * by_day[:, day - 1]
    moved += np.repeat(by_day, a_day, axis=1)
    base = 10.0 * (1.0 + 0.1 * rng.normal(size=(vehicles, 1)))
    sized = base if relative is None else base * (1.0 + moved)
    flown = np.arange(n) // a_day
    return find_drift(
        FlightEstimates.of(
            ["Lp"],
            np.repeat([f"{i:03}" for i in range(vehicles)], n).tolist(),
            (base * (1.0 + moved)).reshape(-1, 1),
            ((sized * errors) ** 2).reshape(-1, 1, 1),
            time_s=np.tile(
                3600.0 * hour + DAY_S * (3.0 * flown + 0.1 * (np.arange(n) % a_day)), vehicles
            ),
        ),
        events=events,
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


@pytest.mark.parametrize(("fleets", "few"), [(5, 1), pytest.param(20, 4, marks=pytest.mark.slow)])
def test_days_that_differ_and_errors_of_each_estimate_are_no_change(fleets: int, few: int) -> None:
    """Flights of a day as independent, and errors as stated: 68 and 26 of 100 such fleets alarm."""
    for options in ({"a_day": 2, "days": 0.04}, {"relative": 0.2}):
        alarmed = [seed for seed in range(fleets) if _alarmed(_drift(seed, 10, 24, **options))]
        assert len(alarmed) <= few, (options, alarmed)


def test_what_days_differ_by_is_said() -> None:
    assert _alarmed(_drift(4, 10, 24, a_day=2, days=0.02, change=0.15, changed=2, last=12)) == {
        0,
        1,
    }
    (errors,) = _drift(5, 10, 24, a_day=2, days=0.04).errors.values()
    assert errors.typical < 1.2
    assert 0.7 < errors.days < 1.8
    far = _drift(5, 8, 24, a_day=2, days=0.08)
    assert "days differ by" in errors_lights(far, {})[0].message
    # Morning and evening of a day of the Pacific are two days of UTC.
    assert days_of(3600.0 * np.array([18.0, 25.5, 42.0, 49.5])).tolist() == [0, 0, 1, 1]
    rng = np.random.default_rng(5)
    ids, day = np.repeat([*"abcdefgh"], 24).tolist(), np.tile(np.arange(24) // 2, 8)
    values = 10.0 + np.repeat(0.8 * rng.normal(size=96), 2) + 0.3 * rng.normal(size=192)
    times = DAY_S * (3.0 * day + 0.1 * (np.arange(192) % 2))
    errors = np.full((192, 1, 1), 0.09)
    sound = FlightEstimates.of(["Lp"], ids, values[:, None], errors, time_s=times)
    assert sum(map(len, without_odd_flights(sound)[1].values())) <= 2, (
        "by the pairs of days alone 14"
    )


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
    # An afternoon of the Pacific is one day, though midnight of UTC lies in it.
    (one,) = _drift(7, 12, 24, change=-0.12, changed=12, last=10, a_day=2, hour=22.5).shared
    assert one.since_s == 7 * 3.0 * DAY_S + 22.5 * 3600.0
    # Of fewer than five that all move alike nobody knows whose it is; a witness tells.
    (few,) = _drift(7, 3, 20, season=0.06).alike
    assert few.vehicles == ("000", "001", "002")
    assert "all 3 vehicles moved alike" in few.words({})
    assert not _drift(7, 4, 20, change=-0.12, changed=2, last=8).alike
    # Three of four that stepped together were "of the type" though the fourth had stayed.
    stepped = _drift(7, 4, 20, change=-0.15, changed=3, last=8)
    assert _alarmed(stepped) == {0, 1, 2}
    assert not stepped.alike


def test_a_week_begins_with_its_first_flight() -> None:
    """By the calendar a round of flights lay in two weeks: of five vehicles no season came off."""
    rng, (k, n) = np.random.default_rng(2), (12, 14)
    days = 10.0 * np.arange(n) + 0.3 * np.arange(k)[:, None]
    values = 10.0 * (
        1.0 + 0.06 * np.sin(2.0 * np.pi * days / 180.0) + 0.01 * rng.normal(size=(k, n))
    )
    data = FlightEstimates.of(
        ["Lp"],
        np.repeat([f"{i:02}" for i in range(k)], n).tolist(),
        values.reshape(-1, 1),
        np.full((k * n, 1, 1), 0.01),
        time_s=DAY_S * days.reshape(-1),
    )
    found = shared_level(data, 0)
    assert found is not None
    left = (values.reshape(-1) - found.moved).reshape(k, n)
    assert np.all(found.moved != 0.0)
    assert np.max(np.std(left, axis=1)) < 0.2


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
    # Of 15 by -30 % in the last two 12, where a step was placed three from the end at the latest.
    assert sum(low <= 100.0 * change <= high for low, high in filter(None, ends)) >= 14
    assert not any(each.kind == DRIFT for each in found.alarms)


def test_a_vehicle_whose_own_errors_are_understated_is_judged_by_its_own_flights() -> None:
    """Errors of one of six told half as large: of 12 fleets it was red in four."""
    found = [_drift(seed, 6, 20, first_understated=2.0) for seed in range(12)]
    assert sum(0 in _alarmed(each) for each in found) <= 1
    own = [one for each in found for one in each.scales if one.vehicle == "000"]
    assert len(own) >= 6
    assert np.median([each.factor for each in own]) == pytest.approx(2.0, rel=0.2)
    said = [note for each in found for note in each.summary().notes if "000: Lp scatters" in note]
    assert len(said) == sum(each.is_sure for each in own) >= 4
    others = sum(one.vehicle != "000" for each in found for one in each.scales)
    assert others <= 7  # 5 % of 60, and chance


@pytest.mark.slow
def test_few_steps_are_missed_for_a_vehicles_own_scatter() -> None:
    """Of 80 steps of 10 % in 12 flights 78 were found with the fleet's errors alone."""
    found = [_drift(seed, 20, 12, change=0.1, changed=5, last=5) for seed in range(16)]
    assert sum(len(_alarmed(each) & set(range(5))) for each in found) >= 72
    assert sum(len(_alarmed(each) - set(range(5))) for each in found) <= 4


@pytest.mark.parametrize(("step", "low", "high"), [(0.0, 0.85, 1.05), (2.0, 1.3, 1.6)])
def test_what_days_differ_by_is_told_beside_changes_too(
    step: float, low: float, high: float
) -> None:
    """Six vehicles of six days; by the median step 1.04, and 1.82 where all change, of 9.9 free."""
    flight, found = np.arange(24), []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        days = 0.4 * np.repeat(rng.normal(size=(6, 6)), 4, axis=1)
        values = 10.0 + days + 0.3 * rng.normal(size=(6, 24)) + step * (flight >= 12)
        times = np.tile(DAY_S * (3.0 * (flight // 4) + 0.1 * (flight % 4)), 6)
        ids, errors = np.repeat([*"abcdef"], 24).tolist(), np.full(144, 0.09)
        data = FlightEstimates.of(
            ["L"], ids, values.reshape(-1, 1), errors.reshape(-1, 1, 1), time_s=times
        )
        found.append(shared_by_day(data, 0, errors))
    assert low < np.mean([each.variances[0] for each in found]) / 0.16 < high
    assert max(each.freedom for each in found) == pytest.approx(19.2, abs=0.1)


@pytest.mark.slow
def test_few_days_that_differ_are_no_change() -> None:
    """Days' spread was taken as known though 15 or 12 steps from day to day tell it: 15 alarms."""
    for vehicles, a_day in ((3, 4), (4, 6)):
        found = [_drift(seed, vehicles, 24, a_day=a_day, days=0.08) for seed in range(60)]
        assert sum(bool(each.alarms) for each in found) <= 3


@pytest.mark.slow
def test_six_days_tell_a_change_or_how_many_more_would() -> None:
    """Steps of 15 % in one of six vehicles of six days that differ by 4 %: all were red before days
    that go on were asked for, which alarmed falsely in a third of such fleets where they do.
    """
    options = {"a_day": 4, "days": 0.04, "change": 0.15, "changed": 1, "last": 12}
    found = [_drift(seed, 6, 24, **options) for seed in range(80)]
    red = sum(0 in _alarmed(each) for each in found)
    amber = [one for each in found for one in each.going_on if one.vehicle == "000"]
    assert red >= 20  # 25 as counted
    assert red + len(amber) >= 44  # 51
    assert sum(len(_alarmed(each) - {0}) for each in found) <= 2
    # Of two fleets chance says that days surely go on: then no number of days is told.
    assert sum(0 < one.more_days <= 20 for one in amber) >= len(amber) - 4


def test_one_wild_flight_leaves_the_type_as_it_is() -> None:
    """One thrust of 1e9 among 48 flights made a next vehicle of -8.7e7 to 1.3e8, and all green."""
    rng = np.random.default_rng(2)
    values = np.repeat(140.0 * (1.0 + 0.04 * rng.normal(size=6)), 8) + 2.0 * rng.normal(size=48)
    times, ids = np.tile(3.0 * DAY_S * np.arange(8), 6), np.repeat([*"abcdef"], 8).tolist()

    def of(measured: np.ndarray) -> FlightEstimates:
        errors = np.full((48, 1, 1), 4.0)
        return FlightEstimates.of(["L"], ids, measured[:, None], errors, time_s=times)

    wild = values.copy()
    wild[11] = 1e9
    quiet, found = (
        estimate_population(without_odd_flights(of(each))[0]) for each in (values, wild)
    )
    assert without_odd_flights(of(wild))[1] == {"L": (of(wild).flights[11],)}
    assert without_odd_flights(of(values))[1] == {}
    two = of(wild).chosen(np.array([8, 11, 0, 1, 16, 17]))  # which of two is astray nobody knows
    assert without_odd_flights(two)[1] == {}
    stepped = values.copy()
    stepped[15] *= 1.4  # the one flight behind a new motor of the second vehicle
    motor = FleetEvent("new motor", 20.0 * DAY_S, ("b",))
    assert list(without_odd_flights(of(stepped))[1]) == ["L"]
    assert without_odd_flights(of(stepped), [motor])[1] == {}
    for name in ("mean", "next_vehicle"):
        one, other = (getattr(each.parameters["L"], name).interval95 for each in (quiet, found))
        assert other == pytest.approx(one, rel=0.02)


@pytest.mark.parametrize("behind", [1, 2, 4])
def test_a_flight_soon_after_a_declared_event_is_not_off(behind: int) -> None:
    """Of 20 vehicles with a new motor, 15 to 20 had their newest flight off in its first four."""
    rng = np.random.default_rng(behind)
    values = 10.0 * (1.0 + 0.03 * rng.normal(size=(10, 20)))
    values[0, 20 - behind :] *= 1.2
    data = FlightEstimates.of(
        ["L"],
        np.repeat([*"abcdefghij"], 20).tolist(),
        values.reshape(-1, 1),
        np.full((200, 1, 1), 0.09),
        time_s=np.tile(3.0 * DAY_S * np.arange(20), 10),
    )
    motor = FleetEvent("new motor", 3.0 * DAY_S * (20 - behind) - 1.0, ("a",))
    found = find_drift(data, events=[motor])
    assert "a" not in {each.vehicle for each in (*found.newest_off, *found.alarms)}
    (effect,) = next(each.events for each in found.histories if each.vehicle == "a")
    assert effect.percent.interval95 is not None
    assert effect.percent.interval95[0] < 20.0 < effect.percent.interval95[1]
    untold = find_drift(data)
    assert "a" in {each.vehicle for each in (*untold.newest_off, *untold.alarms)}


def test_flights_that_go_on_as_their_neighbours_did_are_no_change() -> None:
    """Of 40 fleets 33 had a red vehicle, where days go on by half; changes beside that stay."""
    found = _drift(3, 10, 24, days=0.04, memory=0.5, change=0.3, changed=1, last=9)
    assert _alarmed(found) == {0}
    seen = found.persistent["Lp"]
    assert 0.3 <= seen.correlation <= 0.9
    assert "flights go on as their neighbours did" in " ".join(found.summary().notes)
    assert "beside a real change some 6 %, the mean of fleets" in found.summary().notes[0]
    alone = _drift(5, 10, 24, days=0.04, memory=0.9)
    assert len(_alarmed(alone)) <= 1 < len(alone.going_on)
    (light, *_) = persistent_lights(alone, {})
    assert (light.code, light.light) == ("days-go-on", "amber")
    said = going_on_words(alone.going_on[0], {})
    assert "% (" in said
    assert "or its flights go on as their neighbours did" in said
    # Taken as in proportion to a flight's own errors, what went on left a red vehicle in both.
    assert not any(_alarmed(_drift(k, 10, 24, days=0.05, memory=0.9)) for k in (1, 8))
    # An event is no change of what goes on: in 60 fleets one of three was told in 49, now in 8.
    motors = [FleetEvent("motor", 36.0 * DAY_S - 1.0, (f"{i:03}",)) for i in range(5)]
    told = [_drift(k, 10, 24, days=0.05, memory=0.9, events=motors).by_event for k in range(4)]
    assert sum(map(bool, told)) <= 1
    # Half of them changed at one date: that is no memory.
    assert _alarmed(_drift(6, 10, 24, change=0.2, changed=5, last=9)) == set(range(5))
    # Small steps of many: those who share in none would go on as well; unasked, none was found.
    many = _alarmed(_drift(4, 60, 24, change=0.05, changed=24, last=12))
    assert len(many & set(range(24))) >= 15
    assert len(many - set(range(24))) <= 1


@pytest.mark.slow
def test_few_fleets_whose_days_go_on_alarm_and_independent_ones_keep_their_power() -> None:
    """Of 24 fleets 20 alarmed; of 48 steps of 10 % all were found."""
    fleets = [_drift(seed, 10, 24, days=0.04, memory=0.5) for seed in range(24)]
    assert sum(bool(each.newest_off) for each in fleets) <= 4
    alarmed = [_alarmed(each) for each in fleets]
    assert sum(map(bool, alarmed)) <= 5
    assert sum(map(len, alarmed)) <= 8
    longer = [_drift(seed, 10, 24, days=0.05, memory=0.9) for seed in range(24)]
    assert sum(bool(each.alarms) for each in longer) <= 2  # of what goes on in proportion 7
    found = [_drift(seed, 10, 24, change=0.1, changed=2, last=8) for seed in range(24)]
    assert sum(len(_alarmed(each) & {0, 1}) for each in found) >= 44


def _of_two(seed: int) -> FleetDrift:
    """Six vehicles of 20 days that go on by 0.8 at 5 %, in parameters of 3 and 5 % errors."""
    rng, errors = np.random.default_rng(seed), np.array([0.3, 0.5])
    days = rng.normal(size=(6, 20, 2))
    for day in range(1, 20):
        days[:, day] = 0.8 * days[:, day - 1] + 0.6 * days[:, day]
    values = 10.0 * (1.0 + 0.06 * rng.normal(size=(6, 1, 2))) + 0.5 * days
    values += errors * rng.normal(size=(6, 20, 2))
    return find_drift(
        FlightEstimates.of(
            ["Lp", "T_m"],
            np.repeat([*"abcdef"], 20).tolist(),
            values.reshape(-1, 2),
            np.tile(np.diag(errors**2), (120, 1, 1)),
            time_s=np.tile(10.0 * DAY_S * np.arange(20.0), 6),
        )
    )


def test_what_goes_on_in_one_parameter_or_on_few_days_may_go_on() -> None:
    """Red where its own days alone did not tell: of two parameters one, and on twelve days."""
    found = _of_two(13)
    assert set(found.persistent) == {"Lp", "T_m"}
    assert not found.alarms
    few = _drift(9, 10, 24, a_day=2, days=0.05, memory=0.9)
    assert not few.alarms
    assert few.going_on
    assert "Lp: flights may go on as their neighbours did" in " ".join(few.summary().notes)


def test_what_small_fleets_do_not_tell_from_days_that_go_on_is_amber() -> None:
    """Three vehicles of 16 days by 0.8 at 4 %, without a change: red in each of these fleets."""
    found = [_drift(seed, 3, 16, days=0.04, memory=0.8) for seed in (4, 5)]
    assert not any(each.alarms or each.persistent for each in found)
    # Of 8 days no memory was asked: red as well.
    assert not any(_drift(seed, 3, 8, days=0.05, memory=0.9).alarms for seed in (1, 5))
    doubted = [one for each in found for one in each.going_on]
    assert all(0 < each.more_days < 60 for each in doubted)
    said = going_on_words(doubted[0], {})
    assert re.search(r"which so few do not tell: flights of each vehicle on some \d+ more", said)
    # What stands far above both is red.
    for vehicles, n in ((3, 16), (6, 12)):
        assert 0 in _alarmed(_drift(1, vehicles, n, change=0.2, changed=1, last=6))


def test_days_speak_for_a_memory_as_all_changes_averaged_do() -> None:
    """Against densities of every change by itself, levels left free, of one vehicle."""
    rng, share, correlation = np.random.default_rng(5), 0.6, 0.8
    values, variances = 3.0 + rng.normal(size=(1, 9)), rng.uniform(0.5, 2.0, (1, 9))
    group = DayGroup(values, variances, np.ones((1, 9, 1)))
    log, factor = evidence([group], share, correlation)
    lag = np.abs(np.subtract.outer(np.arange(9), np.arange(9)))
    memory = (1.0 - share) * np.diag(variances[0]) + share * correlation**lag

    def density(added: np.ndarray) -> float:
        covariance, one = factor * memory + added, np.ones(9)
        inverse = np.linalg.inv(covariance)
        known = one @ inverse @ one
        left = values[0] - one * (one @ inverse @ values[0]) / known
        log_size = np.linalg.slogdet(covariance)[1] + np.log(known)
        return float(np.exp(-0.5 * (log_size + left @ inverse @ left)))

    alone, changed = density(np.zeros((9, 9))), 0.0
    for spread in SPREADS:
        for kind in change_shapes(9):
            changed += sum(density(spread**2 * np.outer(s, s)) for s in kind.T) / kind.shape[1] / 6
    expected = np.mean((1.0 - CHANGING) * alone + CHANGING * changed)
    assert log == pytest.approx(np.log(expected), abs=1e-9)


@pytest.mark.slow
def test_few_fleets_of_few_days_that_go_on_alarm() -> None:
    """Of 60 fleets 7 did, of 200 now 13; of two parameters 11 of 40, and 4 of 100."""
    alone = [_drift(seed, 10, 24, a_day=2, days=0.05, memory=0.9) for seed in range(40)]
    assert sum(bool(each.alarms) for each in alone) <= 5
    assert sum(bool(_of_two(seed).alarms) for seed in range(40)) <= 4


def test_errors_told_worse_than_others_are_not_taken_for_less_where_days_go_on() -> None:
    """Of what goes on by 0.9 a flight with errors twelve times as large had a tenth of its own."""
    rng, days = np.random.default_rng(4), np.zeros((6, 20))
    for day in range(20):
        days[:, day] = 0.9 * days[:, max(day - 1, 0)] + 0.44 * rng.normal(size=6)
    errors = 0.2 * np.where(np.arange(6) == 5, 12.0, 1.0)[:, None] * np.ones((6, 20))
    values = 10.0 + days + 0.2 * rng.normal(size=(6, 20))
    data = FlightEstimates.of(
        ["Lp"],
        np.repeat([*"abcdef"], 20).tolist(),
        values.reshape(-1, 1),
        (errors**2).reshape(-1, 1, 1),
        time_s=np.tile(10.0 * DAY_S * np.arange(20.0), 6),
    )
    found = find_drift(data)
    assert found.persistent["Lp"].share >= 0.6
    least = {each.vehicle: each.least_step for each in found.histories}
    assert least["f"] is not None
    # Steps of independent errors of 24 %, four of five at the level of one in six.
    assert (least["f"].value or 0.0) > 45.0
