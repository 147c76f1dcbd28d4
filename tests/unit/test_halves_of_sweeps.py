"""Halves of a record that hold sweeps of different inputs are no two looks at one vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import chirp

import flightid as fid

RATE_HZ, SWEEP_S = 50.0, 60.0
TRUTH = {"Lp": -3.0, "Lq": 0.5, "Llat": 5.0, "Mq": -2.0, "Mp": 0.4, "Mlon": 4.0}
TWO = fid.StateSpaceModel.from_dict(
    {
        "name": "two axes",
        "states": {"p": "rad/s", "q": "rad/s"},
        "inputs": {"lat": "1", "lon": "1"},
        "outputs": {"p": "p", "q": "q"},
        "parameters": {
            name: {"value": value, "unit": "1/s^2" if name in {"Llat", "Mlon"} else "1/s"}
            for name, value in TRUTH.items()
        },
        "equations": {"p'": "Lp*p + Lq*q + Llat*lat", "q'": "Mp*p + Mq*q + Mlon*lon"},
    }
)


@pytest.mark.parametrize(
    ("sweeps", "compared"), [(("lat", "lon"), False), (("lat", "lon", "lat", "lon"), True)]
)
def test_halves_are_compared_where_both_sweep_each_input(
    sweeps: tuple[str, ...], compared: bool
) -> None:
    """One sweep a stick: of either input only one half tells; twice in turn both halves do."""
    random, each = np.random.default_rng(3), int(RATE_HZ * SWEEP_S)
    sweep = chirp(np.arange(each) / RATE_HZ, 0.08, SWEEP_S, 2.0, method="logarithmic")
    sweep *= np.hanning(each) ** 0.1
    sticks = {
        name: np.concatenate([sweep * (one == name) for one in sweeps]) for name in TWO.inputs
    }
    time_s = np.arange(each * len(sweeps)) / RATE_HZ
    units = dict.fromkeys(sticks, "1")
    blank = fid.Record.from_arrays(time_s, inputs=sticks, units=units, hold="zero")
    flown = fid.simulate(TWO, blank)
    noise = {name: 0.05 * random.standard_normal(time_s.size) for name in TWO.outputs}
    flown = flown.replace({name: flown[name] + noise[name] for name in TWO.outputs})
    response = fid.estimate_response(flown, inputs=[*sticks], outputs=["p", "q"], n_omega=12)
    fit = fid.identify(TWO, response)
    assert fit.agreement is not None
    assert (fit.agreement.halves is not None) == compared
    assert fit.agreement.agree
