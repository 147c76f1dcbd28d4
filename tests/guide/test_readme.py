"""The README: its Python runs on the demo's log and finds the truth; its commands exist."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import click
import pytest

from flightid.cli.program import program
from flightid.conventions import Light
from flightid.vehicles import Flight

ROOT = Path(__file__).parent.parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
TEXTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
FENCE = re.compile(r"^```([a-z]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`([^`\n]+)`|^ {4}(\S.*)$", re.MULTILINE)
COMMAND = re.compile(r"(?:^|&& |: )(flightid [a-z][^#|&\n]*)", re.MULTILINE)


def _missed(fit: Any, truth: dict[str, float]) -> list[str]:
    bars = {name: fit.parameters[name].interval95 for name in truth}
    return [name for name, (low, high) in bars.items() if not low < truth[name] < high]


def _lights(*results: Any) -> set[Light]:
    return {finding.light for result in results for finding in result.findings}


def test_the_python_of_the_readme_finds_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, demo_flight: Flight, demo_output: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo-output").symlink_to(demo_output)
    made_up, on_the_log, in_use = BLOCK.findall(README)
    scope: dict[str, Any] = {"__name__": "readme"}
    exec(compile(made_up, "README.md", "exec"), scope)
    assert _missed(scope["fit"], scope["truth"]) == []

    exec(compile(on_the_log, "README.md", "exec"), scope)
    true = demo_flight.truth("roll")
    values = {"Ltphi": true.gain_rad_s2, "Lp": true.damping_1_s, "T_m": true.motor_lag_s}
    assert _missed(scope["fit"], values) == []
    assert Light.RED not in _lights(scope["fit"], scope["check"])

    exec(compile(in_use, "README.md", "exec"), scope)
    assert scope["design"].exists
    assert Light.RED not in _lights(scope["design"])
    assert {path.suffix for path in tmp_path.iterdir()} >= {".param", ".c", ".h"}


def _commands(text: str) -> list[str]:
    typed = [block for language, block in FENCE.findall(text) if language in ("", "text")]
    typed += ["".join(words) for words in INLINE.findall(FENCE.sub("", text))]
    return [line for part in typed for line in COMMAND.findall(part)]


def test_commands_are_found() -> None:
    assert len(_commands(README)) > 15
    assert "flightid tune flight.BIN " in "".join(_commands(README))


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.name)
def test_commands_that_a_text_names_exist(page: Path) -> None:
    context = click.Context(program, info_name="flightid")
    for line in _commands(page.read_text(encoding="utf-8")):
        words = shlex.split(line.split("…")[0])
        command: click.Command | None = program.get_command(context, words[1])
        assert command is not None, line
        rest = words[2:]
        if isinstance(command, click.Group) and rest and not rest[0].startswith("-"):
            command = command.get_command(context, rest.pop(0))
            assert command is not None, line
        known = {option for each in command.get_params(context) for option in each.opts}
        unknown = {word for word in rest if word.startswith("--")} - known - {"--help"}
        assert not unknown, f"{line}: {unknown}"
