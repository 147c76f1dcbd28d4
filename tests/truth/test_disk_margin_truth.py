"""Disk margins and disturbance rejection against closed forms and searches by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import flightid as fid
from flightid.control.margins.disk_geometry import gain_limits, phase_limit_deg
from flightid.control.margins.disk_margin import alphas_of
from flightid.control.margins.matrix_loop import read_loops, uncertain_at
from flightid.control.margins.structured_gain import structured_gain
from flightid.errors import DataError, ModelError, OptionError, ShapeError, UnknownNameError
from flightid.responses.errors.random_error import StoredCovariance
from tests.closeness import assert_close
from tests.examples import examples


def siso(gain=4.0, delay=0.1):
    return fid.LinearSystem([[0.0]], [[gain]], [[1.0]], [[0.0]], ("e",), ("y",), [delay])


def static(matrix, inputs=("y1", "y2"), outputs=("u1", "u2")):
    matrix = np.asarray(matrix, dtype=float)
    n_out, n_in = matrix.shape
    return fid.LinearSystem(
        np.zeros((0, 0)), np.zeros((0, n_in)), np.zeros((n_out, 0)), matrix, inputs, outputs
    )


SPINNING = fid.LinearSystem(
    [[0.0, 10.0], [-10.0, 0.0]],
    np.eye(2),
    [[1.0, 10.0], [-10.0, 1.0]],
    np.zeros((2, 2)),
    ("u1", "u2"),
    ("y1", "y2"),
)
"""Doyle's satellite: each loop alone has endless gain margin and 90°, both together have little."""


@pytest.mark.parametrize("skew", [-1.0, -0.3, 0.0, 0.7, 1.0])
def test_single_loop_is_a_distance(skew):
    found = fid.disk_margin(siso(), skew=skew)
    omega = np.geomspace(1e-4, 100.0, 300_001)
    loop = 4.0 * np.exp(-0.1j * omega) / (1j * omega)
    alpha = 1 / np.max(np.abs(1 / (1 + loop) + 0.5 * (skew - 1)))
    assert_close(found.alpha.value, alpha, rtol=1e-6, why="dense search")
    low, high = gain_limits(alpha, skew)
    assert_close(found.gain_rise.value, 20 * np.log10(high), rtol=1e-5, why="disk's end")
    if low == 0.0:
        assert found.gain_fall.value is None
    else:
        assert_close(found.gain_fall.value, -20 * np.log10(low), rtol=1e-5, why="its other end")


def test_one_loop_takes_a_known_law():
    plain = fid.disk_margin(siso(4.0))
    for law in (2.0, lambda s: 2.0 + 0.0 * s):
        found = fid.disk_margin(siso(2.0), controller=law)
        assert_close(found.alpha.value, plain.alpha.value, rtol=1e-9, why="the same loop")


def test_skew_of_the_sensitivity_is_the_modulus_margin():
    found, classical = fid.disk_margin(siso(), skew=1.0), fid.margins(siso())
    assert_close(found.alpha.value, classical.modulus_margin.value, rtol=1e-6, why="|1 + L|")
    balanced = fid.disk_margin(siso())
    assert balanced.gain_rise.value < classical.gain_margin.value
    assert balanced.phase.value < classical.phase_margin.value


@examples(60)
@given(st.floats(0.05, 3.0), st.floats(-1.5, 1.5))
@example(1.0, 1.0)  # a half plane: its edge goes through infinity
def test_geometry_of_the_disk(alpha, skew):
    # Between the real values of δ, where the edge of a half plane has a pole.
    angle = (np.arange(20_000) + 0.5) * 2 * np.pi / 20_000
    delta = alpha * np.exp(1j * angle)
    edge = (1 + 0.5 * (1 - skew) * delta) / (1 - 0.5 * (1 + skew) * delta)
    low, high = gain_limits(alpha, skew)
    phase = phase_limit_deg(alpha, skew)
    on_circle = np.abs(np.diff(np.sign(np.abs(edge) - 1))) > 0
    if np.any(on_circle):
        crossing = np.abs(np.degrees(np.angle(edge[:-1][on_circle]))).min()
        assert_close(phase, crossing, atol=0.2, why="edge over the unit circle")
    else:
        assert phase == 180.0
    # Inside the limits every real gain belongs to the disk: its δ is smaller than α.
    for gain in (low * 1.001 + 1e-9, min(high, 50.0) * 0.999):
        back = (gain - 1) / (0.5 * (1 - skew) + 0.5 * (1 + skew) * gain)
        assert abs(back) <= alpha * (1 + 1e-6)
    for gain in ([low * 0.999] if low > 0 else []) + ([high * 1.001] if high < 1e6 else []):
        back = (gain - 1) / (0.5 * (1 - skew) + 0.5 * (1 + skew) * gain)
        assert abs(back) >= alpha * (1 - 1e-6)


def test_two_loops_at_once_are_weaker_than_each():
    law = static(np.eye(2))
    both = fid.disk_margin(SPINNING, controller=law)
    # With the other loop closed, L1 = 1/s.
    other = fid.LinearSystem(
        [[0.0, 10.0], [-10.0 + 10.0, -1.0]],
        [[1.0], [0.0]],
        [[1.0, 10.0]],
        [[0.0]],
        ("u1",),
        ("y1",),
    )
    alone = fid.disk_margin(other)
    assert alone.alpha.value > 1.9
    assert both.alpha.value < 0.25 * alone.alpha.value
    # A destabilising pair of gains lies just outside the disk, none inside.
    low, high = gain_limits(both.alpha.value)
    a, b, c = (np.asarray(getattr(SPINNING, k)) for k in "abc")
    for f in np.array(np.meshgrid([low, 1.0, high], [low, 1.0, high])).reshape(2, -1).T:
        inside = 1 + (f - 1) * 0.999
        assert np.all(np.linalg.eigvals(a - b @ np.diag(inside) @ c).real < 0)


@examples(25)
@given(st.integers(0, 2**32 - 1))
def test_structured_gain_of_two_is_a_search_over_one_scaling(seed):
    rng = np.random.default_rng(seed)
    m = rng.standard_normal((2, 2)) + 1j * rng.standard_normal((2, 2))

    def size(x):
        d = np.diag([np.exp(x), 1.0])
        return np.linalg.norm(d @ m @ np.linalg.inv(d), 2)

    best = minimize_scalar(size, bounds=(-8, 8), method="bounded", options={"xatol": 1e-10}).fun
    assert_close(structured_gain(m), best, rtol=1e-7, why="one scaling")


@examples(10)
@given(st.integers(0, 2**32 - 1))
def test_structured_gain_of_three_is_reached_by_phases(seed):
    # Up to three perturbations the bound is exact: some phases give that spectral radius.
    rng = np.random.default_rng(seed)
    m = rng.standard_normal((3, 3)) + 1j * rng.standard_normal((3, 3))
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 90, endpoint=False))
    one, two = np.meshgrid(turn, turn)
    phases = np.stack([one.ravel(), two.ravel(), np.ones(one.size)], axis=1)
    radius = np.max(np.abs(np.linalg.eigvals(phases[:, :, None] * m)))
    found = float(structured_gain(m))
    assert radius <= found * (1 + 1e-9)
    assert_close(radius, found, rtol=4e-3, why="grid of 4°")


def test_structured_gain_bounds():
    rng = np.random.default_rng(0)
    m = rng.standard_normal((20, 5, 5)) + 1j * rng.standard_normal((20, 5, 5))
    found = structured_gain(m)
    assert np.all(found <= np.linalg.norm(m, 2, axis=(1, 2)) * (1 + 1e-12))
    assert np.all(found >= np.abs(np.linalg.eigvals(m)).max(axis=1) * (1 - 1e-12))
    scale = np.exp(rng.uniform(-3, 3, (20, 5)))
    moved = scale[:, :, None] * m / scale[:, None, :]
    assert_close(structured_gain(moved), found, rtol=2e-3, why="scalings change nothing")
    triangle = np.triu(m)
    diagonal = np.abs(np.diagonal(triangle, axis1=1, axis2=2)).max(axis=1)
    assert_close(structured_gain(triangle), diagonal, rtol=1e-3, why="no way back: the diagonal")
    with pytest.raises(ShapeError, match="matrices are not square"):
        structured_gain(np.ones((2, 3)))
    with pytest.raises(DataError, match="a matrix is not finite"):
        structured_gain([[np.nan]])


def test_uncoupled_loops_have_the_least_of_their_margins():
    a = fid.LinearSystem(
        np.zeros((2, 2)), np.diag([4.0, 2.0]), np.eye(2), np.zeros((2, 2)),
        ("e1", "e2"), ("y1", "y2"), [0.1, 0.1],
    )  # fmt: skip
    both = fid.disk_margin(a)
    assert_close(both.alpha.value, fid.disk_margin(siso()).alpha.value, rtol=1e-3, why="worse one")


def test_where_loops_are_broken():
    plant = fid.LinearSystem(
        [[-1.0, 0.3], [0.0, -2.0]], [[3.0, 0.5], [0.2, 4.0]], np.eye(2), np.zeros((2, 2)),
        ("u1", "u2"), ("y1", "y2"), [0.05, 0.05],
    )  # fmt: skip
    law = static([[2.0, 0.3], [-0.4, 1.5]])
    found = {
        at: fid.disk_margin(plant, controller=law, at=at) for at in ("outputs", "inputs", "both")
    }
    assert found["both"].channels == ("y1", "y2", "u1", "u2")
    # Perturbations at both places hold those at one of them.
    assert found["both"].alpha.value <= min(found[k].alpha.value for k in ("outputs", "inputs"))
    turned = fid.LinearSystem(
        law.a, np.zeros((0, 2)), np.zeros((2, 0)), np.asarray(law.d)[::-1, ::-1],
        ("y2", "y1"), ("u2", "u1"),
    )  # fmt: skip
    swapped = fid.disk_margin(plant, controller=turned)
    assert swapped.channels == ("y2", "y1")
    assert_close(swapped.alpha.value, found["outputs"].alpha.value, rtol=1e-3, why="by name")


def test_unstable_loops_have_no_disk():
    found = fid.disk_margin(siso(20.0))
    assert found.alpha.value is None
    assert found.findings[0].code == "closed-loop-unstable"
    assert repr(found) == "DiskMargin(y: the closed loop is unstable)"
    coupled = fid.disk_margin(SPINNING, controller=static(-np.eye(2)))
    assert coupled.alpha.value is None


def test_measured_disk_has_intervals():
    omega = np.geomspace(0.5, 50.0, 120)
    seen = fid.FrequencyResponse.from_values(
        omega,
        siso().frequency_response(omega),
        inputs=["e"],
        outputs=["y"],
        random_error=np.full((1, 1, 120), 0.02),
    )
    found = fid.disk_margin(seen)
    exact = fid.disk_margin(siso())
    assert_close(found.alpha.value, exact.alpha.value, rtol=1e-3, why="parabola between points")
    assert found.alpha.interval95[0] < exact.alpha.value < found.alpha.interval95[1]
    assert found.summary().rows[0][0] == "disk margin"
    assert found.to_dict()["schema"] == "flightid.disk_margin/1"


@pytest.mark.nightly
def test_two_measured_loops_have_intervals_that_draws_confirm():
    plant = fid.LinearSystem(
        [[-1.0, 0.3], [0.0, -2.0]],
        [[3.0, 0.5], [0.2, 4.0]],
        np.eye(2),
        np.zeros((2, 2)),
        ("u1", "u2"),
        ("y1", "y2"),
        [0.05, 0.05],
    )
    law = static([[2.0, 0.3], [-0.4, 1.5]])
    omega = np.geomspace(1.0, 60.0, 9)
    exact, error = plant.frequency_response(omega), 0.03
    rng = np.random.default_rng(4)

    def seen(values):
        return fid.FrequencyResponse.from_values(
            omega,
            values,
            inputs=plant.inputs,
            outputs=plant.outputs,
            random_error=np.full((2, 2, 9), error),
        )

    found = fid.disk_margin(seen(exact), controller=law)
    noise = rng.standard_normal((2, 150, 2, 2, 9))
    drawn = exact * (1 + error * (noise[0] + 1j * noise[1]))
    gains = np.asarray(law.d)
    alphas = [np.min(alphas_of(each @ gains, 0.0)) for each in np.moveaxis(drawn, -1, 1)]
    half = np.ptp(found.alpha.interval95) / 2
    assert_close(1.96 * np.std(alphas), half, rtol=0.35, why="150 draws, least of many points")
    # The same errors, told as a covariance that knows one output at a time.
    spread = np.abs(exact).reshape(2, -1) * error
    matrix = np.array([np.diag(np.tile(each, 2) ** 2) for each in spread])
    told = replace(seen(exact), errors=StoredCovariance(matrix, 9))
    other = fid.disk_margin(told, controller=law)
    assert_close(np.ptp(other.alpha.interval95) / 2, half, rtol=1e-6, why="one covariance")
    nothing = fid.FrequencyResponse.from_values(
        omega, exact, inputs=plant.inputs, outputs=plant.outputs
    )
    silent = fid.disk_margin(nothing, controller=law)
    assert silent.alpha.interval95 is None
    assert "no-intervals" in [each.code for each in silent.findings]


def test_what_outputs_share_in_their_errors_is_carried():
    rng = np.random.default_rng(7)
    n = 3000
    inputs = rng.standard_normal((2, n))
    gust = 0.3 * rng.standard_normal(n)
    outputs = [0.8 * inputs[0] + gust, 0.6 * inputs[1] + 0.9 * gust]
    record = fid.Record.from_arrays(
        np.arange(n) * 0.02,
        inputs=dict(zip(("u1", "u2"), inputs, strict=True)),
        outputs=dict(zip(("y1", "y2"), outputs, strict=True)),
    )
    response = fid.estimate_response(record, band_rad_s=(5.0, 60.0), n_omega=8, window_s=4.0)
    loops = read_loops(
        response, None, None, controller=None, at="outputs", band_rad_s=None, unstable_poles=None
    )
    omega = response.omega_rad_s[2:6]
    covariance = uncertain_at(loops, omega).covariance
    own = response.covariance_at(omega)
    half = len(covariance) // 2
    for k in range(2):
        block = covariance[k * half : (k + 1) * half, k * half : (k + 1) * half]
        assert_close(block, own[k], atol=1e-9 * np.abs(own).max(), why="each output's own")
    cross = np.abs(np.diagonal(covariance[:half, half:]))
    scale = np.sqrt(np.diagonal(own[0]) * np.diagonal(own[1]))
    assert np.median(cross / scale) > 0.8
    assert fid.disk_margin(response).alpha.interval95 is not None


def test_what_makes_no_disk_is_refused():
    law = static(np.eye(2))
    with pytest.raises(OptionError, match="at is not known"):
        fid.disk_margin(SPINNING, controller=law, at="plant")
    with pytest.raises(OptionError, match="loops without a controller"):
        fid.disk_margin(SPINNING, at="inputs")
    with pytest.raises(OptionError, match="skew is not finite"):
        fid.disk_margin(SPINNING, skew=np.inf)
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        fid.disk_margin(SPINNING, band_rad_s=(1.0, 0.5))
    with pytest.raises(ShapeError, match="the controller does not fit the plant"):
        fid.disk_margin(SPINNING, controller=3.0)
    with pytest.raises(ModelError, match="the loop has no frequency response"):
        fid.disk_margin(3.0)
    with pytest.raises(ShapeError, match="the controller does not fit the plant"):
        fid.disk_margin(SPINNING, controller=static([[1.0]], ("a",), ("b",)))
    with pytest.raises(ShapeError, match="loops are not square"):
        fid.disk_margin(SPINNING, outputs="y1")
    with pytest.raises(UnknownNameError, match="there is no such output"):
        fid.disk_margin(SPINNING, outputs="p", inputs="u1")
    omega = [1.0, 2.0, 3.0]
    seen = fid.FrequencyResponse.from_values(omega, [1.0, 0.5, 0.2], inputs=["e"], outputs=["y"])
    with pytest.raises(OptionError, match="a measurement has its own band"):
        fid.disk_margin(seen, band_rad_s=(1.0, 2.0))


def test_disturbance_rejection_of_an_integrator():
    # |S| = ω/√(ω² + k²) passes −3 dB at ω = k √(r/(1 − r)), r = 10^−0.3.
    found = fid.disturbance_rejection(siso(2.0, 0.0), bandwidth_guide_rad_s=3.0)
    r = 10**-0.3
    assert_close(found.bandwidth.value, 2 * np.sqrt(r / (1 - r)), rtol=1e-6, why="closed form")
    assert_close(found.peak.value, 0.0, atol=1e-4, why="S of an integrator never passes one")
    red = [each.code for each in found.findings if each.light == "red"]
    assert red == ["disturbance-bandwidth"]
    assert found.crossings_rad_s == pytest.approx([found.bandwidth.value], rel=1e-6)


def test_disturbance_rejection_of_a_second_order_loop():
    zeta, natural = 0.3, 5.0
    loop = fid.LinearSystem(
        [[0.0, 1.0], [0.0, -2 * zeta * natural]], [[0.0], [natural**2]], [[1.0, 0.0]], [[0.0]],
        ("e",), ("y",),
    )  # fmt: skip
    found = fid.disturbance_rejection(loop)
    r = 10**-0.3
    roots = np.roots([1 - r, 4 * zeta**2 * (1 - r) + 2 * r, -r])
    assert_close(found.bandwidth.value, natural * np.sqrt(roots.max()), rtol=1e-6, why="quadratic")
    assert found.peak.value > 5.0
    assert [f.code for f in found.findings if f.light == "red"] == ["disturbance-peak"]


def test_disturbance_rejection_from_what_is_flown():
    omega = np.geomspace(0.5, 40.0, 100)
    loop = siso(3.0, 0.05)
    values = loop.frequency_response(omega)
    exact = fid.disturbance_rejection(loop)
    shape = {"inputs": ["d"], "outputs": ["phi"], "random_error": np.full((1, 1, 100), 0.02)}
    for kind, given_values in (
        ("sensitivity", 1 / (1 + values)),
        ("closed", values / (1 + values)),
    ):
        seen = fid.FrequencyResponse.from_values(omega, given_values, **shape)
        found = fid.disturbance_rejection(seen, given=kind)
        assert_close(found.bandwidth.value, exact.bandwidth.value, rtol=1e-3, why=kind)
        assert_close(found.peak.value, exact.peak.value, rtol=1e-3, why=kind)
        assert found.bandwidth.interval95[0] < exact.bandwidth.value < found.bandwidth.interval95[1]
    # dB of S moves by 0.02 σ of its own: the crossing moves by that over its slope.
    seen = fid.FrequencyResponse.from_values(omega, 1 / (1 + values), **shape)
    found = fid.disturbance_rejection(seen, given="sensitivity")
    assert_close(
        np.interp(exact.bandwidth.value, omega, found.curve.stderr_db),
        20 / np.log(10) * 0.02,
        rtol=0.02,
        why="relative errors stay as they were measured",
    )
    assert found.to_dict()["schema"] == "flightid.disturbance_rejection/1"
    assert "disturbance-rejection bandwidth" in found.summary().to_text()


def test_a_loop_without_gain_rejects_nothing():
    weak = fid.LinearSystem([[-1.0]], [[0.2]], [[1.0]], [[0.0]], ("e",), ("y",))
    found = fid.disturbance_rejection(weak)
    assert found.bandwidth.value is None
    assert "does not rise through -3 dB" in found.bandwidth.reason
    assert "no-disturbance-bandwidth" in [each.code for each in found.findings]
