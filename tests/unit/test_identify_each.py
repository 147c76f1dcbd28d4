"""Many data sets of one structure: each fit is that of its data alone."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.identification.frequency_domain import model_curves

OMEGA = np.geomspace(1.0, 50.0, 60)
MODEL = fid.load_model("rate_first_order").with_values({"Lp": -6.0, "Ltphi": 180.0})


def _drawn(seed: int, coherent: float, omega: np.ndarray = OMEGA) -> fid.FrequencyResponse:
    noise = np.random.default_rng(seed).standard_normal((2, 1, 1, omega.size))
    clean = MODEL.frequency_response(omega)
    return fid.FrequencyResponse.from_values(
        omega,
        clean * np.exp(0.02 * (noise[0] + 1j * noise[1])),
        inputs=["tau_phi"],
        outputs=["p"],
        units={"p": "rad/s"},
        coherence=np.where(omega < 20.0, 0.95, coherent).reshape(clean.shape),
        random_error=np.full(clean.shape, 0.02),
    )


def test_each_fit_is_that_of_its_data_alone() -> None:
    # Other noise, coherence and frequencies: what is shared must belong to the data at hand.
    sets = [
        _drawn(0, 0.9),
        _drawn(1, 0.9),
        _drawn(2, 0.1),
        _drawn(3, 0.7),
        _drawn(4, 0.9, 2 * OMEGA),
    ]
    fits = fid.identify_each(MODEL, iter(sets), n_omega=15)
    assert [f.to_dict() for f in fits] == [
        fid.identify(MODEL, s, n_omega=15).to_dict() for s in sets
    ]
    assert len({f.parameters["Lp"].value for f in fits}) == len(sets)


def test_responses_of_the_start_are_evaluated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    joined, evaluated = model_curves.Grids.joined, []

    def counted(
        grids: model_curves.Grids, model: fid.GreyBoxModel, free: np.ndarray | None = None
    ) -> np.ndarray:
        evaluated.append(model is MODEL and free is None)
        return joined(grids, model, free)

    monkeypatch.setattr(model_curves.Grids, "joined", counted)
    fid.identify_each(MODEL, [_drawn(seed, 0.9) for seed in range(3)], correct_bias=False)
    assert sum(evaluated) == 1


def test_an_error_says_of_which_data_set() -> None:
    with pytest.raises(fid.FlightidError) as caught:
        fid.identify_each(MODEL, [_drawn(0, 0.9), _drawn(1, 0.9).select(omega_rad_s=[5.0, 50.0])])
    assert caught.value.__notes__ == ["in data set 2"]
