"""What changed on a vehicle: exact chances against simulation, false alarms and power counted."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from flightid.fleet.statistics.change_kind import DRIFT, STEP, change_kind
from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.event_families import told_effects
from flightid.fleet.statistics.event_shares import event_shares
from flightid.fleet.statistics.events import (
    EventEffect,
    FleetEvent,
    beside_steps,
    event_effect,
    event_effects,
    event_steps,
)
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.largest_step import (
    largest_step_limit,
    scan_steps,
)
from flightid.fleet.statistics.least_step import LOST, POWER, largest_step_bound, least_step
from flightid.fleet.statistics.local_level import follow_level
from flightid.fleet.statistics.multiple_testing import corrected
from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.fleet.statistics.repeats import repeat_scatter
from flightid.fleet.statistics.step_chances import largest_step_chance
from flightid.fleet.statistics.wandering import squares_chance, wandering_chance
from flightid.fleet.vehicle_lights import event_words, shares_words
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import showing

DAY_S = 86400.0


@pytest.mark.parametrize(("n", "limit"), [(20, 7.29), (60, 8.65), (200, 9.66)])
def test_limits_of_the_largest_step_are_those_of_a_simulation(n: int, limit: float) -> None:
    found = largest_step_limit(n)
    assert found == pytest.approx(limit, abs=0.01)
    draws = np.random.default_rng(n).normal(size=(20_000, n))
    sums = np.cumsum(draws - draws.mean(axis=1, keepdims=True), axis=1)[:, 2 : n - 3]
    places = np.arange(3, n - 2)
    largest = np.max(sums**2 / (places * (n - places) / n), axis=1)
    # Three standard errors of a share of 20,000.
    assert np.mean(largest > found) == pytest.approx(0.05, abs=0.0047)


def test_chances_of_unequal_errors_are_even_and_bounded_in_the_tail() -> None:
    rng = np.random.default_rng(3)
    errors = rng.uniform(0.5, 2.0, 30)
    covariance = np.diag(errors**2)
    chances = np.array(
        [scan_steps(errors * rng.normal(size=30), covariance).chance for _ in range(600)]
    )
    for share in (0.05, 0.2, 0.5):
        assert np.mean(chances < share) == pytest.approx(
            share, abs=3.3 * np.sqrt(share * (1 - share) / 600)
        )
    correlations = scan_steps(np.zeros(30), covariance).correlations
    near, far = (largest_step_chance(s, correlations) for s in (63.9, 64.1))
    assert 0.3 < far / near * np.exp(0.1) < 3.0  # exact below 8 standard errors, a bound above


@pytest.mark.parametrize("freedom", [np.inf, 6.0])
def test_four_of_five_steps_of_the_least_size_are_seen(freedom: float) -> None:
    """At any place of 14 flights with errors of 1 to 4, at the level of one of twenty histories."""
    rng, n, level = np.random.default_rng(3), 14, 0.05 / 40.0
    errors = rng.uniform(1.0, 4.0, n)
    scan = replace(scan_steps(np.zeros(n), np.diag(errors**2)), freedom=freedom)
    bound = largest_step_bound(scan.correlations, level)
    assert 0.9 * level <= largest_step_chance(bound**2, scan.correlations) <= level
    size, found = least_step(scan, level) / LOST, []
    for place in np.tile(scan.places, 60):
        scale = 1.0 if np.isinf(freedom) else np.sqrt(freedom / rng.chisquare(freedom))
        values = errors * rng.normal(size=n) + size * (np.arange(n) > place)
        drawn = scan_steps(scale * values, np.diag(errors**2))
        found.append(replace(drawn, freedom=freedom).chance <= level)
    # A step shows at places beside its own as well.
    assert POWER - 0.05 <= np.mean(found) <= POWER + 0.09


@pytest.mark.slow
@pytest.mark.parametrize(("vehicles", "n"), [(6, 12), (10, 24)])
def test_the_least_step_that_is_told_is_found_in_fleets(vehicles: int, n: int) -> None:
    found = []
    for seed in range(40):
        drawn = [np.random.default_rng((vehicles, seed, k)) for k in range(2)]
        values = [10.0 + 0.3 * rng.normal(size=(vehicles, n)) for rng in drawn]
        told = find_drift(_of_rows(values[0])).histories[0]
        assert told.least_step is not None
        values[1][0, drawn[1].integers(3, n - 2) :] += 0.1 * (told.least_step.value or 0.0)
        found.append(find_drift(_of_rows(values[1])).histories[0].is_alarm)
    assert 0.7 <= np.mean(found) <= 0.95


def _of_rows(values: np.ndarray) -> FlightEstimates:
    """A row a vehicle, a flight every third day, errors of 0.3."""
    vehicles, n = values.shape
    return FlightEstimates.of(
        ["gain"],
        np.repeat([f"{i:03}" for i in range(vehicles)], n).tolist(),
        values.reshape(-1, 1),
        np.full((vehicles * n, 1, 1), 0.09),
        time_s=np.tile(3.0 * DAY_S * np.arange(n), vehicles),
    )


def test_the_filter_is_the_regression_that_it_stands_for() -> None:
    """Level and likelihood of a random walk with an unknown start, by one matrix."""
    rng = np.random.default_rng(5)
    n, rate = 12, 0.4
    time_s = np.sort(rng.uniform(0.0, 10.0, n))
    variances = rng.uniform(0.2, 1.0, n)
    values = rng.normal(size=n)
    found = follow_level(values, variances, time_s, rate)
    since = time_s - time_s[0]
    walk = rate * np.minimum(since[:, None], since)
    total, one = walk + np.diag(variances), np.ones(n)
    inverse = np.linalg.inv(total)
    mean = one @ inverse @ values / (one @ inverse @ one)
    gain = walk @ inverse
    level = mean + gain @ (values - mean)
    left = one - gain @ one
    spread = np.diag(walk - gain @ walk) + left**2 / (one @ inverse @ one)
    np.testing.assert_allclose(found.level, level, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.variance, spread, rtol=0.0, atol=1e-12)
    cost = np.linalg.slogdet(total)[1] + (values - mean) @ inverse @ (values - mean)
    cost += np.log(one @ inverse @ one) + (n - 1) * np.log(2.0 * np.pi)
    assert found.log_likelihood == pytest.approx(-0.5 * cost, rel=1e-12)


def test_chances_of_wandering_are_even() -> None:
    assert squares_chance(18.307038, np.ones(10)) == pytest.approx(0.05, rel=0.01)
    rng = np.random.default_rng(6)
    time_s, errors = np.sort(rng.uniform(0.0, 1.0, 25)), rng.uniform(0.5, 2.0, 25)
    covariance = np.diag(errors**2)
    chances = np.array(
        [wandering_chance(errors * rng.normal(size=25), covariance, time_s) for _ in range(2000)]
    )
    for share in (0.05, 0.2, 0.5):
        assert np.mean(chances < share) == pytest.approx(
            share, abs=3.3 * np.sqrt(share * (1 - share) / 2000) + 0.02 * share
        )


def test_corrected_chances_are_the_published_ones() -> None:
    """Benjamini & Hochberg (1995), section 3.2: four of fifteen at 5 %."""
    chances = [
        *(0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240),
        *(0.4262, 0.5719, 0.6528, 0.7590, 1.0),
    ]
    found = corrected(chances)
    assert np.count_nonzero(found <= 0.05) == 4
    assert found[0] == pytest.approx(0.0015)


def _fleet(
    seed: int,
    vehicles: int,
    *,
    change: float = 0.0,
    changed: int = 0,
    understated: float = 1.0,
    explained: bool = False,
) -> tuple[FlightEstimates, dict[str, list[float | str | None]]]:
    """Two flights a day for 20 days, errors of 2 to 5 %; a step behind flight 26 of some."""
    rng = np.random.default_rng(seed)
    n = 40
    days = np.tile(DAY_S * np.repeat(np.arange(20), 2) + np.tile([0.0, 3600.0], 20), vehicles)
    errors = rng.uniform(0.02, 0.05, vehicles * n)
    values = np.repeat(1.0 + 0.1 * rng.normal(size=vehicles), n)
    hit = np.repeat(np.arange(vehicles) < changed, n) & np.tile(np.arange(n) > 25, vehicles)
    values *= np.where(hit, 1.0 + change, 1.0)
    values += understated * errors * rng.normal(size=vehicles * n)
    covariates: dict[str, list[float | str | None]] = {}
    if explained:
        battery = rng.uniform(14.0, 17.0, vehicles * n)
        firmware = np.where(days > 10 * DAY_S, "4.6", "4.5")
        values += 0.02 * (battery - 15.5) + 0.08 * (firmware == "4.6")
        covariates = {"battery": battery.tolist(), "firmware": firmware.tolist()}
    data = FlightEstimates.of(
        ["gain"],
        np.repeat([f"{i:03}" for i in range(vehicles)], n).tolist(),
        values[:, None],
        (errors**2)[:, None, None],
        time_s=days,
    )
    return data, covariates


def _alarms(found: FleetDrift, changed: int) -> tuple[float, float | None]:
    """Share of vehicles with a false alarm, and of changed ones found."""
    named = {int(each.vehicle) for each in found.alarms}
    vehicles = {int(each.vehicle) for each in found.histories}
    sound = {each for each in vehicles if each >= changed}
    power = len(named - sound) / changed if changed else None
    return len(named & sound) / len(sound), power


@pytest.mark.slow
@pytest.mark.parametrize("understated", [1.0, 2.0])
@pytest.mark.parametrize("explained", [False, True])
def test_500_vehicles_without_change_raise_hardly_an_alarm(
    understated: float, explained: bool
) -> None:
    found = find_drift(*_fleet(11, 500, understated=understated, explained=explained))
    assert _alarms(found, 0)[0] <= 0.01
    assert found.repeats[0].understated == pytest.approx(understated, rel=0.05)
    for test in ("step_chance", "walk_chance"):
        chances = np.array([getattr(each, test) for each in found.histories])
        assert np.mean(chances < 0.05) == pytest.approx(0.05, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("change", "power"), [(0.05, 0.75), (0.1, 0.99), (0.2, 1.0)])
def test_changes_are_found_with_their_size(change: float, power: float) -> None:
    found = find_drift(*_fleet(12, 500, change=change, changed=200))
    false, share = _alarms(found, 200)
    assert false <= 0.05
    assert share is not None
    assert share >= power
    held = [
        low <= 100.0 * change <= high
        for each in found.alarms
        if int(each.vehicle) < 200
        for low, high in [each.change_percent.interval95 or (0.0, 0.0)]
    ]
    assert 0.91 <= np.mean(held) <= 0.99


@pytest.mark.parametrize(
    ("fleets", "n"),
    [(1, 12), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((3, 24), (12, 12)))],
)
def test_the_size_of_a_drift_is_all_of_it(fleets: int, n: int) -> None:
    """Levels that fall by 30 % from some flight on: a best step would tell two thirds of it."""
    held: dict[str, list[bool]] = {}
    told = []
    for seed in range(fleets):
        rng = np.random.default_rng(seed)
        start, k = np.repeat(rng.integers(0, n // 2, 40), n), np.tile(np.arange(n), 40)
        fallen = 0.3 * np.clip((k - start) / (n - 1 - start), 0.0, 1.0)
        errors = rng.uniform(0.02, 0.05, 40 * n)
        values = np.repeat(1.0 + 0.1 * rng.normal(size=40), n) * (1.0 - fallen)
        values += errors * rng.normal(size=40 * n)
        names = np.repeat([f"{i:03}" for i in range(40)], n).tolist()
        # Each at its own time: what all do by date is shared, and no vehicle's.
        time_s = DAY_S * (k + 1000.0 * np.repeat(np.arange(40), n))
        data = FlightEstimates.of(
            ["gain"], names, values[:, None], (errors**2)[:, None, None], time_s=time_s
        )
        for each in find_drift(data).alarms:
            low, high = each.change_percent.interval95 or (0.0, 0.0)
            held.setdefault(each.kind, []).append(low <= -30.0 <= high)
            if each.kind == "drift":
                told.append(each.change_percent.value)
                assert each.changed_s is not None
                assert each.changed_s[1] == each.time_s[-1]
    assert len(held["drift"]) > 0.85 * 40 * fleets
    assert 0.90 <= np.mean(held["drift"]) <= 0.99
    assert np.mean(told) == pytest.approx(-30.0, abs=1.0)


@pytest.mark.slow
def test_a_change_of_many_beside_a_new_firmware_is_not_laid_on_the_others() -> None:
    found = find_drift(*_fleet(13, 500, change=0.1, changed=200, explained=True))
    false, share = _alarms(found, 200)
    assert false <= 0.05
    assert share is not None
    assert share >= 0.9


def test_changes_of_many_do_not_bend_the_slope_of_a_firmware() -> None:
    """Eight of 20 step three days behind it: its 8 % were told as 10.6 (8.8 to 12.3), 4 found."""
    found = find_drift(*_fleet(13, 20, change=0.1, changed=8, explained=True))
    assert {int(each.vehicle) for each in found.alarms} == set(range(8))
    assert not found.persistent
    firmware = found.slopes["gain"][1].interval95
    assert firmware is not None
    assert firmware[0] < 0.08 < firmware[1] < 0.088


def test_a_changed_vehicle_is_found_and_a_battery_is_none() -> None:
    data, covariates = _fleet(14, 12, change=0.2, changed=1, explained=True)
    found = find_drift(data, covariates)
    assert [each.vehicle for each in found.alarms] == ["000"]
    one = found.alarms[0]
    low, high = one.change_percent.interval95 or (0.0, 0.0)
    assert low < 20.0 < high
    assert high - low < 8.0
    assert one.changed_s is not None
    assert one.changed_s[0] <= 12.05 * DAY_S <= one.changed_s[1]
    told = find_drift(data, covariates, [FleetEvent("motor replaced", 13 * DAY_S, ("000",))])
    assert not told.alarms
    (event,) = told.histories[0].events
    assert event.chance is not None
    assert event.chance < 1e-6
    assert not told.histories[5].events
    slope = next(each for each in found.slopes["gain"] if each.name == "battery")
    assert slope.value == pytest.approx(0.02, abs=0.003)
    # Without the covariates the new firmware is a step of all vehicles, and of none by itself.
    bare = find_drift(data)
    assert [each.vehicle for each in bare.alarms] == ["000"]
    (shared,) = bare.shared
    assert shared.is_step
    assert shared.change.value == pytest.approx(8.0, abs=4.0 * (shared.change.stderr or 0.0))
    assert 10 * DAY_S <= shared.since_s <= 11 * DAY_S


@pytest.mark.parametrize(("event", "n_alarms"), [(12.0, 1), (26.0, 1), (None, 2)])
def test_what_an_event_explains_is_no_alarm_and_what_is_beyond_is(
    event: float | None, n_alarms: int
) -> None:
    """Of two vehicles one steps at flight 12, one at 12 and again at 26 of 40."""
    rng, n = np.random.default_rng(3), 40
    flight = np.arange(2 * n) % n
    values = 10.0 + 0.3 * rng.normal(size=2 * n) + 2.0 * (flight >= 12)
    values[n:] += 1.5 * (flight[n:] >= 26)
    data = FlightEstimates.of(
        ["gain"], np.repeat(["a", "b"], n).tolist(), values[:, None],
        np.full((2 * n, 1, 1), 0.09), time_s=DAY_S * flight,
    )  # fmt: skip
    vehicles = () if event == 12.0 else ("b",)
    events = [] if event is None else [FleetEvent("x", t * DAY_S, vehicles) for t in (12.0, event)]
    found = find_drift(data, None, events)
    assert len(found.alarms) == n_alarms
    if event == 12.0:  # told twice, which counts once: the second step is beyond both
        assert found.alarms[0].vehicle == "b"
        assert found.alarms[0].changed_s == (25 * DAY_S, 26 * DAY_S)
        assert {h.vehicle for h, _ in found.by_event} == {"a", "b"}
    if event == 26.0:
        assert found.alarms[0].vehicle == "a"
        sizes = [effect.change.value for _, effect in found.by_event]
        assert sizes == pytest.approx([2.0, 1.5], abs=0.3)  # each beside the other


@pytest.mark.parametrize(("n", "at"), [(20, 5), (20, 18), (9, 3)])
def test_chances_beside_an_event_are_even(n: int, at: int) -> None:
    rng, days, found = np.random.default_rng(1), np.arange(float(n)), []
    known = event_steps([FleetEvent("motor", at)], days)
    for _ in range(150):
        errors = rng.uniform(0.5, 2.0, n)
        covariance = np.diag(errors**2)
        values = errors * rng.normal(size=n) + 8.0 * (days >= at)
        found.append(scan_steps(*beside_steps(values, covariance, known), known).chance)
    for share in (0.2, 0.5):
        assert np.mean(np.array(found) < share) == pytest.approx(share, abs=0.12)


@pytest.mark.parametrize("freedom", [np.inf, 5.0])
def test_an_event_is_a_change_where_its_interval_holds_none(freedom: float) -> None:
    """In percent of a level known to 5 %: to first order some were a change and held zero."""
    rng, days, told = np.random.default_rng(8), np.arange(8.0), 0
    for level in np.repeat([-1.0, 1.0], 150):
        values = level + 0.1 * rng.normal(size=8) + np.where(days >= 4, 0.16, 0.0)
        found = event_effect(
            (FleetEvent("motor", 3.5),), "gain", "1", values, 0.01 * np.eye(8), days, freedom
        )
        assert found.chance is not None
        told += found.chance < 0.05
        for size in (found.change, found.percent):
            assert size.is_significant == (found.chance < 0.05)
        if 0.001 < found.chance < 0.05:
            one = found
    assert told > 50
    # Words follow the interval that is shown, at another level too.
    history = cast("ParameterHistory", SimpleNamespace(name="gain"))
    with showing(0.999):
        assert "gain may have changed by" in event_words(history, one, {})
    assert "gain changed by" in event_words(history, one, {})
    unlike = replace(one, percent=replace(one.percent, value=None, ends=None))
    assert re.search(
        r"gain changed by \+\S+ \(\+\S+ to \+\S+\) at", event_words(history, unlike, {})
    )


def test_a_parameter_beside_one_that_changed_is_told_at_its_own_level() -> None:
    """The example's motor lag "changed" at new propellers, chance 0.03, as thrust surely did."""
    motor, board = FleetEvent("motor", 3.5, ("a",)), FleetEvent("board", 5.5, ("a",))

    def told(*chances: float, events: tuple[FleetEvent, ...] = (motor,)) -> list[bool]:
        nothing = Estimate("gain", None, "%", reason="made up")
        made = [EventEffect(events, 0, nothing, nothing, each) for each in chances]
        return told_effects([("a", each) for each in made])

    assert told(1e-9, 0.03) == [True, False]
    assert told(1e-9, 0.02) == [True, True]
    assert told(0.03) == [True]
    assert told(0.03, 0.9) == [False, False]
    assert told() == []
    # Each event of each vehicle is a family: where half of them did something, half the level.
    gone = Estimate("gain", None, "%", reason="made up")
    pairs = [(v, EventEffect((board,), 0, gone, gone, p)) for v, p in (("a", 1e-9), ("b", 0.04))]
    assert told_effects(pairs) == [True, True]
    assert told_effects([*pairs, ("c", replace(pairs[1][1], chance=0.6))]) == [True, False, False]


def test_understated_errors_show_in_repeats_and_raise_no_alarm() -> None:
    data, _ = _fleet(15, 30, understated=2.0)
    scatter = repeat_scatter(data)[0]
    assert scatter.freedom == 600
    assert not scatter.errors_hold
    low, high = scatter.understated_ends() or (0.0, 0.0)
    assert low < 2.0 < high
    assert not find_drift(data).alarms


@pytest.mark.parametrize("fleets", [6, pytest.param(25, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("short", "odd_share"), [(0.7, 0.0), (1.0, 0.03)])
def test_errors_without_repeats_raise_few_alarms(
    short: float, odd_share: float, fleets: int
) -> None:
    """Errors told 0.7 times as large, or 3 % of flights six times further off: no change."""
    rng, false, odd = np.random.default_rng(21), 0, 0
    vehicles = [f"{number:02}" for number in np.repeat(np.arange(10), 12)]
    for _ in range(fleets):
        errors = rng.normal(size=(120, 2)) * np.where(rng.random((120, 2)) < odd_share, 6.0, 1.0)
        found = find_drift(
            FlightEstimates.of(
                ["Lp", "Ltphi"],
                vehicles,
                10.0 + errors,
                np.tile(short**2 * np.eye(2), (120, 1, 1)),
                time_s=np.tile(DAY_S * np.arange(12.0), 10),
            )
        )
        false += bool(found.alarms)
        odd += sum(found.odd_flights.values())
    assert false <= fleets // 6  # without neighbours 13 and 21 of 25, with them none
    assert odd < 0.4 * fleets if odd_share == 0.0 else 3.2 * fleets < odd < 7.2 * fleets


@pytest.mark.parametrize(("gradual", "name", "other"), [(False, STEP, DRIFT), (True, DRIFT, STEP)])
def test_a_change_is_seldom_called_by_the_other_kind(gradual: bool, name: str, other: str) -> None:
    """Of 100 of 10 % in 40 flights at most 10 (5 % ± two errors); two thirds by their own name."""
    rng, found = np.random.default_rng(31), []
    for _ in range(100):
        errors, time_s = rng.uniform(0.02, 0.05, 40), np.arange(40.0)
        level = 0.1 * time_s / 39.0 if gradual else 0.1 * (time_s > 25)
        noise = errors * rng.normal(size=40)
        found.append(change_kind(1.0 + level + noise, np.diag(errors**2), time_s))
    assert found.count(other) <= 10
    assert found.count(name) >= 65


@pytest.mark.parametrize(("later", "flights"), [(0.2, 0), (1.0, 1), (2.0, 2)])
def test_events_that_flights_do_not_tell_apart_share_their_change(
    later: float, flights: int
) -> None:
    """New propellers and new firmware of one day were each given all 15 %, and tested twice."""
    rng, days, held = np.random.default_rng(9), np.arange(14.0), []
    motor, board = FleetEvent("motor", 5.5, ("a",)), FleetEvent("board", 5.5 + later, ("a",))
    for _ in range(100):
        values = 10.0 + 0.3 * rng.normal(size=14) - 1.5 * (days >= 6)
        found = event_effects(
            *((board, motor, motor), "gain", "1", values, 0.09 * np.eye(14)),
            *(days, np.zeros(14)),
        )
        assert [each.names for each in found] == (
            [("motor", "board")] if flights == 0 else [("motor",), ("board",), ("motor", "board")]
        )
        assert found[-1].between == flights
        ends = [each.percent.interval95 or (np.inf, -np.inf) for each in found]
        truth = [-15.0] if flights == 0 else [-15.0, 0.0, -15.0]
        held.append([low <= true <= high for (low, high), true in zip(ends, truth, strict=True)])
    if flights:  # What one alone did is hardly known: both together are.
        widths = [high - low for low, high in ends]
        assert min(widths[:2]) > 1.3 * widths[2]
    assert np.all(np.mean(held, axis=0) >= 0.89)
    history = cast("ParameterHistory", SimpleNamespace(name="gain"))
    said = event_words(history, found[-1], {})
    assert said.partition(" at the ")[2] == "events “motor” and “board”" + (
        " together" if flights else ", which no flight tells apart"
    )


def test_an_event_of_one_and_one_of_all_on_a_date_have_their_shares() -> None:
    """New firmware took 8 % of all, new propellers gave one 12 %: it was "no change", green."""
    rng, days, held, sure = np.random.default_rng(4), np.arange(12.0), [], 0
    motor, board = FleetEvent("motor", 5.5, ("0",)), FleetEvent("board", 5.5)

    def history(vehicle: int) -> ParameterHistory:
        step = -0.08 + 0.01 * rng.normal() + 0.12 * (vehicle == 0)
        values = 10.0 * (1.0 + step * (days >= 6)) + 0.2 * rng.normal(size=12)
        events = (motor, board) if vehicle == 0 else (board,)
        effect = event_effect(events, "gain", "1", values, 0.04 * np.eye(12), days)
        made = SimpleNamespace(name="gain", vehicle=f"{vehicle}", events=(effect,))
        return cast("ParameterHistory", made)

    for _ in range(120):
        every = [history(vehicle) for vehicle in range(6)]
        shares = event_shares(every[0], every[0].events[0], every)
        assert shares is not None
        low, high = shares.by_own.interval95 or (0.0, 0.0)
        held.append(low <= 12.0 <= high)
        sure += shares.is_sure
    assert 0.92 <= np.mean(held) <= 0.99
    assert sure > 96
    said = shares_words(shares)
    assert re.fullmatch(
        r"“board” did -\S+ % \(.*\) on 5 others, which leaves \+.* to “motor”", said
    )
    # Two others do not tell what one of all does; of one kind alone there is nothing to part.
    assert event_shares(every[0], every[0].events[0], every[:3]) is None
    assert event_shares(every[1], every[1].events[0], every) is None
