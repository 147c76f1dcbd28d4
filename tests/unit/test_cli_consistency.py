"""`flightid consistency` finds columns that are named with their unit, or takes their names."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from flightid.cli.consistency import command


@pytest.mark.parametrize(
    ("names", "asked"),
    [
        (("p_dps", "q_radps", "r_radps", "phi_deg", "theta_rad"), []),
        (
            ("roll_rate_dps", "q_radps", "r_radps", "bank_deg", "theta_rad"),
            ["--rename", "p=roll_rate_dps,phi=bank_deg"],
        ),
    ],
)
def test_columns_with_their_units_are_the_channels(
    tmp_path: Path, names: tuple[str, ...], asked: list[str]
) -> None:
    time = np.arange(1500) / 50.0
    still, rate = 0.0 * time, np.cos(time)
    columns = [time, np.degrees(1.05 * rate), still, still, np.degrees(np.sin(time)), still]
    np.savetxt(
        tmp_path / "flight.csv", np.column_stack(columns), delimiter=",", comments="",
        header=",".join(("t_s", *names)), fmt="%.12g",
    )  # fmt: skip
    words = [str(tmp_path / "flight.csv"), "--estimate", "bias_p,scale_p", "--json", *asked]
    made = CliRunner().invoke(command, words)
    found = json.loads(made.stdout)
    assert found["parameters"]["scale_p"]["value"] == pytest.approx(0.05, abs=1e-3)
    assert f"p from '{names[0]}'" in made.stderr
    wrong = CliRunner().invoke(command, [*words, "--rename", "roll"])
    assert wrong.exit_code == 2
    assert "p=roll_rate" in wrong.stderr
