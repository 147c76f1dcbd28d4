"""Hosted CI and hooks: files that nobody runs here, so what they name is checked instead."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.contract.source import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
HOOKS = ROOT / ".pre-commit-config.yaml"
EVENTS = {"push", "pull_request", "schedule", "workflow_dispatch"}
FILES_OF_OURS = re.compile(r"\b(?:tools|examples|tests|docs)/[\w./-]+\.\w+")


def _read(path: Path) -> dict[Any, Any]:
    loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert isinstance(loaded, dict), path.name
    return loaded


def _jobs() -> list[tuple[str, dict[str, Any]]]:
    return [
        (f"{path.stem}.{name}", job)
        for path in WORKFLOWS
        for name, job in _read(path)["jobs"].items()
    ]


JOBS = _jobs()


def _commands(job: dict[str, Any]) -> str:
    return "\n".join(step["run"] for step in job["steps"] if "run" in step)


def _matrix(job: dict[str, Any]) -> dict[str, list[Any]]:
    return dict(job.get("strategy", {}).get("matrix", {}))


def _make_targets() -> set[str]:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z-]+):", text, re.MULTILINE))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_says_when_and_with_which_rights(path: Path) -> None:
    workflow = _read(path)
    when = workflow[True]  # YAML 1.1 reads the key `on` as true
    assert set(when) <= EVENTS
    assert workflow["permissions"] == {"contents": "read"}


@pytest.mark.parametrize(("name", "job"), JOBS, ids=[name for name, _ in JOBS])
def test_a_job_names_what_exists(name: str, job: dict[str, Any]) -> None:
    assert job["runs-on"]
    for step in job["steps"]:
        assert ("uses" in step) != ("run" in step), step
        assert "uses" not in step or re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step["uses"]), step
    commands = _commands(job)
    for target in re.findall(r"^make ([a-z-]+)", commands, re.MULTILINE):
        assert target in _make_targets(), f"{name}: make {target}"
    for file in FILES_OF_OURS.findall(commands):
        assert (ROOT / file).is_file(), f"{name}: {file}"
    for key in re.findall(r"matrix\.(\w+)", str(job)):
        matrix = _matrix(job)
        assert key in matrix or all(key in row for row in matrix["include"]), f"{name}: {key}"


def test_the_matrix_has_every_system_and_python_that_we_promise() -> None:
    jobs = dict(JOBS)
    unix, windows = _matrix(jobs["test.unix"]), _matrix(jobs["test.windows"])
    assert unix["os"] == ["ubuntu-latest", "macos-latest"]
    assert unix["python"] == windows["python"] == ["3.11", "3.12", "3.13"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == f">={unix['python'][0]}"
    wheels = {row["name"] for row in _matrix(jobs["wheels.wheel"])["include"]}
    assert wheels == {"linux-x86-64", "linux-arm", "macos", "windows"}


def test_windows_runs_the_steps_of_make_test() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    pytest_line = next(line for line in text.splitlines() if "$(PYTEST) $(SPREAD)" in line)
    (meaning,) = re.findall(r"^PYTEST = .*\$\(BIN\)/(.*)$", text, re.MULTILINE)
    wanted = pytest_line.strip().replace("$(PYTEST)", meaning).replace("$(SPREAD)", "$(STARTED)")
    for name in ("STARTED", "PATIENT"):
        (said,) = re.findall(rf"^{name} = (.*)$", text, re.MULTILINE)
        wanted = wanted.replace(f"$({name})", said)
    wanted = wanted.replace("$(JOBS)", "auto")
    assert wanted in _commands(dict(JOBS)["test.windows"])


def test_hooks_call_tools_that_make_installs() -> None:
    config = _read(HOOKS)
    assert set(config["default_install_hook_types"]) == {"pre-commit", "commit-msg"}
    hooks = {hook["id"]: hook for repo in config["repos"] for hook in repo["hooks"]}
    assert set(hooks) == {"ruff-format", "ruff-check", "mypy", "cargo-fmt", "commit-subject"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    dev = {re.split(r"[<>=\[]", line)[0] for line in project["optional-dependencies"]["dev"]}
    for hook in hooks.values():
        tool, *rest = shlex.split(hook["entry"])
        assert tool == "cargo" or tool == ".venv/bin/python" or Path(tool).name in dev, hook["id"]
        for file in FILES_OF_OURS.findall(" ".join(rest)):
            assert (ROOT / file).is_file(), hook["id"]
    assert hooks["commit-subject"]["stages"] == ["commit-msg"]


def test_licences_of_others_are_listed_and_allowed() -> None:
    page = (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w.-]+) \| [\w.]+ \| (.+) \|$", page, re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {re.split(r"[<>=\[]", line)[0] for line in project["dependencies"]}
    manifests = ROOT.glob("crates/*/Cargo.toml")
    crates = [tomllib.loads(path.read_text(encoding="utf-8"))["dependencies"] for path in manifests]
    wanted |= {name for table in crates for name in table if not name.startswith("flightid")}
    assert wanted <= {name for name, _ in rows}
    allowed = tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))["licenses"]["allow"]
    linked = page[: page.index("## Packages")]
    for name, licence in re.findall(r"^\| ([\w.-]+) \| [\w.]+ \| (.+) \|$", linked, re.MULTILINE):
        if name != "name":
            assert set(re.split(r" OR |/| AND ", licence.strip())) <= {*allowed}, name
