"""Kinematic consistency against motions whose instrument errors are known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.conditioning import check_consistency
from flightid.conditioning.consistency_findings import _of_parameter
from flightid.conditioning.kinematics import OUTPUTS, UNITS, KinematicModel, rotation_rows
from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.errors import DataError, OptionError, SingularError, UnitError, UnknownNameError
from flightid.record import Record
from flightid.uncertainty.periodograms import periodogram
from flightid.uncertainty.residual_noise import autoregression
from tests.closeness import assert_close

TRUTH = {
    "bias_p": 0.02,
    "bias_q": -0.01,
    "bias_r": 0.005,
    "scale_p": 0.03,
    "scale_q": -0.02,
    "scale_r": 0.01,
    "delay_phi": 0.03,
    "delay_theta": 0.03,
    "delay_psi": 0.03,
}
FORCES = {"bias_ax": 0.2, "bias_ay": -0.1, "bias_az": 0.3, "delay_vn": 0.15}


def _waves(time_s: np.ndarray, *parts: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Sum of sines (frequency, phase, amplitude) and its derivative."""
    angles = [(2 * np.pi * f * time_s + phase, a, 2 * np.pi * f) for f, phase, a in parts]
    value = sum(a * np.sin(angle) for angle, a, _ in angles)
    slope = sum(a * omega * np.cos(angle) for angle, a, omega in angles)
    return np.asarray(value), np.asarray(slope)


def _motion(time_s: np.ndarray) -> dict[str, np.ndarray]:
    """A motion given in closed form: attitude and velocity first, then what sensors would read."""
    phi, phi_dot = _waves(time_s, (0.31, 0, 0.4), (0.83, 1, 0.1))
    theta, theta_dot = _waves(time_s, (0.23, 0.5, 0.25), (0.71, 0, 0.08))
    psi, psi_dot = _waves(time_s, (0.17, 0, 0.5), (0.6, 2, 0.1))
    p = phi_dot - np.sin(theta) * psi_dot
    q = theta_dot * np.cos(phi) + psi_dot * np.cos(theta) * np.sin(phi)
    r = psi_dot * np.cos(theta) * np.cos(phi) - theta_dot * np.sin(phi)
    (u, du), (v, dv), (w, dw) = (
        _waves(time_s, (f, 0.3, a)) for f, a in ((0.1, 2.0), (0.2, 1.0), (0.4, 0.5))
    )
    u = u + 15
    g = STANDARD_GRAVITY_M_S2
    ax = du - (r * v - q * w - g * np.sin(theta))
    ay = dv - (p * w - r * u + g * np.cos(theta) * np.sin(phi))
    az = dw - (q * u - p * v + g * np.cos(theta) * np.cos(phi))
    vn, ve, vd = (a * u + b * v + c * w for a, b, c in rotation_rows(phi, theta, psi))
    speed = np.sqrt(u**2 + v**2 + w**2)
    air = {"V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed)}
    names = (
        "p",
        "q",
        "r",
        "ax",
        "ay",
        "az",
        "phi",
        "theta",
        "psi",
        "u",
        "v",
        "w",
        "vn",
        "ve",
        "vd",
    )
    values = (p, q, r, ax, ay, az, phi, theta, psi, u, v, w, vn, ve, vd)
    return {**dict(zip(names, values, strict=True)), **air}


def flight(
    outputs: tuple[str, ...] = ("phi", "theta", "psi"),
    *,
    truth: dict[str, float] = TRUTH,
    seed: int = 0,
    noise: float = 0.0,
    colour: float = 0.0,
    gyro: float = 0.0,
    accelerometer: float = 0.0,
    n: int = 1200,
) -> Record:
    """Channels as measured with known errors; `colour` is the pole of the outputs' noise.

    `gyro` and `accelerometer` are deviations of white noise of rates and specific forces.
    """
    random = np.random.default_rng(seed)
    time_s = np.arange(n) * 0.02
    forces = ("ax", "ay", "az") if len(outputs) > 3 else ()
    samples = {}
    size = {**dict.fromkeys(("p", "q", "r"), gyro), **dict.fromkeys(forces, accelerometer)}
    for name in ("p", "q", "r", *forces, *outputs):
        motion = _motion(time_s - truth.get(f"delay_{name}", 0.0))[name]
        white = random.standard_normal(n + 500)
        coloured = lfilter([np.sqrt(1 - colour**2)], [1, -colour], white)[500:]
        error = noise * coloured if name in outputs else size[name] * white[500:]
        gain = 1 + truth.get(f"scale_{name}", 0.0)
        samples[name] = gain * motion + truth.get(f"bias_{name}", 0.0) + error
    return Record.from_arrays(time_s, outputs=samples, units={k: UNITS[k] for k in samples})


def test_errors_of_rates_are_recovered_without_noise() -> None:
    found = check_consistency(flight())
    for name, value in TRUTH.items():
        assert_close(found.parameters[name].value, value, atol=2e-6, why="RK4 and spline only")
    phi = found.corrected["phi"]
    truth = _motion(found.corrected.time_s)["phi"]
    assert_close(phi[50:-50], truth[50:-50], atol=1e-5, why="delay removed")
    assert_close(found.corrected["p"], _motion(found.corrected.time_s)["p"], atol=1e-5, why="bias")
    assert found.corrected.history[-2].operation == "conditioning.check_consistency"
    assert {"bias", "delay"} <= {finding.code for finding in found.findings}
    assert not any("vane" in finding.action for finding in found.findings)
    late = replace(found.parameters["delay_phi"], name="delay_alpha")
    assert "a vane ahead" in _of_parameter(late, 0.01)[0].action
    assert "bias_p" in found.summary().to_text()
    assert "phi" in found.fits().to_text()
    assert found.to_dict()["schema"] == "flightid.kinematic_consistency/1"
    assert found._repr_html_().count("<table>") == 2


@pytest.mark.parametrize(
    "velocities", [("vn", "ve", "vd"), ("V", "alpha", "beta"), ("u", "v", "w")]
)
def test_errors_of_accelerometers_are_recovered(velocities: tuple[str, ...]) -> None:
    truth = {**TRUTH, **{k: v for k, v in FORCES.items() if k != "delay_vn"}}
    record = flight(("phi", "theta", "psi", *velocities), truth=truth, n=500)
    found = check_consistency(record, estimate=[*truth])
    for name, value in truth.items():
        assert_close(found.parameters[name].value, value, atol=3e-5, why="RK4 and spline only")


def test_derivatives_of_every_output_are_exact() -> None:
    record = flight(OUTPUTS, n=50)
    inputs = {name: record[name] for name in ("p", "q", "r", "ax", "ay", "az")}
    states = tuple(f"{name}_0" for name in ("phi", "theta", "psi", "u", "v", "w"))
    errors = tuple(
        f"{kind}_{name}"
        for kind, names in (
            ("bias", (*inputs, "V")),
            ("scale", (*inputs, "vn")),
            ("delay", OUTPUTS),
        )
        for name in names
    )
    model = KinematicModel(record.time_s, inputs, OUTPUTS, (*states, *errors))
    theta = np.concatenate([[0.1, 0.2, 0.3, 15.0, 0.5, 1.0], np.full(len(errors), 0.01)])
    slopes = model.predict(theta).slopes
    for column in range(theta.size):
        step = np.zeros_like(theta)
        step[column] = 1e-5
        change = model.predict(theta + step).values - model.predict(theta - step).values
        assert_close(
            slopes[:, :, column], change / 2e-5, atol=2e-6, rtol=1e-6, why=model.parameters[column]
        )


def test_intervals_cover_the_truth_with_coloured_noise() -> None:
    inside = total = 0
    for seed in range(3):
        found = check_consistency(flight(seed=seed, noise=0.004, colour=0.9, n=500))
        for name, value in TRUTH.items():
            low, high = found.parameters[name].interval95
            inside += low <= value <= high
            total += 1
    # 27 intervals at 95 %: 21 or fewer has a chance below 1 in 100.
    assert inside >= 22, f"{inside} of {total}"


@pytest.mark.slow
def test_intervals_are_calibrated_with_coloured_noise() -> None:
    inside = []
    for seed in range(200):
        found = check_consistency(flight(seed=seed, noise=0.004, colour=0.9))
        inside += [
            found.parameters[name].interval95[0] <= value <= found.parameters[name].interval95[1]
            for name, value in TRUTH.items()
        ]
    assert 0.93 <= np.mean(inside) <= 0.97


def test_freedom_of_an_autoregression_is_the_scatter_of_its_level() -> None:
    n, levels, freedom = 1200, [], []
    for seed in range(150):
        white = np.random.default_rng(seed).standard_normal((n + 200, 1))
        model = autoregression(periodogram(lfilter([1.0], [1, -0.8], white, axis=0)[200:]), n)
        levels.append(model.spectrum()[0])
        freedom.append(model.freedom())
    scatter = np.var(levels) / np.mean(levels) ** 2
    # A chi-square level with f degrees of freedom scatters by 2 / f; 150 draws tell to 12 %.
    assert_close(2 / np.median(freedom), scatter, rtol=0.4, why="level at zero frequency")
    assert 30 < np.median(freedom) < 120


def test_autocovariance_of_an_autoregression() -> None:
    noise = lfilter([1.0], [1, -0.9], np.random.default_rng(0).standard_normal(100_000))
    expected = 0.9 ** np.arange(40) / (1 - 0.81)
    model = autoregression(periodogram(noise[:, None]), noise.size)
    assert_close(model.autocovariance(40), expected, atol=0.3, why="100,000 samples")
    still = autoregression(periodogram(np.zeros((100, 1))), 100)
    assert still.autocovariance(5).tolist() == [0.0] * 5


def test_correlated_pairs_and_wrong_signs_are_named() -> None:
    found = check_consistency(flight(), estimate=["bias_p", "bias_phi"])
    pairs = [f.message for f in found.findings if f.code == "correlated-pair"]
    assert any("phi_0" in text and "bias_phi" in text for text in pairs)
    reversed_p = check_consistency(
        flight(n=600, truth={"scale_p": -2.0}), estimate=["scale_p", "bias_p"]
    )
    assert "sign-reversed" in {f.code for f in reversed_p.findings}
    scaled = check_consistency(flight(n=600, truth={"scale_q": 0.2}), estimate=["scale_q"])
    assert "scale-factor" in {f.code for f in scaled.findings}
    clean = check_consistency(flight(n=600, truth={}), estimate=["bias_p"])
    assert [f.code for f in clean.findings] == ["consistent"]
    noisy = flight(n=600, truth={}, noise=0.001)
    rough = np.random.default_rng(1).standard_normal(600)
    noisy = noisy.replace({"p": noisy["p"] + 0.005 * rough})
    assert "gyro-noise" in {f.code for f in check_consistency(noisy, estimate=["bias_p"]).findings}
    poor = flight(n=600, truth={}).replace({"theta": 0.3 * np.sin(np.arange(600))})
    assert "poor-fit" in {f.code for f in check_consistency(poor, estimate=["bias_p"]).findings}


def test_refusals() -> None:
    record = flight()
    still = record.replace({name: 0 * record[name] for name in record.channels})
    with pytest.raises(SingularError, match=r"no effect on the outputs.*scale_p"):
        check_consistency(still)
    with pytest.raises(OptionError, match="cannot be estimated here: found bias_ax"):
        check_consistency(record, estimate=["bias_ax"])
    with pytest.raises(UnknownNameError, match="no kinematic channel has this name: found roll"):
        check_consistency(record, channels={"roll": "phi"})
    with pytest.raises(UnknownNameError, match="no such channel: found gyro_x"):
        check_consistency(record, channels={"p": "gyro_x"})
    with pytest.raises(DataError, match="needs all three rates: found no q"):
        check_consistency(record.select(["p", "r", "phi"]))
    with pytest.raises(DataError, match="needs an attitude"):
        check_consistency(record.select(["p", "q", "r"]))
    with pytest.raises(UnitError, match="channel 'phi' of record 'record' has another unit"):
        check_consistency(record.to_units(phi="deg"))
    with pytest.raises(DataError, match="too short for the parameters"):
        check_consistency(record.segment(0.0, 1.0))
    with pytest.raises(DataError, match="found 114"):
        check_consistency(record.replace({"theta": np.full(1200, 2.0)}))
    zero = np.zeros(1200)
    steep = record.replace({"p": zero, "q": zero + 0.5, "r": zero, "phi": zero})
    steep = steep.select(["p", "q", "r", "phi"])
    with pytest.raises(DataError, match=re.escape("cannot be rebuilt in Euler angles")):
        check_consistency(steep)
