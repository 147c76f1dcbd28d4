"""Two folders of models side by side: which model stands beside which."""

from __future__ import annotations

from pathlib import Path

import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import ModelError
from flightid.study.paired_models import paired_models


def _folder(path: Path, **models: str) -> str:
    path.mkdir()
    for name, axis in models.items():
        fid.write_model(fid.load_model("rate_first_order", axis=axis), path / f"{name}.toml")
    return str(path)


def test_models_pair_by_name_else_by_what_they_take_and_give(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = _folder(tmp_path / "before", Roll="roll", Pitch="pitch", Yaw="yaw")
    after = _folder(tmp_path / "after", Roll="roll", second_pitch="pitch", a="yaw", b="yaw")
    pairs = paired_models([before, after])
    assert {name: [m.outputs[0] for m in pair] for name, pair in pairs.items()} == {
        "Pitch": ["q", "q"], "Roll": ["p", "p"],
    }  # fmt: skip
    assert run(["compare", before, after]) == 0
    said = capsys.readouterr().out
    assert "Lp" in said
    assert "Mq" in said
    swapped = _folder(tmp_path / "swapped", Roll="yaw")
    with pytest.raises(ModelError, match=r"Roll \(r of tau_psi\)"):
        paired_models([_folder(tmp_path / "only", Roll="roll"), swapped])
