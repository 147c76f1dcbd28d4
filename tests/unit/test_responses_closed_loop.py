"""Closed loops, short records, real records, the picture and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import signal

from flightid import Record, estimate_response
from flightid.cli.response import command
from flightid.errors import DataError
from flightid.plot.response import response_figure
from flightid.responses.estimators.instrument import excited_share
from tests.closeness import assert_close

DT = 0.02


def _flight(*, noise: float, closed: bool, n: int = 12000, seed: int = 0) -> Record:
    """u = r − K y(t−1) with y = 0.3 z⁻¹/(1 − 0.7 z⁻¹) u + v."""
    rng = np.random.default_rng(seed)
    r = signal.chirp(np.arange(n) * DT, 0.2, n * DT, 10.0) + 0.3 * rng.standard_normal(n)
    v = noise * rng.standard_normal(n)
    gain = 0.9 if closed else 0.0
    den = np.array([1.0, -0.7, 0.3 * gain])
    y = signal.lfilter([0, 0.3], den, r) + signal.lfilter([1, -0.7, 0], den, v)
    u = r - gain * np.concatenate([[0.0], y[:-1]])
    return Record.from_arrays(
        np.arange(n) * DT, inputs={"u": u}, outputs={"y": y}, excitations={"r": r}
    )


BAND = (3.0, 60.0)


def _truth(omega: np.ndarray) -> np.ndarray:
    z = np.exp(1j * omega * DT)
    return 0.3 / (z - 0.7)


def test_instrument_removes_the_bias_of_feedback() -> None:
    record = _flight(noise=0.6, closed=True)
    direct = estimate_response(record, band_rad_s=BAND, n_omega=20, window_s=4.0)
    ours = estimate_response(
        record, band_rad_s=BAND, n_omega=20, window_s=4.0, estimator="instrument"
    )
    truth = _truth(ours.omega_rad_s)
    spread = np.sqrt(np.diag(ours.covariance[0]))
    error = np.concatenate([(ours.response[0, 0] - truth).real, (ours.response[0, 0] - truth).imag])
    assert np.mean(np.abs(error / spread) < 1.96) > 0.85
    bias = np.abs(direct.response[0, 0] - truth) / np.abs(truth)
    assert bias.max() > 0.3, "the direct estimate must show the bias that the instrument removes"
    assert "loop-closed" in {finding.code for finding in direct.findings}
    assert "loop-closed" not in {finding.code for finding in ours.findings}
    bright, faint = (replace(ours, coherence=0 * ours.coherence + each) for each in (0.9, 0.5))
    assert ["no band is usable" in " ".join(r.summary().notes) for r in (bright, faint)] == [
        False, True,
    ]  # fmt: skip


def test_excitations_that_are_named_are_used() -> None:
    """`--excitations injected` alone stayed direct: red, and of two records "mass, trim"."""
    record = _flight(noise=0.6, closed=True, n=6000)
    asked = {"inputs": "u", "outputs": "y", "band_rad_s": BAND, "n_omega": 20}
    made = estimate_response(record, excitations="r", **asked)
    assert made.estimator.startswith("instrument")
    told = estimate_response(record, estimator="instrument", **asked)
    assert_close(made.response, told.response, rtol=1e-12, why="the same estimate")
    for known in ({"excitations": "r", "loop": "open"}, {}):
        assert estimate_response(record, **known, **asked).estimator.startswith("composite")
    both = estimate_response(record, inputs=["u", "r"], outputs="y", excitations="r")
    assert both.estimator.startswith("composite"), "one excitation is not enough for two inputs"


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.3])
def test_an_open_loop_gives_no_alarm(noise: float) -> None:
    response = estimate_response(
        _flight(noise=noise, closed=False, n=6000), band_rad_s=BAND, n_omega=20, window_s=4.0
    )
    assert "loop-closed" not in {finding.code for finding in response.findings}


def test_instrument_needs_excitations() -> None:
    record = _flight(noise=0.1, closed=True, n=2000)
    bare = record.select(["u", "y"])
    with pytest.raises(DataError, match="no excitation channel"):
        estimate_response(bare, estimator="instrument")
    with pytest.raises(DataError, match="fewer excitations than inputs"):
        estimate_response(
            record,
            inputs=["u", "r"],
            outputs="y",
            excitations="r",
            estimator="instrument",
            window_s=2.0,
        )


def test_instrument_of_an_open_loop_is_the_direct_estimate() -> None:
    record = _flight(noise=0.1, closed=False, n=4000)
    options = {"band_rad_s": BAND, "n_omega": 20, "window_s": [8.0, 4.0]}
    direct = estimate_response(record, **options)
    ours = estimate_response(record, estimator="instrument", **options)
    assert_close(ours.response, direct.response, rtol=1e-8, why="r is u")
    assert_close(ours.coherence, direct.coherence, rtol=1e-6, why="r is u")
    assert_close(ours.random_error, direct.random_error, rtol=1e-5, why="r is u")


def test_local_polynomials_leave_no_leakage() -> None:
    # A damped mode in a short record: windows leak, local polynomials do not.
    rng = np.random.default_rng(1)
    n = 1500
    u = rng.standard_normal(n + 400)
    pole = 0.93 * np.exp(0.5j)
    den = np.poly([pole, pole.conjugate()]).real
    y = signal.lfilter([0, 0.2], den, u)[400:]
    record = Record.from_arrays(np.arange(n) * DT, inputs={"u": u[400:]}, outputs={"y": y})
    omega = np.linspace(15.0, 40.0, 12)
    z = np.exp(1j * omega * DT)
    truth = 0.2 * z / (z - pole) / (z - pole.conjugate())
    local = estimate_response(record, omega_rad_s=omega, estimator="local_polynomial")
    windows = estimate_response(record, omega_rad_s=omega, window_s=5.0)
    error_local = np.abs(local.response[0, 0] / truth - 1).max()
    error_windows = np.abs(windows.response[0, 0] / truth - 1).max()
    assert error_local < 0.02
    assert error_local < 0.2 * error_windows
    assert local.coherence.min() > 0.99


def test_local_polynomials_of_two_records_and_two_inputs() -> None:
    rng = np.random.default_rng(2)
    records = []
    for n in (900, 1300):
        u = rng.standard_normal((2, n))
        y = signal.lfilter([0, 0.3], [1, -0.7], u[0]) + 0.5 * u[1] + 0.02 * rng.standard_normal(n)
        records.append(
            Record.from_arrays(np.arange(n) * DT, inputs={"a": u[0], "b": u[1]}, outputs={"y": y})
        )
    response = estimate_response(records, band_rad_s=BAND, n_omega=20, estimator="local_polynomial")
    truth = np.array([_truth(response.omega_rad_s), np.full(20, 0.5)])
    assert_close(response.response[0], truth, atol=0.03, why="noise of 0.02")
    twin = [record.replace({"b": 2 * record["a"]}) for record in records]
    with pytest.raises(DataError, match="cannot be told apart"):
        estimate_response(twin, band_rad_s=BAND, n_omega=20, estimator="local_polynomial")


def test_robot_arm_shows_its_resonances(shared_data: Path) -> None:
    u, y = np.loadtxt(shared_data / "records" / "robot_arm.csv", delimiter=",", skiprows=1).T
    record = Record.from_arrays(np.arange(1024.0), inputs={"torque": u}, outputs={"a": y})
    response = estimate_response(
        record, band_rad_s=(0.1, 2.0), n_omega=200, window_s=[200.0, 100.0]
    )
    pair = response.pair("a", "torque")
    peak = pair.omega_rad_s[np.argmax(np.abs(pair.response))]
    assert 0.2 < peak < 1.0
    assert np.median(pair.coherence) > 0.8


def test_a_weakly_excited_helicopter_is_not_over_claimed(shared_data: Path) -> None:
    path = shared_data / "records" / "trex550_hover_forward.csv"
    names = path.read_text().split("\n", 1)[0].strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    columns = dict(zip(names, table.T, strict=True))
    record = Record.from_arrays(
        np.arange(len(table)) * 0.01,
        inputs={name: columns[name] for name in ("d_lat", "d_lon")},
        outputs={name: columns[name] for name in ("p_radps", "q_radps")},
    )
    response = estimate_response(record, band_rad_s=(0.8, 12.0), n_omega=40, window_s=[16.0, 8.0])
    assert response.coherence.mean() < 0.5
    assert response.coherence.max() < 0.99
    rows = response.summary().rows
    assert any(row[3] is None or row[4] < 10 * row[3] for row in rows)


def test_picture_names_axes_and_pairs() -> None:
    response = estimate_response(
        _flight(noise=0.1, closed=False, n=3000), band_rad_s=BAND, n_omega=20
    )
    figure = response_figure(response)
    assert "y / u" in {trace.name for trace in figure.data}
    assert "coherence" in str(figure.layout.yaxis3.title.text)


def test_command(tmp_path: Path) -> None:
    record = _flight(noise=0.1, closed=False, n=3000)
    table = np.column_stack([record.time_s, record["u"], record["y"]])
    path = tmp_path / "flight.csv"
    np.savetxt(path, table, delimiter=",", header="time,u,y", comments="")
    page, stored = tmp_path / "page.html", tmp_path / "h.nc"
    arguments = [
        str(path),
        "--input",
        "u",
        "--outputs",
        "y",
        "--band",
        "3",
        "60",
        "--n-omega",
        "20",
        "--window",
        "6",
        "--window",
        "3",
        "--json",
        "--html",
        str(page),
        "--write",
        str(stored),
    ]
    run = CliRunner().invoke(command, arguments)
    assert run.exit_code == 0, run.output
    values = json.loads(run.stdout)
    assert values["schema"] == "flightid.frequency_response/1"
    assert values["window_s"] == [6.0, 3.0]
    assert page.stat().st_size > 1000
    assert stored.exists()


def _beyond_the_sweep(seed: int) -> Record:
    """A sweep to 10 rad/s at u = r − K y(t−1), gusts everywhere: beyond it u follows y alone."""
    rng = np.random.default_rng(seed)
    n = 12000
    fade = np.clip(np.minimum(np.arange(n), n - 1 - np.arange(n)) / 200.0, 0.0, 1.0)
    r = fade * signal.chirp(np.arange(n) * DT, 0.05, n * DT, 10.0 / (2.0 * np.pi))
    v = signal.lfilter([0.05], [1.0, -0.9], rng.standard_normal(n))
    den = np.array([1.0, -0.7, 0.3 * 0.9])
    y = signal.lfilter([0, 0.3], den, r) + signal.lfilter([1, -0.7, 0], den, v)
    u = r - 0.9 * np.concatenate([[0.0], y[:-1]])
    return Record.from_arrays(
        np.arange(n) * DT, inputs={"u": u}, outputs={"y": y}, excitations={"r": r}
    )


def test_feedback_beyond_the_sweep_is_not_coherent() -> None:
    """There y − H u vanishes at H = −1/controller: nothing is left, and nothing is known."""
    ours = estimate_response(
        _beyond_the_sweep(0), band_rad_s=(1.0, 60.0), n_omega=60, estimator="instrument"
    )
    omega, off = ours.omega_rad_s, np.abs(ours.response[0, 0] / _truth(ours.omega_rad_s) - 1.0)
    beyond, inside = omega > 16.0, (omega > 2.0) & (omega < 9.0)
    assert np.median(off[beyond]) > 0.5, "the inverse of the controller"
    assert ours.coherence[0, 0, beyond].max() < 0.6
    assert np.median(ours.random_error[0, 0, beyond]) > 0.2
    assert ours.coherence[0, 0, inside].min() > 0.9
    assert off[inside].max() < 0.15
    low, high = ours.pair("y", "u").usable_band()
    assert low < 2.0
    assert 9.0 < high < 16.0


def test_each_of_two_inputs_has_its_own_share() -> None:
    """Inputs that mix: what follows the excitations of one, the other taken out."""
    r = np.random.default_rng(3)
    half = r.standard_normal((5, 2, 2)) + 1j * r.standard_normal((5, 2, 2))
    excited = half @ half.conj().transpose(0, 2, 1)
    noise = np.eye(2) * np.array([0.1, 40.0])
    share = excited_share(np.linalg.inv(excited), excited + noise)
    for f in range(5):
        whole = excited[f] + noise
        for j, k in ((0, 1), (1, 0)):
            alone, all_ = (
                (m[j, j] - m[j, k] * m[k, j] / m[k, k]).real for m in (excited[f], whole)
            )
            assert_close(share[j, f], alone / all_, rtol=1e-9, why="Schur complements, by hand")
