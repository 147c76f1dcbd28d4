"""Next steps: what one command advises of a log never leads back to where the reader came from."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import flightid as fid
from flightid.findings import Finding
from flightid.study.proposal import propose_study
from flightid.vehicles import SidActivation, fly, write_ardupilot_log
from flightid.vehicles.scenario import stick_moves

COMMAND = r"flightid (\w+) {}(?! --write| --axes)"
"""A command on the log itself; with --axes or --write it does another thing than it did before."""


def _advice(path: Path) -> Iterator[tuple[str, str]]:
    """Command that says it, and what it says to do."""
    verbs: dict[str, tuple[Finding, ...]] = {
        "inspect": fid.inspect_log(path).findings,
        "flight": fid.review_flight(path).findings,
        "plan": fid.plan_flight(path).findings,
    }
    for axes in (("roll",), ("pitch", "yaw")):
        verbs[f"plan {axes}"] = fid.plan_flight(path, axes=axes).findings
    for verb, findings in verbs.items():
        yield from ((verb.split()[0], each.action) for each in findings)
    study = propose_study([path], folder=path.parent)
    if not study.models:
        yield "run", study.refusal()
        yield "tune", study.refusal()


def circles(steps: dict[str, set[str]]) -> list[str]:
    """Commands from which advice leads back to them."""
    found = []
    for start, after in steps.items():
        seen: set[str] = set()
        ahead = [*after]
        while ahead:
            at = ahead.pop()
            if at not in seen:
                seen.add(at)
                ahead += steps.get(at, ())
        found += [start] if start in seen else []
    return found


def test_a_circle_is_found() -> None:
    assert circles({"plan": {"inspect"}, "inspect": {"plan"}, "run": {"plan"}}) == [
        "plan", "inspect",
    ]  # fmt: skip
    assert circles({"inspect": {"plan"}, "flight": {"plan"}, "run": {"flight"}}) == []


def _flown(kind: str, path: Path) -> Path:
    """A log of sticks, of a sweep of roll that was flown well, or of one too short for a model."""
    if kind == "sticks":
        return write_ardupilot_log(fly(doublets=stick_moves(seed=1)[:40], log_every=4), path)
    length_s, lowest_hz = (30.0, 0.15) if kind == "swept" else (4.0, 2.0)
    sweep = SidActivation(
        axis=10, start_s=5.0, magnitude=0.15, start_hz=lowest_hz, stop_hz=12.0,
        fade_in_s=1.0, record_s=length_s, fade_out_s=0.5, leave_after_s=length_s + 10.0,
    )  # fmt: skip
    return write_ardupilot_log(fly(runs=[sweep], log_every=2, seed=1), path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sticks", "swept", "in vain"])
def test_advice_leads_on_and_never_in_a_circle(tmp_path: Path, kind: str) -> None:
    """`plan` had sent its reader to `inspect` for why, and `inspect` to `plan` for what to fly."""
    path = _flown(kind, tmp_path / "flown.bin")
    steps: dict[str, set[str]] = {}
    for verb, action in _advice(path):
        steps.setdefault(verb, set()).update(
            re.findall(COMMAND.format(path.name), " ".join(action.split()))
        )
    assert any(steps.values())
    assert circles(steps) == []
    plan = {"tune"} if kind == "swept" else set()
    assert steps["plan"] <= plan, "a plan is flown; it sends nobody to look at the old log again"
