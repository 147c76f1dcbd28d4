"""What shells leave to commands, and the pages of commands that write one."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import program, run
from flightid.cli.records import expanded
from flightid.cli.sources import known_methods
from flightid.review.gyro_noise import _by_throttle
from flightid.simulation.fly_options import FlyOptions
from flightid.simulation.realtime import fly_model
from tests.ordinary_log import write_ordinary_log


def _rig(path: Path, seed: int) -> Path:
    random = np.random.default_rng(seed)
    u = np.repeat(random.standard_normal(60), 5)
    y = np.convolve(u, 0.5 ** np.arange(20))[:300] + 0.01 * random.standard_normal(300)
    rows = np.c_[0.1 * np.arange(300), u, y]
    np.savetxt(path, rows, delimiter=",", header="time,u,y", comments="")
    return path


def test_quoted_patterns_name_files_where_no_file_has_that_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    several = [str(_rig(tmp_path / f"man{k}.csv", k)) for k in (1, 2)]
    pattern = str(tmp_path / "man*.csv")
    assert expanded(pattern) == several
    assert run(["response", pattern, "--inputs", "u", "--outputs", "y"]) == 0
    assert run(["inspect", pattern]) == 2
    assert "names 2 files, and one is taken here" in capsys.readouterr().err
    literal = _rig(tmp_path / "man*.csv", 3)
    assert expanded(pattern) == [str(literal)]
    assert run(["inspect", pattern]) == 0


@pytest.mark.parametrize(
    ("kind", "begun", "names"),
    [
        (None, "out", ["output_error"]),
        ("arx", "iv", ["iv4"]),
        ("subspace", "n", ["n4sid"]),
        ("narx", "", []),
    ],
)
def test_a_shell_completes_methods_by_kind(kind: str | None, begun: str, names: list[str]) -> None:
    command = program.get_command(click.Context(program), "identify")
    assert command is not None
    context = click.Context(command)
    context.params["kind"] = kind
    (option,) = (each for each in command.get_params(context) if each.name == "method")
    assert [each.value for each in known_methods(context, option, begun)] == names


def test_pages_of_inspect_and_fly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, page = tmp_path / "flight.bin", tmp_path / "page.html"
    write_ordinary_log(log, duration_s=6.0)
    for words, said in (
        (["inspect", str(log)], "body rates beside their set-points"),
        (["inspect", str(_rig(tmp_path / "rig.csv", 1))], "Columns that move, over time"),
        (["fly", "rate_first_order", "--duration", "0.2"], "late frames"),
    ):
        run([*words, "--html", str(page)])
        assert said in page.read_text(), words
        page.unlink()
    before = log.read_bytes()
    assert run(["inspect", str(log), "--html", str(log)]) == 2
    assert "name a page" in capsys.readouterr().err
    assert log.read_bytes() == before
    capsys.readouterr()


def test_real_modes_have_a_corner_in_hertz() -> None:
    model = fid.load_model("rate_first_order").with_values({"Lp": -2.0 * np.pi})
    table = fid.modes(model).table()
    names = [column.name for column in table.columns]
    assert table.rows[0][names.index("corner")] == pytest.approx(1.0, rel=1e-9)


def test_throttle_that_does_not_move_makes_no_bins() -> None:
    powers = np.ones((60, 4))
    still = 0.4 + 1e-3 * np.random.default_rng(1).standard_normal(60)
    assert _by_throttle(still, powers)[0].size == 0
    assert _by_throttle(np.linspace(0.3, 0.5, 60), powers)[0].size == 8


def test_labels_of_damping_cover_none_another() -> None:
    drawn = fid.modes(fid.load_model("fixed_wing_lateral")).plot().to_dict()["layout"]
    labels = [each for each in drawn["annotations"] if each["xref"] == "x"]
    width = np.ptp(drawn["xaxis"]["range"])
    height = np.ptp(drawn["yaxis"]["range"])
    for place, one in enumerate(labels):
        for other in labels[:place]:
            across = abs(one["x"] - other["x"]) / width
            assert across >= 0.15 or abs(one["y"] - other["y"]) / height >= 0.08


def test_a_flown_record_has_the_model_s_units() -> None:
    flown = fly_model(fid.load_model("rate_first_order"), FlyOptions(duration_s=0.1))
    assert flown.record.unit("p") == "rad/s"
    assert flown.summary().title == f"Flight of {flown.record.n_samples} frames"
