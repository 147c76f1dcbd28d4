"""Searches and the whole samples at which delays of held inputs make a cost jump.

Records are of NumPy alone: a heave axis, exact between steps of the input.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

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


ROLL = {
    "name": "roll",
    "states": {"p": "rad/s"},
    "inputs": {"lat": "1"},
    "outputs": {"p": "p"},
    "parameters": {
        "Lp": {"value": -3.0, "unit": "1/s"},
        "Llat": {"value": 8.0, "unit": "1/s^2"},
        "tau": {"value": 0.03, "min": 0.0, "max": 0.3, "unit": "s"},
    },
    "equations": {"p'": "Lp*p+Llat*lat"},
    "delays": {"lat": "tau"},
}


def gusty_roll(seed: int, delay_s: float = 0.047, damping: float = -4.0) -> fid.Record:
    """Ten seconds of 3-2-1-1 in steps of 40 ms, in a gust of an own lag and white noise."""
    rng, step_s, parts, n = np.random.default_rng(seed), 0.04, 20, 250
    fine_s = step_s / parts
    lat = np.zeros(n)
    for k in (25, 117):
        lat[k : k + 63] = np.repeat([1.0, -1.0, 1.0, -1.0], [27, 18, 9, 9])
    moved = np.concatenate([[0.0], np.cumsum(lat) * step_s])
    late = np.interp(np.arange(n * parts + 1) * fine_s - delay_s, np.arange(n + 1) * step_s, moved)
    wind = np.sqrt(1.0 - np.exp(-2.0 * fine_s)) * rng.standard_normal(n * parts)
    gust = lfilter([1.0], [1.0, -np.exp(-fine_s)], wind)
    decay = np.exp(damping * fine_s)
    lag = [0.0, (decay - 1.0) / damping], [1.0, -decay]
    p, shaken = (lfilter(*lag, each)[::parts] for each in (np.diff(late) / fine_s * 10.0, gust))
    noise = 0.4 * p.std() / shaken.std() * shaken + 0.03 * p.std() * rng.standard_normal(n)
    return fid.Record.from_arrays(
        np.arange(n) * step_s,
        inputs={"lat": lat},
        outputs={"p": p + noise},
        units={"lat": "1", "p": "rad/s"},
        hold="zero",
    )


def test_a_filter_passes_whole_samples_of_what_a_state_feels() -> None:
    """Its cost has a kink there: the delay ended at 36 ms, the damping at -3.28, without bars."""
    fit = fid.identify(
        fid.StateSpaceModel.from_dict(ROLL), gusty_roll(seed=19), method="filter_error"
    )
    assert fit.cost < 0.3
    for name, truth in (("tau", 0.047), ("Lp", -4.0), ("Llat", 10.0)):
        interval = fit.parameters[name].interval95
        assert interval is not None
        assert interval[0] < truth < interval[1]
