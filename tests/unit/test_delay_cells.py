"""Searches and the whole samples at which delays of held inputs make a cost jump.

Records are of NumPy alone: a heave axis, exact between steps of the input.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import flightid as fid
from flightid.evidence.gather import CONVERGED
from flightid.identification.delay_cells import LOOK, DelayCells

STEP_S = 0.02
TRUE = {"Zw": -0.35, "Zc": -9.0, "tau": 0.06}
EQUATIONS = """
kind = "state-space"
name = "heave"
[states]
w = "m/s"
[inputs]
col = "1"
[outputs]
w = "w"
az = { expression = "w'", unit = "m/s^2" }
[parameters]
Zw = { value = -0.6, unit = "1/s" }
Zc = { value = -6.0, unit = "m/s^2" }
tau = { value = 0.03, min = 0.0, max = 0.3, unit = "s" }
[equations]
"w'" = "Zw*w + Zc*col"
[delays]
col = "tau"
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> fid.StateSpaceModel:
    path = tmp_path_factory.mktemp("heave") / "heave.toml"
    path.write_text(EQUATIONS)
    loaded = fid.load_model(path)
    assert isinstance(loaded, fid.StateSpaceModel)
    return loaded


def flight(tau_s: float, seed: int = 1, n: int = 400) -> fid.Record:
    """A 3-2-1-1 in steps of a device, late by tau, with white noise of both sensors."""
    rng = np.random.default_rng(seed)
    command = np.repeat([0.0, 0.6, -0.8, 0.8, -0.8, 0.0], [50, 60, 40, 20, 20, n - 190])
    fine = 10
    late = round(tau_s / STEP_S * fine)
    reached = np.concatenate([np.zeros(late), np.repeat(command, fine)])[: n * fine]
    decay = np.exp(TRUE["Zw"] * STEP_S / fine)
    gain = TRUE["Zc"] * (decay - 1.0) / TRUE["Zw"]
    w, rows = 0.0, []
    for k, col in enumerate(reached):
        if k % fine == 0:
            rows.append((w, TRUE["Zw"] * w + TRUE["Zc"] * col))
        w = decay * w + gain * col
    outputs: NDArray[np.float64] = np.array(rows).T + rng.normal(0.0, [[0.4], [0.1]], (2, n))
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"col": command},
        outputs={"w": outputs[0], "az": outputs[1]},
        units={"w": "m/s", "az": "m/s^2"},
    ).declare(hold="zero")


@pytest.mark.parametrize(
    ("method", "start"),
    [("output_error", 0.03), ("output_error", 0.075), ("filter_error", 0.03)],
)
def test_a_search_passes_whole_samples(
    model: fid.StateSpaceModel, method: str, start: float
) -> None:
    """From either side of three samples, where slopes end at 62.8 ms and -8.78 m/s²."""
    fit = fid.identify(model.with_values({"tau": start}), flight(TRUE["tau"]), method=method)
    found = fit.parameters["tau"]
    assert abs(found.value - TRUE["tau"]) < 1e-3
    assert abs(fit.parameters["Zc"].value - TRUE["Zc"]) < 0.1
    assert "hold-contradicted" not in {each.code for each in fit.findings}
    assert len(fit.minima) == 1


@pytest.mark.parametrize("start", [0.03, 0.055])
def test_a_delay_of_whole_samples_is_an_end(model: fid.StateSpaceModel, start: float) -> None:
    """Slopes of a jump's other side made a search stall, or a look's two steps were its end."""
    fit = fid.identify(
        model.with_values({"tau": start}), flight(TRUE["tau"], seed=2), method="output_error"
    )
    assert fit.parameters["tau"].value == pytest.approx(TRUE["tau"], abs=1e-7)
    assert fit.termination in CONVERGED
    assert fit.iterations > LOOK + 9


def test_a_cell_ends_where_an_input_reaches_another_sample(model: fid.StateSpaceModel) -> None:
    cells = DelayCells((STEP_S,), "zero")
    around = cells.around(model)
    assert around is not None
    assert np.allclose([each[2] for each in around], [STEP_S, 2.0 * STEP_S], atol=1e-7)
    assert np.all(np.isinf([each[:2] for each in around]))
    assert DelayCells((STEP_S,), "first").around(model) is None
