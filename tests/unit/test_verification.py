"""Verification: what it says, and what it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import flightid as fid
from flightid import validation
from flightid.conventions import Light
from flightid.errors import (
    DataError,
    ModelError,
    OptionError,
    ShapeError,
    UnitError,
    UnknownNameError,
)
from flightid.models.linear.linear_system import LinearSystem
from flightid.plot import verification as pictures
from tests.closeness import assert_close
from tests.examples import examples

TIME_S = np.arange(400) * 0.02
LAG = LinearSystem([[-2.0]], [[3.0]], [[1.0]], [[0.0]], ("u",), ("p",))
SIGNALS = arrays(np.float64, 20, elements=st.floats(-100, 100).map(lambda x: round(x, 3)))


def _record(unit: str = "rad/s") -> fid.Record:
    inputs = fid.Record.from_arrays(TIME_S, inputs={"u": np.sign(np.sin(2 * TIME_S))})
    return fid.simulate(LAG, inputs, units={"p": unit})


class _WithUnits:
    """A model that says its units, as models of the library do."""

    inputs = ("u",)
    outputs = ("p",)
    units = {"u": "1", "p": "rad/s"}  # noqa: RUF012

    def state_space(self):
        return LAG.state_space()


class _Fit:
    model = _WithUnits()


@examples(60)
@given(y=SIGNALS, y_hat=SIGNALS)
def test_metrics_keep_their_ranges(y: np.ndarray, y_hat: np.ndarray) -> None:
    if np.std(y) < 1e-3 or np.std(y_hat) < 1e-3:
        return
    assert 0.0 <= float(validation.theil(y, y_hat)) <= 1.0 + 1e-12
    assert_close(
        validation.theil(y, y_hat), validation.theil(y_hat, y), rtol=1e-12, why="symmetric"
    )
    assert float(validation.fit_percent(y, y_hat)) <= 100.0
    assert_close(
        validation.mse(y, y_hat), validation.rms_error(y, y_hat) ** 2, rtol=1e-12, why="square"
    )
    r_squared = 1 - np.sum((y - y_hat) ** 2) / np.sum((y - np.mean(y)) ** 2)
    assert_close(
        validation.r_squared(y, y_hat), r_squared, rtol=1e-9, atol=1e-9, why="by definition"
    )
    assert (
        float(validation.vaf_percent(y, y_hat))
        >= 100 * float(validation.r_squared(y, y_hat)) - 1e-6
    )


def test_metrics_work_by_channel() -> None:
    y = np.array([[1.0, -1.0, 2.0], [0.0, 4.0, 0.0]])
    assert validation.theil(y, 0 * y).tolist() == [1.0, 1.0]
    assert validation.fit_percent(y, y).tolist() == [100.0, 100.0]
    assert_close(
        validation.weighted_rms(y, 0 * y, [1.0, 0.0]), 1.0, rtol=1e-12, why="6 over 6 samples"
    )


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: validation.theil([1.0], [1.0, 2.0]), ShapeError, "do not fit"),
        (lambda: validation.theil([np.nan], [1.0]), DataError, "not finite"),
        (lambda: validation.theil([0.0], [0.0]), DataError, "both signals are zero"),
        (lambda: validation.fit_percent([1.0, 1.0], [0.0, 1.0]), DataError, "is constant"),
        (lambda: validation.vaf_percent([1.0, 1.0], [0.0, 1.0]), DataError, "is constant"),
        (lambda: validation.weighted_rms([[1.0]], [[1.0]], [1, 1]), ShapeError, "weights do not"),
        (lambda: validation.muad_envelopes([0.0]), OptionError, "frequencies above zero"),
    ],
)
def test_metrics_refuse(call, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        call()


def test_result_shows_itself_and_its_horizon() -> None:
    result = fid.verify(LAG, _record())
    assert "worst Theil coefficient 0.000" in repr(result)
    text = str(result.summary())
    assert "Free run over the whole record on measured inputs alone" in text
    assert "from an initial state solved for over the first 2.66 s" in text
    assert "from rest at trim" in str(fid.verify(LAG, _record(), initial_state="trim").summary())
    assert "state biases and output biases solved for" in text
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert plain["schema"] == "flightid.verification/1"
    assert plain["units"]["p"] == "rad/s"
    assert "<table>" in result._repr_html_()
    assert {each.light for each in result.findings} == {Light.GREEN}
    assert result.predicted.history[-1].operation == "predict"


def test_lights_follow_the_guides() -> None:
    record = _record("deg/s")
    slow = LinearSystem([[-0.7]], [[1.05]], [[1.0]], [[0.0]], ("u",), ("p",))
    wrong = LinearSystem([[-2.0]], [[-3.0]], [[1.0]], [[0.0]], ("u",), ("p",))
    by_code = {each.code: each.light for each in fid.verify(slow, record).findings}
    assert by_code["verification-theil"] is Light.RED
    by_code = {each.code: each.light for each in fid.verify(wrong, record).findings}
    assert by_code["verification-theil"] is Light.RED
    assert "verification-j-rms" not in by_code, "an angle of a rig is none of the guide's business"
    both = LinearSystem([[-2.0]], [[3.0]], [[1.0], [0.5]], [[0.0], [0.0]], ("u",), ("p", "w"))
    flown = fid.simulate(both, record.select(["u"]), units={"p": "deg/s", "w": "ft/s"})
    by_code = {each.code: each.light for each in fid.verify(both, flown).findings}
    assert by_code["verification-j-rms"] is Light.GREEN
    loud = flown.replace({"p": 10 * flown["p"]})
    by_code = {each.code: each.light for each in fid.verify(both, loud).findings}
    assert by_code["verification-j-rms"] is Light.AMBER


def test_a_channel_outside_the_guide_has_no_j_rms() -> None:
    record = _record("V")
    result = fid.verify(LAG, record)
    assert result.j_rms is None
    assert "verification-j-rms" not in {finding.code for finding in result.findings}


def test_a_fit_is_verified_by_its_model() -> None:
    assert fid.verify(_Fit(), _record()).outputs == ("p",)


def test_refusals() -> None:
    record = _record()
    with pytest.raises(OptionError, match="nothing to verify on"):
        fid.verify(LAG, [])
    with pytest.raises(OptionError, match="initial_state is not known"):
        fid.verify(LAG, record, initial_state="guess")  # type: ignore[arg-type]
    with pytest.raises(OptionError, match="hold is not known"):
        fid.verify(LAG, record, hold="second")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="the model cannot be simulated"):
        fid.verify(3.0, record)
    with pytest.raises(UnknownNameError, match="the model has no such output"):
        fid.verify(LAG, record, outputs=["q"])
    with pytest.raises(UnknownNameError, match="a record lacks what the model predicts"):
        fid.verify(LAG, record.select(["u"]))
    with pytest.raises(UnknownNameError, match="there is no such channel"):
        fid.verify(LAG, record.select(["p"]))
    with pytest.raises(UnitError, match="channel 'p' has another unit"):
        fid.verify(_WithUnits(), record.to_units(p="deg/s"))
    with pytest.raises(DataError, match="does not change"):
        fid.verify(LAG, record.replace({"p": 0 * TIME_S + 1.0}))


def test_a_run_that_explodes_is_an_error() -> None:
    burst = LinearSystem([[200.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("p",))
    with pytest.raises(DataError, match=r"grows beyond|infinity|not finite|diverge"):
        fid.verify(burst, _record(), initial_state="trim")


def test_mismatch_refuses_and_shows() -> None:
    omega = np.geomspace(0.5, 20.0, 30)
    response = fid.FrequencyResponse.from_values(
        omega, (3 / (2 + 1j * omega))[None, None], inputs=["u"], outputs=["p"]
    )
    made = validation.mismatch(LAG, response)
    assert "worst 100 % inside" in repr(made)
    assert "largest gain error" in str(made.summary())
    json.dumps(made.to_dict(), allow_nan=False)
    assert "<table>" in made._repr_html_()
    none = validation.mismatch(LAG, response, minimum_coherence=2.0)
    assert none.findings[0].light is Light.UNKNOWN
    assert none.inside_percent == (None,)
    assert "none judged" in repr(none)
    with pytest.raises(ModelError, match="no frequency response"):
        validation.mismatch(3.0, response)
    other = LinearSystem([[-2.0]], [[3.0]], [[1.0]], [[0.0]], ("v",), ("p",))
    with pytest.raises(DataError, match="share no response"):
        validation.mismatch(other, response)
    silent = fid.FrequencyResponse.from_values(
        omega, np.zeros((1, 1, 30), complex), inputs=["u"], outputs=["p"]
    )
    with pytest.raises(DataError, match="is zero at a frequency"):
        validation.mismatch(LAG, silent)


def test_pictures() -> None:
    item = fid.verify(LAG, _record()).predictions[0]
    assert [trace.name for trace in pictures.prediction(item).data] == [
        "input",
        "measured",
        "model",
    ]
    assert len(pictures.residuals(item).data) == 1
    omega = np.geomspace(0.5, 20.0, 30)
    response = fid.FrequencyResponse.from_values(
        omega, (3 / (2 + 1j * omega))[None, None], inputs=["u"], outputs=["p"]
    )
    made = pictures.mismatch_envelopes(validation.mismatch(LAG, response))
    assert len(made.data) == 6


def test_a_hold_that_moves_no_fit_asks_for_nothing() -> None:
    """A slow sweep looks alike under every hold; steps of two seconds do not."""
    model = fid.load_model("rate_first_order").with_values({"Lp": -4.0, "Ltphi": 60.0})
    time_s = np.arange(600) * 0.02
    for inputs, code in (
        (np.sin(time_s), "hold-unimportant"),
        (np.sign(np.sin(9 * time_s)) * (1 + 0.1 * time_s), "hold-unknown"),
    ):
        bare = fid.Record.from_arrays(time_s, inputs={"tau_phi": inputs})
        flown = fid.simulate(model, bare, units={"p": "rad/s"}, hold="zero")
        silent = bare.replace(channels=flown.channels.values(), samples={"p": flown["p"]})
        found = {each.code: each for each in fid.verify(model, silent).findings}
        assert code in found
        assert bool(found[code].action) is (code == "hold-unknown")
