"""A rig in a loop, without equations: what the refusal advises gives gains that are right."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.cli.program import run
from flightid.errors import StudyError
from flightid.study.proposal import propose_study

STEP_S = 0.02


def _in_loop(path: Path) -> Path:
    """A damped oscillation under PI; slow noise comes back by the loop. SciPy alone."""
    random, n = np.random.default_rng(2), 6000
    b, a, _ = signal.cont2discrete(([5.0], [1.0, 1.2, 4.0]), STEP_S)
    b = np.ravel(b)
    asked = np.repeat(np.sign(random.standard_normal(n // 60)), 60)
    noise = signal.lfilter([0.03], [1.0, -0.95], random.standard_normal(n))
    y, u, plant, total = np.zeros(n), np.zeros(n), np.zeros(n), 0.0
    for k in range(n):
        if k > 1:
            plant[k] = b[1] * u[k - 1] + b[2] * u[k - 2] - a[1] * plant[k - 1] - a[2] * plant[k - 2]
        y[k] = plant[k] + noise[k]
        total += 0.6 * STEP_S * (asked[k] - y[k])
        u[k] = 0.5 * (asked[k] - y[k]) + total
    rows = np.c_[STEP_S * np.arange(n), asked, u, y]
    np.savetxt(path, rows, delimiter=",", header="time,r,u,y", comments="")
    return path


def test_the_refusal_names_commands_that_lead_to_a_pid(tmp_path: Path) -> None:
    path = _in_loop(tmp_path / "rig.csv")
    with pytest.raises(StudyError) as refused:
        propose_study([path], folder=tmp_path, inputs=["u"], outputs=["y"], excitations=["r"])
    found = re.search(r"flightid (identify .* --write model\.toml)", str(refused.value))
    assert found is not None
    written = tmp_path / "model.toml"
    words = shlex.split(found[1].replace("model.toml", str(written)))
    assert run([*words, "--json"]) == 0
    found_mode = fid.modes(fid.load_model(str(written))).modes[0]
    assert found_mode.natural_frequency.value == pytest.approx(2.0, rel=0.05)
    assert found_mode.damping_ratio.value == pytest.approx(0.3, abs=0.05)
    assert "flightid tune model.toml --controller pi_d" in str(refused.value)
