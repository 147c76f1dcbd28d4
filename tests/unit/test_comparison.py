"""Models side by side: what the comparison says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.errors import OptionError, UnknownNameError
from flightid.models.linear.linear_system import LinearSystem
from flightid.plot import verification as pictures
from flightid.report.verification import verification_blocks, verification_sections
from tests.closeness import assert_close

TIME_S = np.arange(600) * 0.02
STEPS = np.sign(np.sin(2 * TIME_S))
OMEGA = np.geomspace(0.3, 20.0, 40)


def _lag(rate: float, outputs: tuple[str, ...] = ("p",)) -> LinearSystem:
    ones = np.ones((len(outputs), 1))
    return LinearSystem([[-rate]], [[rate]], ones, 0 * ones, ("u",), outputs)


def _flown(noise: float = 0.0, unit: str = "deg/s") -> fid.Record:
    seen = fid.simulate(
        _lag(2.0), fid.Record.from_arrays(TIME_S, inputs={"u": STEPS}), units={"p": unit}
    )
    drawn = np.random.default_rng(3).standard_normal(TIME_S.size)
    return seen.replace({"p": seen["p"] + noise * drawn})


def _response() -> fid.FrequencyResponse:
    return fid.FrequencyResponse.from_values(
        OMEGA, (2 / (2 + 1j * OMEGA))[None, None], inputs=["u"], outputs=["p"]
    )


def test_the_better_model_is_named_with_its_numbers() -> None:
    result = fid.verify([_lag(2.1), _lag(1.0)], _flown(0.01), names=["near", "far"])
    assert isinstance(result, fid.Comparison)
    contrast = result.contrast("p")
    assert (contrast.first, contrast.rival, contrast.better) == ("near", "far", "near")
    assert contrast.first_rms == result.verifications["near"].rms_error["p"]
    assert_close(contrast.p_value, 2 / 2**12, rtol=1e-12, why="closer in every stretch")
    assert contrast.stretches_better == 12
    text = str(result.summary())
    assert "near errs by" in text
    bare = fid.verify([_lag(2.1), _lag(1.0)], _flown(0.01, unit="1"), names=["near", "far"])
    assert f"near errs by {bare.contrast('p').first_rms:.3g}, far by" in str(bare.summary())
    assert f"yes, {-contrast.change_percent:.0f} % less" in text
    assert -95 < contrast.change_percent < -80
    assert "weighted error over all outputs: near" in text
    assert result.findings[0].light is Light.GREEN
    assert "'near' better in 1, worse in 0" in repr(result)
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert plain["contrasts"][0]["better"] == "near"
    assert "<table>" in result._repr_html_()


def test_a_better_rival_is_amber_and_the_verdicts_on_the_rival_do_not_count() -> None:
    wrong_way = LinearSystem([[-2.0]], [[-2.0]], [[1.0]], [[0.0]], ("u",), ("p",))
    behind = fid.verify([_lag(1.6), _lag(2.0)], _flown(0.01), names=["old", "new"])
    assert behind.findings[0].light is Light.AMBER
    assert "new is better" in behind.findings[0].message
    ahead = fid.verify([_lag(2.0), wrong_way], _flown(), names=["right", "wrong"])
    assert Light.RED in {each.light for each in ahead.verifications["wrong"].findings}
    assert Light.RED not in {each.light for each in ahead.findings}


def test_equal_models_cannot_be_told_apart() -> None:
    result = fid.verify([_lag(2.0), _lag(2.0)], _flown(0.05))
    assert result.names == ("linear system (1)", "linear system (2)")
    assert result.contrast("p").p_value == 1.0
    assert result.contrast("p").better is None
    assert "cannot tell" in str(result.summary())
    exact = fid.verify([_lag(2.0), _lag(2.0)], _flown(), state_bias=False, output_bias=False)
    assert exact.contrast("p").change_percent == 0.0


def test_only_shared_outputs_are_compared() -> None:
    wide = _lag(2.0, ("p", "q"))
    seen = _flown()
    record = fid.Record.from_arrays(
        TIME_S, inputs={"u": STEPS}, outputs={"p": seen["p"], "q": TIME_S}
    )
    result = fid.verify([wide, _lag(1.5)], record)
    assert result.outputs == ("p",)
    with pytest.raises(UnknownNameError, match="the model has no such output"):
        fid.verify([wide, _lag(1.5)], record, outputs=["q"])
    with pytest.raises(UnknownNameError, match="a record lacks what the model predicts"):
        fid.verify([_lag(2.0, ("q",)), _lag(1.5)], record)


def test_refusals() -> None:
    with pytest.raises(OptionError, match="there is nothing to compare"):
        fid.verify([_lag(2.0)], _flown())
    for names in (["one"], ["same", "same"]):
        with pytest.raises(OptionError, match="names do not fit the models"):
            fid.verify([_lag(2.0), _lag(1.0)], _flown(), names=names)


def test_the_envelopes_come_with_a_measured_response() -> None:
    alone = fid.verify(_lag(2.0), _flown(), responses=_response())
    assert alone.mismatch is not None
    assert alone.mismatch.inside_percent == (100.0,)
    assert "mismatch-envelopes" in {each.code for each in alone.findings}
    assert json.loads(json.dumps(alone.to_dict()))["mismatch"]["names"] == ["p/u"]
    assert fid.verify(_lag(2.0), _flown()).mismatch is None
    titles = [type(block).__name__ for block in verification_blocks(alone)]
    assert titles == ["Lights", "TableBlock", "Figure", "Figure", "Figure", "TableBlock"]


def test_pictures_show_every_model() -> None:
    both = fid.verify(
        [_lag(2.0), _lag(0.5)], _flown(), names=["near", "far"], responses=_response()
    )
    names = [trace.name for trace in pictures.comparison(both).data]
    assert names == ["input", "measured", "near", "far"]
    items = {name: each.mismatch for name, each in both.verifications.items()}
    made = pictures.mismatch_comparison(items, "p/u")  # type: ignore[arg-type]
    assert [trace.name for trace in made.data if trace.name in items] == ["near", "far"] * 2
    with pytest.raises(UnknownNameError, match="there is no such pair"):
        pictures.mismatch_comparison(items, "q/u")  # type: ignore[arg-type]
    sections = verification_sections(both)
    assert len(sections) == 2
    assert "inside the envelopes" in str(list(sections[0].blocks))


def test_the_command_compares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = fid.load_model("rate_first_order").with_values({"Lp": -4.0})
    inputs = fid.Record.from_arrays(TIME_S, inputs={"tau_phi": 0.1 * STEPS})
    path, page = tmp_path / "flight.parquet", tmp_path / "page.html"
    fid.write_records([fid.simulate(model, inputs, units={"p": "rad/s"})], path)
    options = ["verify", "rate_first_order", str(path), "--value", "Lp=-4"]
    options += ["--against", "rate_integrator", "--against", "rate_motor_lag"]
    assert run([*options, "--html", str(page)]) == 0
    assert "Comparison(3 models, 1 output, 1 record" in capsys.readouterr().out
    assert "Roll rate, integrator" in page.read_text()
    assert run([*options, "--json", "--residual-tests"]) in (0, 1)
    plain = json.loads(capsys.readouterr().out)
    assert plain["schema"] == "flightid.comparison/1"
    assert "residual_tests" in plain
