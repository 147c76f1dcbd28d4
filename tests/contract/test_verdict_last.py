"""Every verb that judges a log ends with its verdict, where eyes are: tables first, worst last."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.cli.output import verdicts_last
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.findings import GRAVITY
from flightid.table import Column, Table
from tests.ordinary_log import write_ordinary_log

RULE = re.compile(r"^-{3,}(  +-{3,})*$")
LIGHTS = {light.words: light for light in Light}
JUDGED = re.compile(rf"^\[?({'|'.join(LIGHTS)})[\]:]")
ENDS = ("Verdict: ", "This log", "The vehicle", "Next: ")
GAINS = {"RAT_{}_P": 0.12, "RAT_{}_I": 0.12, "RAT_{}_D": 0.0035, "RAT_{}_IMAX": 0.5}
PARAMETERS = {
    "INS_GYRO_FILTER": 40.0,
    **{f"ATC_ANG_{axis}_P": 4.5 for axis in ("RLL", "PIT", "YAW")},
    **{
        f"ATC_{name.format(axis)}": value
        for axis in ("RLL", "PIT", "YAW")
        for name, value in GAINS.items()
    },
}
VERBS = ("inspect", "flight", "plan", "tune", "run", "new", "compare")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two ordinary flights, which carry no model."""
    folder = tmp_path_factory.mktemp("logs")
    for seed in (1, 2):
        write_ordinary_log(
            folder / f"day{seed}.bin", seed=seed, duration_s=12.0, parameters=PARAMETERS
        )
    return folder


def test_verbs_of_models_and_records_end_with_their_verdicts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A fit printed amber, green, its light, amber again, then a note; margins notes after red."""
    said = (
        "[red] no", "rms 2", "[green] yes", "Light: red.", "[not judged] maybe", "[red] no",
        "[amber] hm", "One record.",
    )  # fmt: skip
    told = verdicts_last(Table("t", (Column("a"),), (), said))
    assert isinstance(told, Table)
    assert told.notes == (
        "rms 2", "One record.", "[green] yes", "[not judged] maybe", "[amber] hm", "[red] no",
        "Light: red.",
    )  # fmt: skip
    random = np.random.default_rng(1)
    u = np.repeat(random.choice([-1.0, 1.0], 80), 5)
    y = lfilter([0.2], [1.0, -0.8], u) + 0.01 * random.standard_normal(u.size)
    rows = "".join(
        f"{0.1 * k:.1f},{a},{b:.6g}\n" for k, (a, b) in enumerate(zip(u, y, strict=True))
    )
    (tmp_path / "rig.csv").write_text(f"time,u,y\n{rows}", encoding="utf-8")
    named = [str(tmp_path / "rig.csv"), "--inputs", "u", "--outputs", "y"]
    for verb in (
        ["advise"],
        ["polynomial", "--kind", "arx", "--na", "1", "--nb", "1", "--nk", "1"],
    ):
        assert run([verb[0], *named, *verb[1:]]) in {0, 1}
        *_, last = capsys.readouterr().out.rstrip().splitlines()
        assert JUDGED.match(last) or last.startswith("Light: "), last


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_ends_with_its_verdict(
    logs: Path, verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    named = [str(logs / "day1.bin")] + [str(logs / "day2.bin")] * (verb == "compare")
    if verb == "plan":
        named += ["--output", str(logs / "plan")]
    assert run([verb, *named]) in {0, 1}
    out = capsys.readouterr().out
    lines = out.splitlines()
    told = [(at, LIGHTS[m[1]]) for at, line in enumerate(lines) if (m := JUDGED.match(line))]
    gravity = [GRAVITY.index(light) for _, light in told]
    assert gravity == sorted(gravity, reverse=True), "the worst stands last"
    rules = [at for at, line in enumerate(lines) if RULE.match(line)]
    assert all(at > max(rules, default=0) for at, _ in told), "no table stands behind a verdict"
    block = out.rstrip().split("\n\n")[-1].splitlines()
    assert any(JUDGED.match(line) or line.startswith(ENDS) for line in block), block
    assert max(rules, default=0) < len(lines) - 1, "a table's heading is no end"
