"""Numbers that tuning and residual tests are asked with, at both sides of their limits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.control.tuning.requirements import TuningRequirements
from flightid.errors import OptionError
from flightid.logs.blackbox import reader
from flightid.uncertainty import foretold


def test_requirements_have_limits() -> None:
    degrees, positive = (0.0, 90.0), (0.0, None)
    limits: dict[str, tuple[float, float | None]] = {
        "phase_margin_deg": degrees,
        "angle_phase_margin_deg": degrees,
        "sensitivity_peak": (1.0, None),
        "step_limit": (1.0, None),
    }
    for name in (
        *("gain_margin_db", "delay_margin_s", "crossover_rad_s", "disturbance_bandwidth_rad_s"),
        *("disturbance_peak_db", "noise_growth", "output_noise_rms", "band_factor"),
        *("angle_crossover_rad_s", "integral_factor"),
    ):
        limits[name] = positive
    for name, (low, high) in limits.items():
        ends = [(low, 0.01), *([] if high is None else [(high, -0.01)])]
        for end, inward in ends:
            with pytest.raises(OptionError):
                TuningRequirements(**{name: end})
            made = TuningRequirements(**{name: end + inward})
            assert getattr(made, name) == end + inward
    usual = TuningRequirements()
    assert usual.to_dict() == {
        "schema": "flightid.tuning_requirements/1",
        "phase_margin_deg": 45.0,
        "gain_margin_db": 6.0,
        "sensitivity_peak": 2.0,
        "noise_growth": 2.0,
        "band_factor": 3.0,
        "step_limit": 2.0,
        "angle_phase_margin_deg": 60.0,
        "integral_factor": 2.0,
        "preset": "balanced",
        "objective": "disturbance",
    } | {name: None for name in limits if getattr(usual, name) is None}
    assert usual.peak == 2.0
    assert TuningRequirements(disturbance_peak_db=20.0).peak == 2.0
    assert TuningRequirements(disturbance_peak_db=4.0).peak == pytest.approx(10.0**0.2)
    for name in ("crossover_rad_s", "disturbance_bandwidth_rad_s"):
        assert TuningRequirements(**{name: 9.0}).has_target
    assert not usual.has_target


def test_what_can_be_foretold_of_a_residual() -> None:
    """Shares that are worked out by hand, less what chance gives."""
    # A first-order process: its last sample foretells all that its past does.
    lags = 0.8 ** np.arange(1.0, 5.0)
    assert foretold.share_from_past(lags, 400) == pytest.approx(0.64 - 0.01)
    assert foretold.share_from_past(0.0 * lags, 400) == 0.0
    assert foretold.share_from_past(np.array([1.0, 1.0]), 400) <= 1.0
    # Lags of an input that is a constant are one direction, of a power of three.
    ones, values = np.ones(3), np.array([0.5, 0.5, 0.5])
    assert foretold.share_from_inputs(values, ones, 0.0 * ones, 100) == pytest.approx(0.25)
    assert foretold.share_from_inputs(values, ones, ones, 100) == pytest.approx(0.24)
    white = np.array([1.0, 0.0, 0.0, 0.0])
    assert foretold.share_from_inputs(values, white, white, 100) == pytest.approx(0.75 - 0.03)
    # Two lags that go together by a half: eigenvalues 1/2 and 3/2.
    tied = np.array([1.0, 0.5])
    known = 0.6**2 / 2.0 / 1.5 + 0.2**2 / 2.0 / 0.5 - (1.0 / 1.5 + 1.0 / 0.5) / 50.0
    assert foretold.share_from_inputs(np.array([0.4, 0.2]), tied, white, 50) == pytest.approx(known)
    assert foretold.share_of_lags(np.array([0.6, 0.3]), 100) == pytest.approx(0.45 - 0.02)
    assert [foretold._within(each) for each in (-0.1, 0.3, 1.1)] == [0.0, 0.3, 1.0]
    assert foretold.percent_of_output(0.25, 0.2, 1.0) == pytest.approx(10.0)
    assert foretold.percent_of_output(0.25, 0.2, 0.0) is None
    assert [foretold.is_material(each) for each in (9.99, 10.0, None)] == [False, True, True]


def test_samples_that_count_by_their_colour() -> None:
    row = np.array([1.0, 2.0, -1.0, 1.0])
    first = (2.0 - 2.0 - 1.0) / 7.0
    assert foretold.independent_share(row) == 1.0
    assert foretold.independent_share(np.abs(row)) == pytest.approx((1.0 - 5 / 7) / (1.0 + 5 / 7))
    assert first < 0.0
    assert foretold.independent_share(0.0 * row) == 1.0
    long = np.cumsum(np.random.default_rng(0).standard_normal(60))
    for count, lags in ((60, 5), (19, 1)):
        part = long[:count]
        rho = [part[k:] @ part[: count - k] / (part @ part) for k in range(1, lags + 1)]
        assert foretold.chance_share(part) == pytest.approx(
            1.0 / (1.0 + 2.0 * np.sum(np.square(rho)))
        )
    assert foretold.chance_share(0.0 * long) == 1.0
    rho = np.array([long[k:] @ long[: 60 - k] / (long @ long) for k in range(1, 16)])
    known = 60.0 / (1.0 + 2.0 * np.sum(np.maximum(rho**2 - 1.0 / 60.0, 0.0)))
    assert foretold.independent_samples([long]) == pytest.approx(known)
    assert foretold.independent_samples([long, 1e-200 * long]) == pytest.approx(2.0 * known)
    assert foretold.independent_samples([0.0 * long]) == 60.0
    assert foretold.independent_samples([]) == 1.0


def test_gains_of_likelihood_count_independent_samples() -> None:
    before, after = [2.0 * np.ones(6), np.ones(4)], [np.ones(6), np.ones(4)]
    half = foretold.likelihood_gain(before, after, lambda _: 0.5)
    assert half == pytest.approx(0.5 * 5.0 * np.log(28.0 / 10.0))
    moved = foretold.expected_gain(before, after, lambda _: 0.5)
    assert moved == pytest.approx(0.5 * 5.0 * 28.0 / 10.0)
    assert np.isfinite(foretold.likelihood_gain(before, [np.zeros(6), np.zeros(4)]))
    assert foretold.expected_gain([np.zeros(6)], [np.zeros(6)]) == 0.0


def test_events_of_a_blackbox_have_stamps_names_and_reasons() -> None:
    known = next(iter(reader.EVENTS))
    told: Any = SimpleNamespace(
        events=lambda: [
            (2_500_000, reader.FLIGHT_MODE, 0b110, 0),
            (None, reader.FLIGHT_MODE, 0, 0),
            (3_000_000, reader.DISARMED, 4, 0),
            (4_000_000, known, 1, 2),
            (5_000_000, 999, 7, 8),
        ]
    )
    found = reader._events(told, {0: "ANGLE", 1: "HORIZON", 2: "BARO"})
    assert [(each.time_s, each.kind, each.text) for each in found] == [
        (2.5, "mode", "HORIZON"),
        (None, "mode", "ACRO"),
        (3.0, "arming", "disarmed (reason 4)"),
        (4.0, "event", reader.EVENTS[known]),
        (5.0, "event", "event 999: 7, 8"),
    ]


def test_the_first_scale_of_a_name_counts() -> None:
    native: Any = SimpleNamespace(numbers=lambda table, place: np.array([1.0, 2.0]) + place)
    for column, scales, values in (
        ("gyro[1]", {"gyro": 0.5, "gyro[1]": 9.0}, [2.0, 2.5]),
        ("acc[1]", {"gyro": 0.5}, [4.0, 5.0]),
        ("gyro[1]", {"gyro": 1.0}, [4.0, 5.0]),
    ):
        found = reader._scaled(native, "main", {column: 3}, scales, column)
        assert found.tolist() == values
