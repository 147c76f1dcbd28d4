"""Arithmetic on responses, measures of spectra, files: values, errors, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import signal

from flightid import FrequencyResponse, Record, estimate_response, load_model
from flightid.cli.program import run
from flightid.errors import DataError, FileFormatError, ShapeError
from flightid.responses import arithmetic
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.spectrum_measures import band_rms, cutoff_frequency
from flightid.responses.store import read_response, write_response
from tests.closeness import assert_close

OMEGA = np.array([1.0, 3.0, 9.0])
SILENT = StoredCovariance(np.zeros((1, 6, 6)), 3)


def _measured(seed: int = 0, output: str = "p", source: str = "u") -> FrequencyResponse:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    spread = rng.standard_normal((1, 6, 8))
    return FrequencyResponse.from_values(
        OMEGA,
        values,
        inputs=[source],
        outputs=[output],
        units={output: "rad/s"},
        coherence=[0.9, 0.8, 0.7],
        random_error=[0.1, 0.2, 0.3],
        errors=StoredCovariance(1e-6 * spread @ spread.transpose(0, 2, 1), 3),
    )


def _numeric(function, response: FrequencyResponse) -> np.ndarray:
    """Covariance through a function by numerical derivatives of stacked parts."""
    size = 1e-6
    columns = []
    for shift in np.concatenate([np.eye(3), 1j * np.eye(3)]):
        moved = replace(response, response=response.response + size * shift)
        change = (function(moved).response - function(response).response).ravel() / size
        columns.append(np.concatenate([change.real, change.imag]))
    jacobian = np.array(columns).T
    return jacobian @ response.covariance[0] @ jacobian.T


@pytest.mark.parametrize(
    "function",
    [
        lambda h: arithmetic.apply_known(h, lambda s: 1 / (0.2 * s + 1)),
        lambda h: arithmetic.apply_known(h, [1j, 2.0, 3.0 - 1j], invert=True),
        lambda h: arithmetic.add_delay(h, 0.1),
        lambda h: arithmetic.differentiate(h, -2),
        lambda h: arithmetic.close_loop(h, lambda s: 0.3 + 0.1 * s),
        lambda h: arithmetic.open_loop(h, 0.4),
        arithmetic.loop_of_sensitivity,
        lambda h: arithmetic.peel_loop(h, lambda s: 1 / (0.05 * s + 1), -0.3),
        lambda h: arithmetic.add(h, replace(_measured(4), errors=SILENT)),
    ],
)
def test_errors_pass_through_to_first_order(function) -> None:
    response = _measured()
    made = function(response)
    assert_close(
        made.covariance[0],
        _numeric(function, response),
        rtol=2e-4,
        atol=1e-12,
        why="first order; forward differences",
    )


def test_a_known_factor_keeps_the_relative_error() -> None:
    made = arithmetic.apply_known(_measured(), lambda s: 7.0 / s)
    assert_close(made.random_error, _measured().random_error, rtol=1e-12, why="exact")


def test_opening_undoes_closing_and_grows_errors() -> None:
    response = _measured()
    back = arithmetic.open_loop(arithmetic.close_loop(response, 2.0), 2.0)
    assert_close(back.response, response.response, rtol=1e-12, why="inverse")
    assert_close(back.covariance, response.covariance, rtol=1e-9, atol=1e-18, why="inverse")


def test_a_gyro_loop_is_peeled() -> None:
    s = 1j * OMEGA
    bare, servo, gyro = 5 / (s + 2), 1 / (0.05 * s + 1), 0.4 / (0.01 * s + 1)
    seen = bare * servo / (1 + bare * servo * gyro)
    augmented = FrequencyResponse.from_values(OMEGA, seen, inputs=["ped"], outputs=["r"])
    peeled = arithmetic.peel_loop(augmented, servo, gyro)
    assert_close(peeled.response[0, 0], bare, rtol=1e-12, why="closed form")


def test_measured_quotient_and_product() -> None:
    p, a = _measured(1, "p", "u"), _measured(2, "a", "u")
    ratio = arithmetic.divide(p, a)
    assert (ratio.outputs, ratio.inputs) == (("p",), ("a",))
    again = arithmetic.multiply(ratio, a)
    assert_close(again.response, p.response, rtol=1e-12, why="inverse")
    assert_close(
        ratio.random_error,
        np.hypot(p.random_error, a.random_error),
        rtol=1e-12,
        why="independent relative errors add in squares",
    )
    assert ratio.covariance is not None
    assert "taken-as-independent" in {finding.code for finding in ratio.findings}
    other = arithmetic.divide(_measured(1, "p", "u"), _measured(2, "p", "x"))
    assert (other.outputs, other.inputs) == (("x",), ("u",))
    with pytest.raises(DataError, match="share no channel"):
        arithmetic.divide(_measured(1, "p", "u"), _measured(2, "q", "x"))
    with pytest.raises(DataError, match="not in series"):
        arithmetic.multiply(p, p)
    with pytest.raises(DataError, match="different frequencies"):
        arithmetic.divide(p, a.select(band_rad_s=(1.0, 4.0)))


def test_a_sum_carries_both_errors() -> None:
    one, two = _measured(1), _measured(2)
    made = arithmetic.add(one, two)
    assert_close(made.response, one.response + two.response, rtol=1e-15, why="sum")
    assert_close(made.covariance, one.covariance + two.covariance, rtol=1e-12, why="independent")
    sizes = [np.abs(each.response) * each.random_error for each in (one, two)]
    assert_close(
        made.random_error * np.abs(made.response), np.hypot(*sizes), rtol=1e-12, why="in squares"
    )
    with pytest.raises(DataError, match="same pair"):
        arithmetic.add(one, _measured(2, "q"))
    with pytest.raises(DataError, match="result is zero or not finite"):
        arithmetic.add(one, arithmetic.apply_known(one, -1.0))


def test_the_command_peels_a_gyro_loop_and_says_what_it_cannot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Equation 19 from a file: stick to rate with actuator and gyro; then back, by a model."""
    s = 1j * OMEGA
    bare, servo, gyro = 5 / (s + 2), 1 / (0.05 * s + 1), 0.4 / (0.01 * s + 1)
    seen = np.array([bare * servo / (1 + bare * servo * gyro), servo])[:, None]
    flown = FrequencyResponse.from_values(OMEGA, seen, inputs=["ped"], outputs=["r", "d"])
    file, out = str(write_response(flown, tmp_path / "flown.nc")), tmp_path / "made.nc"

    def made(*words: str, code: int = 0) -> FrequencyResponse | str:
        assert run(["response-arithmetic", *words, "--write", str(out)]) == code, words
        said = capsys.readouterr()
        return read_response(out) if code == 0 else said.err

    of_r = ["--pair", "r/ped"]
    peeled = made("open-loop", file, "0.4 / 0.01 1", "--actuator", "1 / 0.05 1", *of_r)
    assert_close(peeled.response[0, 0], bare, rtol=1e-12, why="closed form")
    assert "open-loop" in peeled.history[-1].operation
    again = str(write_response(peeled, tmp_path / "bare.nc"))
    closed = made("close-loop", again, "0.4 / 0.01 1", "--actuator", "1 / 0.05 1")
    assert_close(closed.response[0, 0], seen[0, 0], rtol=1e-12, why="the way back")
    ratio = made("divide", file, file, *of_r, "--pair", "d/ped")
    assert_close(ratio.response[0, 0], seen[0, 0] / servo, rtol=1e-12, why="quotient")
    assert ratio.inputs == ("d",)
    scaled = made("multiply", file, "rate_integrator")
    factor = load_model("rate_integrator").frequency_response(OMEGA)[0, 0]
    assert_close(scaled.response / seen, [[factor], [factor]], rtol=1e-12, why="the model's own")
    for words, why in (
        (["add", file, file], "holds r/ped, d/ped: name one"),
        (["add", again, "2"], "no file of a response"),
        (["loop-of-sensitivity", again, "2"], "takes no OTHER"),
        (["divide", again], "takes an OTHER"),
        (["divide", again, "2", "--actuator", "1"], "--actuator belongs to"),
        (["multiply", again, "1 / 0"], "zero or not finite"),
        (["close-loop", file, "1", "--pair", "r"], "OUTPUT/INPUT"),
        (["close-loop", file, "1", *of_r, *of_r], "one pair of each"),
    ):
        assert why in made(*words, code=2), words


def test_refusals() -> None:
    with pytest.raises(ShapeError, match="known response does not fit"):
        arithmetic.apply_known(_measured(), [1.0, 2.0])
    with pytest.raises(DataError, match="zero or not finite"):
        arithmetic.apply_known(_measured(), [1.0, 0.0, 2.0], invert=True)
    wide = FrequencyResponse.from_values([1.0], [1.0, 2.0], inputs=["u"], outputs=["p", "q"])
    with pytest.raises(ShapeError, match="one pair"):
        arithmetic.close_loop(wide, 1.0)
    with pytest.raises(DataError, match="outside the spectrum"):
        band_rms(OMEGA, OMEGA, (0.1, 2.0))
    with pytest.raises(ShapeError, match="spectrum does not fit"):
        band_rms(OMEGA, OMEGA[:2])
    with pytest.raises(DataError, match="two or more increasing"):
        band_rms(OMEGA[::-1], OMEGA)
    with pytest.raises(DataError, match="between 0 and 1"):
        cutoff_frequency(OMEGA, OMEGA, 1.5)
    with pytest.raises(DataError, match="no power"):
        cutoff_frequency(OMEGA, 0 * OMEGA)


def test_rms_of_a_measured_channel() -> None:
    rng = np.random.default_rng(0)
    u = signal.lfilter([0.3], [1, -0.7], rng.standard_normal(20000))
    record = Record.from_arrays(np.arange(20000) * 0.02, inputs={"u": u}, outputs={"y": u + 0.1})
    omega = np.linspace(1.0, 156.0, 600)
    response = estimate_response(record, omega_rad_s=omega, window_s=10.0, covariance=False)
    rms = band_rms(response.omega_rad_s, response.input_spectrum[0, 0].real)
    assert_close(rms, np.std(u), rtol=0.03, why="all but the lowest 1 rad/s")


def test_files_lose_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((2, 1500))
    y = signal.lfilter([0, 0.3], [1, -0.7], u.sum(axis=0)) + 0.1 * rng.standard_normal(1500)
    record = Record.from_arrays(
        np.arange(1500) * 0.02, inputs={"a": u[0], "b": u[1]}, outputs={"y": y}, units={"y": "deg"}
    )
    response = estimate_response(
        record, band_rad_s=(3.0, 100.0), n_omega=9, window_s=np.array([4.0, 2.0])
    )
    back = read_response(write_response(response, tmp_path / "h.nc"))
    assert back.to_dict() == response.to_dict()
    assert np.array_equal(back.covariance, response.covariance)
    part = back.select(inputs=["b"], band_rad_s=(5.0, 50.0))
    assert_close(
        part.covariance,
        response.select(inputs=["b"], band_rad_s=(5.0, 50.0)).covariance,
        rtol=1e-9,
        why="same errors",
    )


def test_strange_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.nc"
    path.write_bytes(b"not netcdf")
    with pytest.raises(FileFormatError, match="not a whole HDF5 file"):
        read_response(path)
    write_response(_measured(), path)
    for name, message in (("about", "incomplete"), ("schema", "not a frequency response")):
        with h5py.File(path, "r+") as file:
            file.attrs[name] = "{}"
        with pytest.raises(FileFormatError, match=message):
            read_response(path)
    with pytest.raises(FileNotFoundError):
        read_response(tmp_path / "none.nc")
