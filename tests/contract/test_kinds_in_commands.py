"""Model files of every kind in every command that takes one: an answer, or a refusal with why."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import flightid as fid
from flightid.cli.output import Exit
from flightid.cli.program import run
from tests.contract.test_kinds import STRUCTURES, T_S, fit, record

GREY = {"grey linear", "grey nonlinear", "transfer"}
SAMPLED = set(STRUCTURES) - GREY
NARX = {"NARX"}
TUNE_REFUSES = {"innovations", *NARX}
# Command -> its words after the model, and the kinds that it refuses.
COMMANDS: dict[str, tuple[list[str], set[str]]] = {
    "verify": (["{records}"], set()),
    "simulate model": (["{records}"], set()),
    "export toml": (["{folder}/x.toml"], set()),
    "export c": (["{folder}/x.c"], set()),
    "export mat": (["{folder}/x.mat"], NARX),
    "export fmu": (["{folder}/x.fmu", "--no-compile"], NARX),
    "fly": (["--duration", "0.2"], set()),
    "modes": ([], NARX),
    "margins": ([], NARX),
    "margins closed": (["--feedback", "tau_phi=p:0.02"], NARX),
    "disk-margin": ([], NARX),
    "disk-margin closed": (["--feedback", "tau_phi=p:0.02", "--at", "inputs"], NARX),
    "disturbance-rejection": ([], NARX),
    "disturbance-rejection closed": (["--feedback", "tau_phi=p:0.02"], NARX),
    "lower-order": (["--kind", "roll"], NARX),
    "rotor-physics": (["--rotor-speed-rad-s", "90"], set(STRUCTURES)),
    "predict": (["{records}", "--horizon", "5"], GREY),
    "predict free": (["{records}", "--write", "{folder}/predicted.parquet"], set()),
    "handling-qualities": ([], NARX),
    "derivatives": ([], {"transfer", *SAMPLED}),
    "interpret": ([], {*GREY, *NARX}),
    "compare": (["{other}"], SAMPLED),
    # The innovations form has one state too many here, and so a steady gain of either sign.
    "tune": (["--controller", "pi", "--loop-rate-hz", "20", "--nominal"], TUNE_REFUSES),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("models")
    for kind in STRUCTURES:
        fid.write_model(fit(kind), made / f"{kind.replace(' ', '_')}.toml")
    fid.write_model(fit("transfer"), made / "other.toml")
    fid.write_records(record(), made / "records.parquet")
    return made


def _words(command: str, kind: str, folder: Path) -> Iterator[str]:
    told, _ = COMMANDS[command]
    verb, _, rest = command.partition(" ")
    yield from [verb, *([rest] if verb == "simulate" else [])]
    yield str(folder / f"{kind.replace(' ', '_')}.toml")
    places = {
        "folder": folder,
        "records": folder / "records.parquet",
        "other": folder / "other.toml",
    }
    yield from (word.format(**places) for word in told)
    if kind in GREY and rest in ("c", "fmu"):
        yield from ("--sample-time-s", str(T_S))
    yield "--json"


# Gains take a second a kind: the tests of `tune` hold them in every run, the kinds at night. A loop
# is closed, and an order lowered, by one function for any linear model: one kind or two show it.
AT_NIGHT = {
    "tune": (),
    "lower-order": ("transfer", "ARX", "NARX"),
    **dict.fromkeys((c for c in COMMANDS if "closed" in c), ("ARX", "NARX")),
}
IN_EVERY_RUN = [
    *((each, AT_NIGHT.get(each, tuple(STRUCTURES))) for each in COMMANDS if each != "tune"),
    *(pytest.param(each, tuple(STRUCTURES), marks=pytest.mark.nightly) for each in AT_NIGHT),
]


@pytest.mark.parametrize(("command", "kinds"), IN_EVERY_RUN)
def test_a_command_takes_the_file_of_every_kind_or_says_why_not(
    command: str, kinds: tuple[str, ...], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, refused = COMMANDS[command]
    offenders = []
    for kind in kinds:
        code = run(list(_words(command, kind, folder)))
        said = capsys.readouterr()
        if kind in refused:
            typed = "needed" in said.err or "Next:" in said.err
            if code != Exit.UNUSABLE or not typed or "Traceback" in said.err:
                offenders.append(f"{kind}: {code}: {said.err or said.out[:200]}")
        elif code not in (Exit.DONE, Exit.RED) or not json.loads(said.out)["schema"]:
            offenders.append(f"{kind}: {code}: {said.err}")
    assert not offenders, "\n".join(offenders)
