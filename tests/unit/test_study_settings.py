"""A study file is checked to the last key before anything is done."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.errors import StudyError
from flightid.study.conditioning import read_conditioning
from flightid.study.model_settings import ParameterOverride
from flightid.study.reading import TableReader
from flightid.study.settings import read_settings

GOOD = """
[study]
title = "Roll"
[log]
path = "flight.bin"
[channels]
sample_rate_hz = 100
[[segment]]
name = "sweep"
sid_axis = 10
[[segment]]
name = "doublet"
span_s = [70, 80]
[response]
estimator = "instrument"
compare = ["composite"]
[fit]
starts = 3
seed = 7
[reduce]
maximum_cramer_rao_percent = 30
[[model]]
name = "roll rate"
template = "rate_motor_lag"
axis = "roll"
identify = "sweep"
verify = ["doublet"]
band_rad_s = [0.5, 60]
keep = "tau_s"
parameters.tau_s = { value = 0.03, free = false }
"""


def _write(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_whole_study_is_read(tmp_path: Path) -> None:
    settings = read_settings(_write(tmp_path, GOOD))
    assert settings.log == tmp_path / "flight.bin"
    assert settings.fit.options == {"starts": 3, "seed": 7}
    assert settings.sample_rate_hz == 100.0
    model = settings.models[0]
    assert (model.identify, model.verify) == (("sweep",), ("doublet",))
    assert model.parameters == {"tau_s": ParameterOverride(value=0.03, free=False)}
    assert settings.segment("doublet").span_s == (70.0, 80.0)
    assert settings.response.compare == ("composite",)
    assert settings.reduce is not None
    limits = settings.reduce.limits
    assert (limits.maximum_cramer_rao_percent, limits.maximum_insensitivity_percent) == (30.0, 10.0)
    assert (settings.reduce.after_rise, model.keep, model.drop) == ("stop", ("tau_s",), ())


def test_a_model_file_lies_beside_the_study(tmp_path: Path) -> None:
    text = GOOD.replace('"rate_motor_lag"', '"own.toml"')
    assert read_settings(_write(tmp_path, text)).models[0].template == str(tmp_path / "own.toml")


def test_rivals_are_library_models_or_files_beside_the_study(tmp_path: Path) -> None:
    text = GOOD.replace("band_rad_s", 'rivals = ["rate_integrator", "own.toml"]\nband_rad_s')
    rivals = read_settings(_write(tmp_path, text)).models[0].rival_sources
    assert rivals == {"rate_integrator": "rate_integrator", "own.toml": str(tmp_path / "own.toml")}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('title = "Roll"', "", "[study]: title is missing"),
        ('title = "Roll"', "title = 3", "[study]: title has no meaning: found 3; needed a word"),
        ("sample_rate_hz = 100", "sample_rate = 100", "Next: write 'sample_rate_hz'"),
        ("sample_rate_hz = 100", "sample_rate_hz = -1", "needed a number above 0"),
        ("sample_rate_hz = 100", "sample_rate_hz = nan", "needed a number above 0"),
        ("sample_rate_hz = 100", "sample_rate_hz = true", "needed a number above 0"),
        ("[fit]", "[fits]", "top level: there is no key 'fits'"),
        ("starts = 3", "starts = 0", "starts is too small"),
        ("starts = 3", "starts = 2.5", "starts has no meaning"),
        (
            'estimator = "instrument"',
            'estimator = "magic"',
            "estimator is not known: found 'magic'; needed 'auto' or 'composite'",
        ),
        (
            'compare = ["composite"]',
            'compare = ["magic"]',
            "compare holds a word that is not known: found ['magic']",
        ),
        ('compare = ["composite"]', "compare = [1]", "compare has no meaning: found [1]"),
        ("span_s = [70, 80]", "span_s = [80, 70]", "the first below the second"),
        ("span_s = [70, 80]", "span_s = [80]", "two numbers"),
        ("span_s = [70, 80]", "", "span_s or sid_axis must be given, not both"),
        ("span_s = [70, 80]", "span_s = [70, 80]\nsid_axis = 11", "must be given, not both"),
        ('name = "doublet"', 'name = "sweep"', "two [[segment]]s have one name: found 'sweep'"),
        ('identify = "sweep"', 'identify = "sweeps"', "no such segment: found 'sweeps'"),
        ('verify = ["doublet"]', 'verify = ["sweep"]', "verified on data it has seen"),
        ("band_rad_s = [0.5, 60]", "band_rad_s = [0, 60]", "above 0 [rad/s]"),
        (
            "free = false",
            'free = "no"',
            "[[model]] number 1, parameters, tau_s: free has no meaning",
        ),
        ("value = 0.03", "val = 0.03", "Next: write 'value'"),
        ("value = 0.03", 'value = "x"', "needed a number"),
        ("[log]\n", "[flight]\nsimulate = 'quadrotor'\n[log]\n", "found [log] and [flight]"),
        ('[log]\npath = "flight.bin"', "", "found none"),
        ('[log]\npath = "flight.bin"', "[flight]\nsimulate = 'ufo'", "needed 'quadrotor'"),
        ('[log]\npath = "flight.bin"', "[[log]]", "log does not fit: found [{}]; needed a table"),
        ("[fit]", "[fit", "the study file is no TOML"),
        ("cramer_rao_percent = 30", "cramer_rao_percent = 0", "needed a number above 0"),
        ("maximum_cramer_rao", "maximum_cramer_raw", "Next: write 'maximum_cramer_rao_percent'"),
        ("_percent = 30", '_percent = 30\nafter_rise = "hope"', "needed 'stop' or 'next'"),
        ("[reduce]\nmaximum_cramer_rao_percent = 30", "", "keep has no meaning here"),
        ("seed = 7", "seed = 7\nwindow_s = []", "[fit]: there is no key 'window_s'"),
        ('compare = ["composite"]', "window_s = []", "window_s has no meaning: found []"),
    ],
)
def test_each_fault_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert GOOD.count(old) == 1
    with pytest.raises(StudyError, match=re.escape(said)):
        read_settings(_write(tmp_path, GOOD.replace(old, new)))


def test_a_study_without_models_has_nothing_to_do(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="nothing to identify"):
        read_settings(_write(tmp_path, GOOD.split("[[model]]", maxsplit=1)[0]))


def test_segments_that_are_no_tables(tmp_path: Path) -> None:
    text = "segment = 3\n" + GOOD.split("[[segment]]", maxsplit=1)[0]
    with pytest.raises(StudyError, match=re.escape("needed tables headed [[segment]]")):
        read_settings(_write(tmp_path, text))


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="longer than such a file can be"):
        read_settings(_write(tmp_path, GOOD + "#" * (1 << 20)))


def test_deep_nesting_is_an_error_not_a_crash(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"nested too deep.*at most 64"):
        read_settings(_write(tmp_path, "x = " + "[" * 5000 + "]" * 5000))


@given(st.text(max_size=200))
def test_any_text_is_a_study_error(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("any") / "study.toml"
    path.write_bytes(text.encode("utf-8", "replace"))
    with pytest.raises(StudyError):
        read_settings(path)


@pytest.mark.parametrize(
    ("key", "value"), [("m", 0.3048), ("cm", 30.48), ("mm", 304.8), ("ft", 1.0), ("in", 12.0)]
)
def test_positions_of_sensors_are_told_in_any_length(key: str, value: float) -> None:
    told = TableReader({f"accelerometers_{key}": [value, 0.0, -value]}, "[[conditioning]]")
    position = read_conditioning(told).positions["accelerometers"]
    assert position == pytest.approx((0.3048, 0.0, -0.3048), rel=1e-12)
    assert read_conditioning(TableReader({}, "[[conditioning]]")).positions == {}


def test_a_position_is_told_once() -> None:
    twice = {"velocities_m": [1.0, 0.0, 0.0], "velocities_ft": [3.0, 0.0, 0.0]}
    with pytest.raises(StudyError, match="velocities_ft tells a position twice"):
        read_conditioning(TableReader(twice, "[[conditioning]]"))
