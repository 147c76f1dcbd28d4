"""The coherence test: which responses are kept, where, and why not."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid.errors import OptionError
from tests.closeness import assert_close

OMEGA = np.geomspace(0.1, 10.0, 41)


def _seen(*coherence: np.ndarray) -> fid.FrequencyResponse:
    names = [f"u{place}" for place in range(len(coherence))]
    ones = np.ones((1, len(names), OMEGA.size))
    return fid.FrequencyResponse.from_values(
        OMEGA, ones, inputs=names, outputs=["p"], coherence=np.array([coherence])
    )


def test_kept_narrow_and_silent_responses() -> None:
    full, none = np.full(41, 0.9), np.full(41, 0.3)
    narrow = np.where(OMEGA > 7.0, 0.9, 0.1)
    gap = np.where((OMEGA > 0.4) & (OMEGA < 0.6), 0.1, 0.8)
    found = fid.coherent_pairs(_seen(full, none, narrow, gap))
    assert found.names == ("p/u0", "p/u3")
    assert found.bands["p/u3"] == (pytest.approx(0.1), pytest.approx(10.0))
    by_name = {pair.name: pair for pair in found.pairs}
    assert_close(by_name["p/u0"].decades, 2.0, rtol=1e-12, why="the whole band")
    assert by_name["p/u0"].reason == "coherent"
    assert by_name["p/u3"].reason == "coherent but for 1 gap"
    assert by_name["p/u1"].reason.startswith("coherence reaches 0.30 at most")
    assert "too narrow" in by_name["p/u2"].reason
    assert "2 of 4 responses kept" in repr(found)
    assert "too narrow" in str(found.summary())
    assert "<table>" in found._repr_html_()
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["pairs"][1]["kept"] is False


def test_a_fit_takes_what_it_says() -> None:
    model = fid.load_model("rate_first_order").with_values({"Lp": -4.0})
    data = fid.FrequencyResponse.from_values(
        OMEGA,
        model.frequency_response(OMEGA),
        inputs=["tau_phi"],
        outputs=["p"],
        units={"p": "rad/s"},
        coherence=np.where(OMEGA > 1.0, 0.9, 0.1)[None, None],
    )
    chosen = fid.coherent_pairs(data)
    fit = fid.identify(model, data, band_rad_s=chosen.bands)
    assert fit.responses[0].band_rad_s == chosen.bands["p/tau_phi"]


@pytest.mark.parametrize("options", [{"minimum_coherence": 1.0}, {"minimum_decades": 0.0}])
def test_refusals(options: dict[str, float]) -> None:
    with pytest.raises(OptionError, match="the coherence test has no meaning"):
        fid.coherent_pairs(_seen(np.ones(41)), **options)
