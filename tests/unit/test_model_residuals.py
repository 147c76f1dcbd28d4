"""Models beside the records of a response."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flightid as fid
from flightid.identification.frequency_domain.model_residuals import ModelResiduals
from flightid.responses.windows.transform import FoldedBasis


def test_a_model_whose_input_the_response_lacks_is_not_corrected() -> None:
    model = fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad", "dr": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lda*(da + dr)"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -3.0, "1/s"), fid.Parameter("Lda", 12.0, "1/s^2")]
        ),
        name="roll",
    ).with_responses("p/da")
    made = fid.excitation.sweep(
        band_rad_s=(1.0, 20.0), amplitude=0.1, duration_s=40.0, sample_rate_hz=50.0, name="da"
    )
    both = fid.Record.from_arrays(
        made.time_s, inputs={**made.by_name, "dr": np.zeros_like(made.time_s)}
    )
    flown = fid.simulate(model, both, units={"p": "rad/s"})
    measured = fid.Record.from_arrays(
        made.time_s,
        inputs=made.by_name,
        outputs={"p": flown["p"]},
        units={"da": "rad", "p": "rad/s"},
    )
    response = fid.estimate_response(measured, band_rad_s=(1.5, 15.0), n_omega=30)
    fit = fid.identify(model, response)
    said = "no samples of its input dr; needed every input of the model; the response holds da"
    assert any(said in each.message for each in fit.findings)
    assert all(each.interval95 is None for each in fit.parameters.values())


def test_a_fit_makes_each_basis_and_follows_each_model_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = fid.load_model("rate_first_order")
    made = fid.excitation.sweep(
        band_rad_s=(1.0, 20.0), amplitude=0.1, duration_s=40.0, sample_rate_hz=50.0, name="tau_phi"
    )
    sticks = fid.Record.from_excitation(made)
    flown = fid.simulate(model, sticks, units={"p": "rad/s"}, noise=fid.Noise(sensor={"p": 0.05}))
    response = fid.estimate_response(flown, band_rad_s=(1.5, 15.0), n_omega=30)
    bases: list[tuple[object, ...]] = []
    followed: list[tuple[ModelResiduals, list[float | None]]] = []
    make, follow = FoldedBasis.of, ModelResiduals._follow

    def counted(plan, omega, detrend="none"):
        bases.append((plan, omega.tobytes(), detrend))
        return make(plan, omega, detrend)

    def followed_once(self, model):
        followed.append((self, [p.value for p in model.parameters.values()]))
        return follow(self, model)

    monkeypatch.setattr(FoldedBasis, "of", counted)
    monkeypatch.setattr(ModelResiduals, "_follow", followed_once)
    fid.identify(model, response)
    assert len(bases) == len(set(bases)) > 1
    assert not any(one[0] is other[0] and one[1] == other[1] for one, other in pairwise(followed))
