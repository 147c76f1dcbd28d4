from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from flightid.cli import bar, output, program
from flightid.cli.bar import Bar
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.fleet.run import FleetInterrupt
from flightid.table import Column, Table
from flightid.version import VERSION


class _Result:
    def summary(self) -> Table:
        return Table("Result", (Column("x", "m"),), ((1.5,),))

    def to_dict(self) -> dict[str, object]:
        return {"schema": "flightid.result/1", "x": 1.5}


def _install(monkeypatch: pytest.MonkeyPatch, function) -> None:
    command = click.command("probe")(output.json_option(function))
    known = program.Verbs.list_commands
    monkeypatch.setattr(
        program.Verbs, "list_commands", lambda self, ctx: [*known(self, ctx), "probe"]
    )
    found = program.Verbs.get_command
    monkeypatch.setattr(
        program.Verbs,
        "get_command",
        lambda self, ctx, name: command if name == "probe" else found(self, ctx, name),
    )


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.run(["--version"]) == 0
    assert VERSION in capsys.readouterr().out


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "flightid", "--version"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.stdout == f"flightid, version {VERSION}\n", run.stderr
    unknown = subprocess.run(
        [*command[:3], "indentify"], capture_output=True, text=True, check=False
    )
    assert unknown.returncode == 2
    assert "flightid" in unknown.stderr
    assert "Did you mean 'identify'?" in unknown.stderr


def test_help_lists_every_verb_with_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.run(["--help"]) == 0
    assert "Exit codes" in capsys.readouterr().out


def test_result_as_text_and_as_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _install(monkeypatch, lambda as_json: output.emit(_Result(), as_json=as_json))
    assert program.run(["probe"]) == 0
    assert "x [m]" in capsys.readouterr().out
    assert program.run(["probe", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == _Result().to_dict()


@pytest.mark.parametrize(("light", "code"), [(Light.GREEN, 0), (Light.AMBER, 0), (Light.RED, 1)])
def test_red_verdict_is_exit_code_one(
    monkeypatch: pytest.MonkeyPatch, light: Light, code: int
) -> None:
    def body(as_json: bool) -> None:
        output.leave_by_verdict([Finding("x", light, "so it is")])

    _install(monkeypatch, body)
    assert program.run(["probe"]) == code


def test_flightid_error_is_a_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def body(as_json: bool) -> None:
        raise DataError("too short", found="2 s", needed="60 s")

    _install(monkeypatch, body)
    assert program.run(["probe"]) == 2
    shown = capsys.readouterr()
    assert shown.err == "Error: too short: found 2 s; needed 60 s\n"
    assert shown.out == ""
    assert program.run(["--debug", "probe"]) == 2
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("raised", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "Interrupted; nothing was left half-written."),
        (FleetInterrupt(3, 4), 130, "Interrupted: 3 of 4 logs in the catalogue; the same command"),
        (FileNotFoundError(2, "No such file", "x.bin"), 2, "Error: x.bin: no such file"),
        (RuntimeError("inner"), 70, "fault in flightid"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_every_ending_has_its_code(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    raised: BaseException,
    code: int,
    said: str,
) -> None:
    def body(as_json: bool) -> None:
        raise raised

    _install(monkeypatch, body)
    assert program.run(["probe"]) == code
    assert said in capsys.readouterr().err


def test_unknown_verb_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatched = pytest.MonkeyPatch()
    _install(monkeypatched, lambda as_json: None)
    try:
        assert program.run(["prove"]) == 2
    finally:
        monkeypatched.undo()
    assert "Did you mean 'probe'?" in capsys.readouterr().err


def test_a_wrong_command_names_the_right_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("flight.BIN").write_bytes(b"")
    Path("a.param").write_text("ATC_RAT_RLL_P 0.1\n")
    Path("rig-output").mkdir()
    Path("rig-study.toml").write_text(
        '[study]\ntitle = "t"\naircraft = "a"\n[[record]]\nname = "r"\npath = "r.csv"\n'
        '[[model]]\nname = "m"\nstructure = "oe"\ninputs = ["u"]\noutputs = "y"\n'
        'identify = "r"\nnb = 1\nnf = 1\nnk = 1\n'
    )
    for typed, meant in {
        "help": "flightid --help",
        "analyze": "flightid run LOG",
        "gains": "flightid tune LOG",
        "tune a.param": "a.param holds parameters and no flight",
        "plan quadrotor": "flightid plan --vehicle quad\n",
        "tune flight.bin": "flightid tune flight.BIN\n",
        "fleet run flight.BIN": "one log: flightid run flight.BIN",
        "tune rig-study.toml": "gains of a PID of its own, --controller pi_d",
        "compare rig-output": "flightid compare A B",
        "compare a.param rig-output": "flightid compare MODEL --gains a.param",
        "modes a.param": "name it as --gains a.param",
    }.items():
        assert program.run(typed.split()) == 2, typed
        assert meant in capsys.readouterr().err, typed


def test_numbers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError, match="Out of range float"):
        output.emit_values({"x": float("nan")})


class _Terminal(StringIO):
    def isatty(self) -> bool:
        return True


def test_bar_is_quiet_for_short_work_and_vanishes(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = _Terminal()
    short = Bar("short", 2, stream)
    short.advance()
    short.close()
    assert not stream.getvalue()
    monkeypatch.setattr(bar, "PATIENCE_S", 0.01)
    shown = Bar("long\x1b[2J", 2, stream)
    shown.advance()
    while "1/2" not in stream.getvalue():
        time.sleep(0.01)
    shown.close()
    assert f"long[2J {'━' * 15:<30} 1/2" in stream.getvalue()
    assert stream.getvalue().endswith(bar.CLEAR)
    # In a file, where nothing was to be seen of a run of hours, whole lines now and then.
    for name, wait_s in (("FIRST_LINE_S", 0.01), ("LINE_S", 0.01)):
        monkeypatch.setattr(bar, name, wait_s)
    lines, clock = StringIO(), [0.0]
    monkeypatch.setattr(bar, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    told = Bar("logs", 410, lines)
    # Start-up is no part of the rest: 34 min were told of four after the first two of 410.
    for at_s, steps, said in ((8.0, 2, ""), (11.0, 10, " (about 1:48 left)")):
        clock[0] = at_s
        for _ in range(steps):
            told.advance()
        before = lines.getvalue().count("\n")
        while lines.getvalue().count("\n") < before + 2:
            time.sleep(0.01)
        done = 2 if steps == 2 else 12
        assert lines.getvalue().splitlines()[-1] == f"logs {done}/410 0:{at_s:02.0f}{said}"
    told.close()


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_a_command(tmp_path: Path) -> None:
    (tmp_path / "flightid").write_text(f'#!/bin/sh\nexec {sys.executable} -m flightid "$@"\n')
    (tmp_path / "flightid").chmod(0o755)
    script = (
        f'export PATH="{tmp_path}:$PATH"; eval "$(flightid completion bash)"; '
        "COMP_WORDS=(flightid mod); COMP_CWORD=1; "
        '_flightid_completion flightid; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    made = subprocess.run(
        ["bash", "--norc", "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert made.stdout.split() == ["modes"]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("flightid response --band", ["--band", "--band-rad-s", "--band-hz"]),
        ("flightid identify x --axis r", ["roll"]),
        ("flightid modes rate_m", ["rate_mine.toml", "rate_motor_lag"]),
    ],
)
def test_a_shell_is_offered_options_words_and_models(
    line: str,
    offered: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "rate_mine.toml").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(program.COMPLETE, "bash_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    with pytest.raises(SystemExit, match="0"):
        program.run([])
    found = [row.split(",")[1] for row in capsys.readouterr().out.split()]
    assert sorted(found) == sorted(offered)


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_have_a_script(shell: str) -> None:
    assert program.run(["completion", shell]) == 0
