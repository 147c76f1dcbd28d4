"""One model of all outputs of a rig in place of one each, where its free runs are better."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from flightid.errors import FitError, StudyError
from flightid.reading import parse_toml
from flightid.study import run_study
from flightid.study.choice_section import choice_blocks
from flightid.study.proposal import propose_study, structures_of
from flightid.study.proposal.structures_of import GroupScans, ProposedModel


class Scans:
    """What was scanned: outputs, and free-run errors of a model of all of them."""

    outputs = ("p", "q")

    def __init__(self, together: dict[str, float] | FitError | None) -> None:
        self.together = together

    def driving(self, outputs: tuple[str, ...], band: object) -> tuple[str, ...]:
        return ("u",)

    def subspace_errors(self, *_: object) -> dict[str, float] | None:
        if isinstance(self.together, FitError):
            raise self.together
        return self.together


@pytest.mark.parametrize(
    ("together", "taken", "said"),
    [
        ({"p": 0.8, "q": 2.05}, True, "Taken, one model of all outputs: free runs on what was"),
        ({"p": 0.5, "q": 2.2}, False, "Not taken, one model of all outputs: free runs on what"),
        ({"p": 0.97, "q": 1.97}, False, "p 0.97 (by itself 1), q 1.97 (by itself 2)"),
        (None, False, ""),
        (FitError("too short"), False, ""),
    ],
    ids=["better", "worse at one", "alike", "diverged", "not fitted"],
)
def test_it_is_taken_where_no_output_runs_worse_and_all_run_better(
    monkeypatch: pytest.MonkeyPatch, together: object, *, taken: bool, said: str
) -> None:
    alone = {
        name: ProposedModel(f"{name} from u", ['tried = "oe 1."'], error=error, tried="oe 1.")
        for name, error in (("p", 1.0), ("q", 2.0))
    }
    monkeypatch.setattr(structures_of, "_alone", lambda _, output, __: alone[output])
    record = SimpleNamespace(duration_s=100.0, sample_rate_hz=10.0)
    group = SimpleNamespace(inputs=("u",), parts=(SimpleNamespace(record=record),))
    segments = SimpleNamespace(together=(), fitted="rig, fitted", unseen=("rig, unseen",))
    found, missed = structures_of.structures_of(GroupScans(group, segments, Scans(together)))
    assert not missed
    assert [each.name for each in found] == (
        ["p and q from u"] if taken else ["p from u", "q from u"]
    )
    assert said in " ".join(found[0].said)
    for each in found:
        (told,) = (line for line in each.lines if line.startswith("tried = "))
        assert said in told, "the report of every model repeats it"
        settings = SimpleNamespace(
            tried=parse_toml(told, "", "", StudyError)["tried"], structure=None
        )
        blocks = choice_blocks(SimpleNamespace(settings=settings, choice=None, fit=None))
        assert said in blocks[0].text
    if taken:
        assert 'structure = "subspace"' in found[0].lines
        assert 'outputs = ["p", "q"]' in found[0].lines


def three_modes(folder: Path) -> Path:
    """A rig by SciPy: three light modes that two sensors see, 3 % noise."""
    random, n, step_s = np.random.default_rng(5), 1500, 0.05
    a, c = np.zeros((6, 6)), random.standard_normal((2, 6))
    for place, (omega, zeta) in enumerate([(2.0, 0.08), (5.0, 0.06), (9.0, 0.05)]):
        a[2 * place : 2 * place + 2, 2 * place : 2 * place + 2] = [
            [0.0, omega],
            [-omega, -2 * zeta * omega],
        ]
    b = random.standard_normal((6, 1))
    ad, bd, *_ = signal.cont2discrete((a, b, c, np.zeros((2, 1))), step_s)
    u = np.repeat(np.sign(random.standard_normal((n // 3, 1))), 3, axis=0)
    _, y, _ = signal.dlsim((ad, bd, c, np.zeros((2, 1)), step_s), u)
    y += 0.03 * np.std(y, axis=0) * random.standard_normal(y.shape)
    rows = np.column_stack([np.arange(n) * step_s, u, y])
    np.savetxt(folder / "arm.csv", rows, "%.7g", ",", header="time [s],u,p,q", comments="")
    return folder / "arm.csv"


@pytest.mark.slow
def test_three_modes_of_two_sensors_are_one_model(tmp_path: Path) -> None:
    """Models of one output have two modes at first; what was fitted for the choice is the fit."""
    known: dict[str, object] = {}
    asked = {"inputs": ["u"], "outputs": ["p", "q"], "hold": "zero"}
    made = propose_study([three_modes(tmp_path)], folder=tmp_path, cache=known, **asked)
    assert made.models == ("p and q from u",)
    assert any(said.startswith("Taken, one model of all outputs") for said in made.said)
    study = run_study(made.write(tmp_path / "arm-study.toml"), cache=known)
    assert "fit: p and q from u" in study.from_cache
    fit = study.identified[0].fit
    assert fit is not None
    assert fit.model.order >= 6
    assert str(fit.evidence.light) != "red"
    assert min(next(iter(study.identified[0].on_unseen.values())).fit_percent.values()) > 90.0
