"""Algebraic models: outputs that follow inputs at once are fitted, verified and written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FitError
from tests.closeness import assert_close

TRUTH = {"Cm0": 0.04, "Cma": -0.8, "Cmde": -1.3}
LINEAR, BENT = "Cm0 + Cma*alpha + Cmde*de", "Cm0 + Cma*alpha*(1 + alpha) + Cmde*de"


def moment(formula: str) -> fid.StateSpaceModel:
    return fid.StateSpaceModel.from_dict(
        {
            "inputs": {"alpha": "rad", "de": "rad"},
            "outputs": {"Cm": {"expression": formula, "unit": "1"}},
            "parameters": {name: {"value": 0.5 * v, "unit": "1"} for name, v in TRUTH.items()},
        }
    )


def tunnel(formula: str) -> fid.Record:
    random = np.random.default_rng(0)
    alpha, elevator = (0.1 * random.standard_normal(200) for _ in range(2))
    angle = alpha if formula == LINEAR else alpha * (1.0 + alpha)
    return fid.Record.from_arrays(
        np.arange(200) * 0.02,
        inputs={"alpha": alpha, "de": elevator},
        outputs={"Cm": 0.04 - 0.8 * angle - 1.3 * elevator},
        units={"alpha": "rad", "de": "rad"},
        hold="zero",
    )


@pytest.mark.parametrize("formula", [LINEAR, BENT])
@pytest.mark.parametrize("method", ["output_error", "equation_error"])
def test_they_are_fitted_and_verified(formula: str, method: str, tmp_path: Path) -> None:
    record = tunnel(formula)
    fit = fid.identify(moment(formula), record, method=method, output_bias=False)
    for name, value in TRUTH.items():
        assert_close(fit.parameters[name].value, value, rtol=1e-9, why="no noise")
    fid.write_model(fit, tmp_path / "moment.toml")
    for source in (fit, fid.load_model(tmp_path / "moment.toml")):
        assert fid.verify(source, record).theil["Cm"] < 1e-9
    assert_close(fid.simulate(fit, record)["Cm"], record["Cm"], rtol=1e-9, why="no noise")


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("output_error", "Cm0, output bias of Cm.*output_bias=False"),
        ("equation_error", "Cm0.*output_bias=False"),
        ("fourier_regression", "Cm0.*no harmonic"),
        ("fourier_output_error", "follows states"),
        ("filter_error", "follows states"),
    ],
)
def test_what_cannot_be_told_is_refused(method: str, message: str) -> None:
    with pytest.raises(FitError, match=message):
        fid.identify(moment(LINEAR), tunnel(LINEAR), method=method)
