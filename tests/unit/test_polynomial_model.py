"""Polynomial models: responses, roots, prediction, text and files."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.signal import dlsim, freqz, lfilter

import flightid as fid
from flightid.errors import DataError, ModelError, OptionError, UnitError, UnknownNameError
from flightid.models.sampled.discrete_modes import discrete_modes
from tests.closeness import assert_close
from tests.polynomial_records import ARMAX, TWO_INPUTS, flown

# Equations 3 and 4 of the published twin-rotor model: main rotor voltage to pitch, 10 Hz.
PITCH = fid.PolynomialModel(
    ("voltage",),
    "pitch",
    0.1,
    a=[1, -2.372, 1.465, 0.2673, -0.351],
    b=[[-0.0007, 0.007, 0.0001, 0.006]],
)


def test_the_published_pitch_model_has_a_pole_without_continuous_counterpart():
    modes = PITCH.modes()["pitch/voltage"]
    pair = next(mode for mode in modes if mode.is_pair)
    assert_close(pair.natural_frequency_rad_s / (2 * np.pi), 0.335, atol=5e-4, why="Hz, printed")
    assert_close(pair.damping, 0.037, atol=5e-4, why="three printed digits")
    odd = next(mode for mode in modes if mode.s is None)
    assert_close(odd.z.real, -0.4192, atol=5e-5, why="four printed digits")
    assert "no real continuous counterpart" in odd.reason
    zeros = np.sort_complex(PITCH.zeros()["pitch/voltage"])
    assert_close(zeros[-1].real, 10.098, atol=1e-3, why="printed")
    assert "non-minimum phase" in PITCH.summary().to_text()
    assert_close(PITCH.gains()["pitch/voltage"], 1.333, atol=0.05, why="cancelling digits")


def test_a_negative_zero_outside_the_circle_is_a_sampling_zero():
    model = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -0.5], b=[[1.0, 1.5]])
    text = model.summary().to_text()
    assert "sampling makes such zeros" in text
    assert "non-minimum" not in text


def test_roots_at_origin_and_one_have_no_damping():
    zero, one = discrete_modes([0.0, 1.0], 0.1)[::-1]
    assert "delay" in zero.reason
    assert "integrator" in one.reason
    assert one.natural_frequency_rad_s == 0.0
    assert one.time_constant_s is None
    assert fid.PolynomialModel(("u",), "y", 1.0, a=[1, -1.0], b=[[1.0]]).gains() == {"y/u": None}


def test_responses_agree_with_scipy_and_control():
    omega = np.geomspace(0.1, 30.0, 25)
    ours = TWO_INPUTS.frequency_response(omega)
    assert ours.shape == (1, 2, 25)
    for i, name in enumerate(TWO_INPUTS.inputs):
        above, below = TWO_INPUTS.transfer(name)
        peer = freqz(above, below, omega * TWO_INPUTS.sample_time_s)[1]
        assert_close(ours[0, i], peer, rtol=1e-12, why="same rational function")
    width = max(map(len, ARMAX.transfer("u")))
    above, below = (np.pad(p, (0, width - p.size)) for p in ARMAX.transfer("u"))
    peer = control.tf(above, below, 0.1)
    mine = ARMAX.frequency_response(omega)[0, 0]
    assert_close(mine, peer(np.exp(1j * omega * 0.1)), rtol=1e-12, why="same function")


def test_the_state_space_form_predicts_like_the_polynomials():
    record = flown(TWO_INPUTS, 0, noise=0.3)
    a, b, c, d, k = TWO_INPUTS.state_space()
    run = fid.predict(TWO_INPUTS, record, 1, initial_state="zero")
    x, ahead = np.zeros(a.shape[0]), []
    for t in range(record.n_samples):
        u = np.array([record["u"][t], record["v"][t]])
        y = (c @ x + d @ u).item()
        ahead.append(y)
        x = a @ x + b @ u + k[:, 0] * (record["y"][t] - y)
    assert_close(run.predicted["y"], np.array(ahead), atol=1e-10, why="rounding of two recursions")
    free = dlsim((a, b, c, d, 0.1), record.matrix(["u", "v"]).T)[1][:, 0]
    assert_close(TWO_INPUTS.simulate(record), free, atol=1e-10, why="rounding")


def test_one_step_of_a_first_order_model_by_hand():
    model = fid.PolynomialModel(("u",), "y", 1.0, a=[1, -0.5], b=[[2.0]], c=[1, 0.5])
    record = fid.Record.from_arrays(
        [0.0, 1.0, 2.0], inputs={"u": [1.0, 0.0, 1.0]}, outputs={"y": [1.0, 3.0, 2.0]}
    )
    run = fid.predict(model, record, 1, initial_state="zero")
    # e0 = 1; y1 = 0.5 y0 + 2 u0 + 0.5 e0 = 3, e1 = 0; y2 = 0.5 y1 + 2 u1 + 0.5 e1 = 1.5, e2 = 0.5.
    assert_close(run.predicted["y"], np.array([0.0, 3.0, 1.5]), atol=1e-14, why="by hand")
    two = fid.predict(model, record, 2, initial_state="zero")
    # Two ahead h1 = 1.0 times e(t-1) is not yet known either.
    assert_close(two.predicted["y"], np.array([0.0, 2.0, 1.5]), atol=1e-14, why="by hand")


def test_long_horizons_tend_to_the_free_run():
    record = flown(ARMAX, 1, noise=0.5)
    far = fid.predict(ARMAX, record, 200, initial_state="zero").predicted["y"]
    free = fid.predict(ARMAX, record, "free_run", initial_state="zero").predicted["y"]
    assert_close(far[250:], free[250:], atol=1e-9, why="0.84 to the 200th of the noise is left")


def test_the_free_run_finds_the_state_the_record_starts_in():
    record = flown(ARMAX, 2, offset=4.0)
    run = fid.predict(ARMAX, record, "free_run")
    assert np.abs(np.mean(run.residual("y"))) > 1.0  # The offset is not part of the model …
    about = record.replace({"y": record["y"] - 4.0})
    assert fid.predict(ARMAX, about, "free_run").rms_error["y"] < 1e-9
    assert fid.predict(ARMAX, about, "free_run", initial_state="zero").rms_error["y"] > 1e-3


def test_offsets_come_from_the_trim_where_that_is_asked():
    record = flown(ARMAX, 3, offset=4.0)
    trimmed = fid.Record.from_arrays(
        record.time_s,
        inputs={"u": record["u"]},
        outputs={"y": record["y"]},
        units={"y": "rad"},
        trim={"u": 0.0, "y": 4.0},
    )
    assert fid.predict(ARMAX, trimmed, "free_run").rms_error["y"] < 1e-9
    assert np.mean(fid.predict(ARMAX, record).residual("y")) > 1.0


def test_an_unstable_free_run_is_held_and_flagged():
    model = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1e4], b=[[1.0]])
    record = fid.Record.from_arrays(
        np.arange(200) / 10, inputs={"u": np.ones(200)}, outputs={"y": np.zeros(200)}
    )
    run = fid.predict(model, record, initial_state="zero")
    assert run.diverged_at is not None
    assert np.all(np.isfinite(run.predicted["y"]))
    assert "held from sample" in repr(run)


def test_the_difference_equation_reads_as_one():
    text = ARMAX.difference_equation()
    assert text == (
        "y(t) = 1.5 y(t-1) - 0.7 y(t-2) + 1 u(t-1) + 0.5 u(t-2) + e(t) - 1 e(t-1) + 0.2 e(t-2)"
    )
    assert TWO_INPUTS.difference_equation() == (
        "y(t) = [(1 q^-1 + 0.5 q^-2) / (1 - 1.5 q^-1 + 0.7 q^-2)] u(t) + "
        "[(0.3 q^-3 - 0.2 q^-4 + 0.1 q^-5) / (1 - 0.6 q^-1)] v(t) + "
        "[(1 + 0.5 q^-1) / (1 - 0.8 q^-1)] e(t)"
    )


def test_plain_values_make_the_same_model():
    n = len(TWO_INPUTS.theta)
    full = fid.PolynomialModel.from_dict(
        {**TWO_INPUTS.to_dict(), "noise_variance": 0.5, "covariance": np.eye(n).tolist()}
    )
    again = fid.PolynomialModel.from_dict(full.to_dict())
    assert again.to_dict() == full.to_dict()
    np.testing.assert_array_equal(again.theta, TWO_INPUTS.theta)
    assert again.names == TWO_INPUTS.names
    assert again.nk == (1, 3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"order": 3}, "unknown key"),
        ({"output": 3.5, "a": "1, -0.5"}, "must be a list"),
        ({"a": [0.5]}, "does not start with one"),
        ({"a": [1.0, float("nan")]}, "finite numbers"),
        ({"inputs": {"u": 3}}, "must be a table"),
        ({"inputs": {"u": {"b": [1.0], "nk": -1}}}, "number of samples"),
        ({"sample_time_s": 0.0}, "sample time is not positive"),
        ({"noise_variance": -1.0}, "noise variance is negative"),
        ({"covariance": [[1.0]]}, "covariance does not fit"),
        ({"covariance": 3}, "list of rows"),
    ],
)
def test_plain_values_that_are_no_model(change, words):
    with pytest.raises(ModelError, match=words):
        fid.PolynomialModel.from_dict({**ARMAX.to_dict(), **change})


def test_missing_keys_and_polynomials_are_named():
    content = ARMAX.to_dict()
    del content["output"]
    with pytest.raises(ModelError, match="no output"):
        fid.PolynomialModel.from_dict(content)
    with pytest.raises(ModelError, match="do not fit the inputs"):
        fid.PolynomialModel(("u", "v"), "y", 0.1, b=[[1.0]])


def test_records_that_do_not_belong_to_the_model():
    record = flown(ARMAX, 0)
    with pytest.raises(OptionError, match="horizon is"):
        fid.predict(ARMAX, record, 0)
    with pytest.raises(OptionError, match=r"initial.state"):
        fid.predict(ARMAX, record, initial_state="backcast")
    with pytest.raises(UnknownNameError, match="theta"):
        fid.predict(fid.PolynomialModel(("u",), "theta", 0.1, b=[[1.0]]), record)
    with pytest.raises(DataError, match="another sample time"):
        fid.predict(fid.PolynomialModel(("u",), "y", 0.2, b=[[1.0]]), record)
    with pytest.raises(UnitError, match="another unit in the record"):
        fid.predict(fid.PolynomialModel(("u",), "y", 0.1, b=[[1.0]], units={"y": "m"}), record)


def test_the_noise_model_shapes_white_noise():
    record = flown(TWO_INPUTS, 5, noise=1.0, n=4000)
    errors = fid.predict(TWO_INPUTS, record, 1).residual("y")
    assert abs(np.mean(errors[1:] * errors[:-1])) < 3.5 / np.sqrt(errors.size)
    shaped = lfilter(*TWO_INPUTS.noise_transfer, errors)
    free = fid.predict(TWO_INPUTS, record, "free_run").residual("y")
    assert_close(shaped[200:], free[200:], atol=0.05, why="two estimates of the start fade")


def test_inputs_stand_before_the_output() -> None:
    for turned in (("y", ("u",)), ("y", "u")):
        with pytest.raises(ModelError, match="inputs stand before the output"):
            fid.PolynomialModel(*turned, 0.1, b=[[1.0]])
        with pytest.raises(ModelError, match="inputs stand before the output"):
            fid.NarxStructure(*turned, 1, 1)
