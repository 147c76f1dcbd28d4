"""Responses whose model misses what no fit of their noise allows have no bars, however small."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete

import flightid as fid
from flightid.identification.frequency_domain.error_model import ErrorModel
from flightid.identification.frequency_domain.misfit import (
    MisfitForm,
    misfit_forms,
    why_missed,
)

STEP_S = 0.04
N_R, N_PED = -2.2, 6.0


def swept(seed: int, lag_s: float) -> fid.Record:
    """A yaw axis behind a lag, by SciPy: straight lines between samples."""
    n = round(30.0 / STEP_S)
    time_s = np.arange(n) * STEP_S
    ratio = np.log(13.0 / 0.5)
    sweep = np.sin(0.5 * 30.0 / ratio * (np.exp(time_s / 30.0 * ratio) - 1.0))
    a = np.array([[N_R, N_PED], [0.0, -1.0 / lag_s]])
    b, c = np.array([[0.0], [1.0 / lag_s]]), np.array([[1.0, 0.0]])
    phi, gamma, out, through, _ = cont2discrete((a, b, c, np.zeros((1, 1))), STEP_S, method="foh")
    state, rate = np.zeros(2), np.empty(n)
    for k, moved in enumerate(sweep):
        rate[k] = (out @ state + through[0] * moved)[0]
        state = phi @ state + gamma[:, 0] * moved
    noise = np.random.default_rng(seed).standard_normal(n)
    return fid.Record.from_arrays(
        time_s,
        inputs={"ped": sweep},
        outputs={"r": rate + 0.05 * rate.std() * noise},
        units={"ped": "1", "r": "rad/s"},
        hold="first",
        loop="open",
    )


def model(lag: str) -> fid.StateSpaceModel:
    """With the lag as a delay, or without."""
    held = {"delays": {"ped": "tau"}} if lag else {}
    tau = {"tau": {"value": 0.01, "min": 0.0, "max": 0.3, "unit": "s"}} if lag else {}
    return fid.StateSpaceModel.from_dict(
        {
            "name": "yaw",
            "states": {"r": "rad/s"},
            "inputs": {"ped": "1"},
            "outputs": {"r": "r"},
            "parameters": {
                "Nr": {"value": -1.2, "unit": "1/s"},
                "Nped": {"value": 4.0, "unit": "1/s^2"},
                **tau,
            },
            "equations": {"r'": "Nr*r + Nped*ped"},
            **held,
        }
    )


@pytest.mark.parametrize("seed", range(2))
def test_a_lag_left_out_of_a_prewhitened_response_has_no_bars(seed: int) -> None:
    data = fid.estimate_response(swept(seed, 0.03), band_rad_s=(0.7, 12.0), estimator="prewhitened")
    fit = fid.identify(model(""), data)
    (said,) = [each for each in fit.findings if each.code == "cost"]
    assert "so there are no intervals" in said.message
    assert str(said.light) == "amber"
    assert fit.covariance is None
    assert "misses r by" in fit.parameters["Nr"].reason


@pytest.mark.parametrize("estimator", ["prewhitened", "composite", "local_polynomial"])
def test_a_model_that_misses_nothing_keeps_its_bars(estimator: str) -> None:
    data = fid.estimate_response(swept(0, 0.004), band_rad_s=(0.7, 12.0), estimator=estimator)
    fit = fid.identify(model("tau"), data)
    assert not fit.missed
    assert fit.covariance is not None


def test_all_outputs_are_tested_by_one_pass_over_their_errors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record, noise = swept(0, 0.004), 0.02 * np.random.default_rng(9).standard_normal(750)
    beside = fid.Record.from_arrays(
        np.arange(750) * STEP_S,
        inputs={"ped": record["ped"]},
        outputs={"r": record["r"], "turn": record["r"] + noise},
        units={"ped": "1", "r": "rad/s", "turn": "rad/s"},
        hold="first",
        loop="open",
    )
    table = model("tau").to_dict()
    table.pop("responses", None)
    table["outputs"] = {"r": "r", "turn": "r"}
    both = fid.StateSpaceModel.from_dict(table)
    asked: list[tuple[np.ndarray, np.ndarray]] = []
    untouched = ErrorModel.propagated

    def forms(
        end: object, points: object, bias: object, errors: ErrorModel, *further: object
    ) -> object:
        def propagated(self: ErrorModel, gain: np.ndarray, told: int = 0) -> object:
            covariance, freedom = untouched(self, gain, told)
            alone = [untouched(self, row[None], 1)[1][0] for row in gain]
            asked.append((freedom, np.array(alone)))
            return covariance, freedom

        with monkeypatch.context() as spied:
            spied.setattr(ErrorModel, "propagated", propagated)
            return misfit_forms(end, points, bias, errors, *further)

    monkeypatch.setattr("flightid.identification.frequency_domain.fit.misfit_forms", forms)
    fid.identify(both, fid.estimate_response(beside, band_rad_s=(0.7, 12.0)))
    ((freedom, alone),) = asked
    assert len(freedom) == 2
    assert freedom == pytest.approx(alone, rel=1e-9)


def test_the_worst_of_what_is_certain_is_named() -> None:
    forms = [MisfitForm("q", 6.0, 1e-9), MisfitForm("p", 30.0, 1e-3), MisfitForm("r", 9.0, 1e-9)]
    assert "misses r by 9 times" in why_missed(forms)
    assert not why_missed(forms[1:2])
