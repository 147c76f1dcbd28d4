"""One table of handling qualities, its pictures and its report."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.dynamics import rate, rating_chart
from flightid.dynamics.handling_qualities.mode_ratings import mode_ratings
from flightid.dynamics.handling_qualities.rating import normal_draws
from flightid.dynamics.modes.names import NamedMode
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.plot.handling_qualities import (
    bandwidth_curves,
    cutoff_spectrum,
    level_chart,
    lower_order_curves,
)
from flightid.report.content import Figure
from flightid.report.handling_qualities import (
    handling_qualities_blocks,
)
from tests.closeness import assert_close


def fitted() -> fid.Fit:
    omega = np.geomspace(0.3, 60.0, 60)
    truth = fid.load_model("attitude_first_order").with_values({"Lp": -5.0, "tau": 0.05})
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((1, 1, 60), 0.05),
    )
    return fid.identify(truth, data)


def test_a_rotorcraft_model_in_one_table() -> None:
    hover = fid.load_model("r50_hover")
    found = fid.handling_qualities(hover, signs={"pitch": -1}, band_rad_s=(1.0, 60.0))
    assert list(found.bandwidths) == ["roll", "pitch", "yaw"]
    roll = fid.attitude_bandwidth(hover, "lat", "phi", band_rad_s=(1.0, 60.0))
    assert_close(
        found.bandwidths["roll"].uncertain.numbers, roll.uncertain.numbers, rtol=1e-12, why="same"
    )
    assert found.bandwidths["yaw"].output == "r"
    assert {rating.subject for rating in found.ratings} == {"phi/lat", "theta/lon", "r/ped"}
    assert found.modes is not None
    text = str(found.summary())
    assert "Boundaries not confirmed" in text
    assert "piloted vehicles of full size" in text
    assert repr(found) == "HandlingQualities(3 axes, 3 levels, worst Level 1)"
    json.dumps(found.to_dict(), allow_nan=False)
    assert "<table" in found._repr_html_()
    codes = {finding.code for finding in found.findings}
    assert {"gain-limited", "phase-nonlinear", "level-attitude-bandwidth"} <= codes


def test_a_control_of_the_other_sign_is_found_and_said() -> None:
    hover = fid.load_model("r50_hover")
    asked = {"band_rad_s": (1.0, 60.0), "axes": {"pitch": ("theta", "lon")}}
    found = fid.handling_qualities(hover, **asked)
    told = fid.handling_qualities(hover, signs={"pitch": -1}, **asked)
    ours, theirs = found.bandwidths["pitch"].uncertain, told.bandwidths["pitch"].uncertain
    assert_close(ours.numbers, theirs.numbers, rtol=1e-12, why="the same sign")
    (said,) = [each for each in found.findings if each.code == "sign-found"]
    assert said.message.startswith("pitch: the control pulls the other way")
    assert "sign-found" not in {each.code for each in told.findings}
    # Told wrongly, it is not rated.
    wrong = fid.handling_qualities(hover, signs={"pitch": 1}, **asked)
    assert "theta/lon" not in {rating.subject for rating in wrong.ratings}


def unstable_pitch() -> fid.StateSpaceModel:
    return fid.load_model("short_period").with_values({"Malpha": 20.0})


def test_a_divergence_is_red_with_its_time_to_double() -> None:
    found = fid.handling_qualities(unstable_pitch(), vehicle="aeroplane", category="B")
    growth = max(unstable_pitch().eigenvalues().real)
    (said,) = [each for each in found.findings if each.code == "divergence"]
    assert said.light.value == "red"
    assert f"time to double {np.log(2.0) / growth:.3g}"[:18] in said.message
    assert "no-level" in {each.code for each in found.findings}


def test_the_load_factor_slope_is_computed_or_named_as_missing() -> None:
    model = fid.load_model("short_period")
    found = fid.handling_qualities(model, vehicle="aeroplane", category="B")
    (cap,) = [each for each in found.ratings if each.chart.key == "control_anticipation"]
    slope = 108.6 / 9.80665
    frequency = abs(model.eigenvalues()[0])
    assert_close(cap.values["cap"], frequency**2 / slope, rtol=1e-9, why="-Zalpha/g")
    assert "n-alpha" in {each.code for each in found.findings}
    told = fid.handling_qualities(model, vehicle="aeroplane", category="B", n_alpha=12.0)
    assert "n-alpha" not in {each.code for each in told.findings}
    system = model.linear_system()
    bare = fid.handling_qualities(system, vehicle="aeroplane", category="B", axes={})
    named = {each.code for each in bare.findings}
    assert ("no-n-alpha" in named) == any(mode.name == "short period" for mode in bare.modes or ())


def test_modes_of_an_aeroplane_have_their_levels() -> None:
    lateral = fid.load_model("fixed_wing_lateral")
    found = fid.handling_qualities(lateral, vehicle="aeroplane", category="A", axes={})
    levels = {rating.subject: rating for rating in found.ratings}
    assert set(levels) == {"spiral", "Dutch roll", "roll"}
    mode = fid.modes(lateral).mode("Dutch roll")
    assert mode.eigenvalue is not None
    assert_close(levels["Dutch roll"].values["decay"], -mode.eigenvalue.real, rtol=1e-12, why="ζω")
    assert_close(
        levels["Dutch roll"].values["damping"], mode.damping_ratio.value, rtol=1e-12, why="ζ"
    )
    assert levels["spiral"].values["time_to_double"] == np.inf
    assert levels["roll"].values["time_constant"] == mode_time(lateral, "roll")
    longitudinal = fid.load_model("fixed_wing_longitudinal")
    pitch = fid.handling_qualities(
        longitudinal, vehicle="aeroplane", category="B", axes={}, n_alpha=10.0
    )
    keys = [rating.chart.key for rating in pitch.ratings]
    assert keys == ["phugoid", "short_period_damping", "control_anticipation"]
    cap = pitch.ratings[2].values["cap"]
    frequency = fid.modes(longitudinal).mode("short period").natural_frequency.value
    assert frequency is not None
    assert_close(cap, frequency**2 / 10.0, rtol=1e-12, why="its definition")


def mode_time(model: fid.StateSpaceModel, name: str) -> float | None:
    return fid.modes(model).mode(name).time_constant.value


def test_a_growing_spiral_is_timed() -> None:
    a = np.array([[0.02, 0.0], [0.0, -2.0]])
    system = fid.LinearSystem(
        a, [[1.0], [1.0]], [[1.0, 1.0]], [[0.0]], ("lat",), ("phi",), states=("phi", "p")
    )
    slow = next(mode for mode in fid.modes(system) if mode.root.real > 0)
    spiral = replace(
        slow,
        named=NamedMode("spiral", "divergence", ""),
        covariance=np.array([[0.015**2, 0.0], [0.0, 0.0]]),
    )
    rating = mode_ratings(
        [spiral], vehicle="aeroplane", conditions={"category": "B", "class": "I"}
    )[0]
    assert_close(rating.values["time_to_double"], np.log(2.0) / 0.02, rtol=1e-12, why="ln 2/λ")
    assert rating.level == 1
    assert rating.text == "Level 1–2"
    # Level 1 to ln 2/20 s = 0.0347 rad/s: (0.0347 − 0.02)/0.015 standard errors.
    assert rating.probabilities is not None
    assert_close(rating.probabilities[0], 0.8359, atol=0.02, why="normal distribution")
    assert "without end within its uncertainty" in [each.reason for each in rating.quantities]


def test_a_measured_response_has_no_modes() -> None:
    fit = fitted()
    response = fit.responses[0].measured
    data = fid.FrequencyResponse.from_values(
        response.omega_rad_s,
        response.response,
        inputs=["tau_phi"],
        outputs=["phi"],
        random_error=response.random_error,
    )
    found = fid.handling_qualities(data, task="tracking")
    assert "no-modes" in {finding.code for finding in found.findings}
    assert found.modes is None
    assert found.ratings[0].text == "Level 1–2"
    assert "probability of level 1" in str(found.summary())


def test_channels_without_usual_names_are_asked_for() -> None:
    odd = fid.LinearSystem(
        np.diag([-1.0, -2.0]), np.eye(2), np.eye(2), np.zeros((2, 2)), ("a", "b"), ("phi", "x")
    )
    found = fid.handling_qualities(odd)
    assert "no-control" in {finding.code for finding in found.findings}
    blind = odd.select(outputs=["x"])
    assert "no-attitude" in {each.code for each in fid.handling_qualities(blind).findings}
    assert "no-bandwidth" in {
        each.code for each in fid.handling_qualities(odd, axes={"roll": ("phi", "a")}).findings
    }
    with pytest.raises(UnknownNameError, match="there is no such channel"):
        fid.handling_qualities(odd, axes={"roll": ("phi", "c")})
    with pytest.raises(OptionError, match="axis is not known"):
        fid.handling_qualities(odd, axes={"heave": ("x", "a")})
    with pytest.raises(OptionError, match="vehicle is not known"):
        fid.handling_qualities(odd, vehicle="balloon")


def test_charts_show_levels_and_the_region_of_the_estimate() -> None:
    chart = rating_chart("dutch_roll", category="A", **{"class": "IV"})
    drawn = normal_draws([0.18, 0.5, 2.8], np.diag([0.01, 0.03, 0.1]) ** 2)
    assert drawn is not None
    names = ("damping", "decay", "frequency")
    values = {"damping": 0.18, "decay": 0.5, "frequency": 2.8}
    rating = rate(chart, values, dict(zip(names, drawn, strict=True)), subject="beta/ped")
    figure = level_chart([rating, rate(chart, {**values, "damping": 0.3}, subject="other")])
    heat, outline, point = figure.data[0], figure.data[1], figure.data[2]
    # The shade under a few points is their level.
    for damping, frequency, level in ((0.5, 3.0, 1), (0.1, 3.0, 2), (0.05, 0.7, 3), (0.5, 0.3, 4)):
        row = int(np.argmin(np.abs(np.log(heat.y / frequency))))
        column = int(np.argmin(np.abs(heat.x - damping)))
        assert heat.z[row, column] == level
    assert (point.x[0], point.y[0]) == (0.18, 2.8)
    assert "Level 1–2" in point.name
    half = np.sqrt(5.9915) * 0.01
    assert_close(np.max(outline.x), 0.18 + half, rtol=0.01, why="95 % of two normal numbers")
    texts = {each.text for each in figure.layout.annotations}
    assert {"Level 1", "Level 2", "Level 3", "worse than Level 3"} <= texts
    with pytest.raises(DataError, match="there is no chart to draw"):
        level_chart(rate(rating_chart("equivalent_delay"), {"delay": 0.1}))


def test_curves_mark_what_was_read() -> None:
    found = fid.attitude_bandwidth(fitted(), "tau_phi", "phi")
    figure = bandwidth_curves(found)
    marked = {trace.name.split()[0]: trace for trace in figure.data if trace.mode == "markers"}
    assert marked["ω_180"].x[0] == found.omega_180_rad_s
    assert_close(marked["ω_180"].y[0], -180.0, atol=1e-6, why="there")
    assert_close(marked["phase"].y[0], -135.0, atol=1e-6, why="there")
    assert marked["2"].x[0] == 2.0 * found.omega_180_rad_s
    gain = found.curve.at(found.omega_180_rad_s)[0]
    assert_close(marked["gain"].y[0], gain + 6.0, atol=1e-6, why="there")


def test_reports() -> None:
    found = fid.handling_qualities(fitted(), task="tracking")
    blocks = handling_qualities_blocks(found)
    assert sum(isinstance(block, Figure) for block in blocks) == 2
    equivalent = fid.lower_order(fid.load_model("rate_motor_lag"), kind="roll")
    assert len(lower_order_curves(equivalent).data) == 4
    time_s = np.arange(0.0, 100.0, 0.02)
    hands = np.random.default_rng(1).standard_normal(len(time_s)).cumsum()
    record = fid.Record.from_arrays(time_s, inputs={"lat": hands - np.linspace(0, hands[-1], 5000)})
    cutoff = fid.pilot_cutoff(record, "lat", band_rad_s=(0.5, 100.0))
    share = np.asarray(cutoff_spectrum(cutoff).data[0].y)
    assert_close(share[-1], 100.0, rtol=1e-9, why="all of it")
