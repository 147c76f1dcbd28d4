"""The published R-50 hover model is recovered from its own noise-free responses."""

from __future__ import annotations

import numpy as np

import flightid as fid

# Pairs that carry the parameters of hover; the others add nothing that these lack.
PAIRS = ["p/lat", "q/lat", "p/lon", "q/lon", "r/lat", "w/lat", "w/lon", "um/lat", "vm/lat"]
PAIRS += ["um/lon", "vm/lon", "r/ped", "w/ped", "r/col", "w/col", "ax/lon", "ay/lat"]


def test_r50_hover_is_recovered_from_starts_a_third_off() -> None:
    truth = fid.load_model("r50_hover").with_responses(*PAIRS)
    omega = np.geomspace(0.1, 40.0, 120)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=list(truth.inputs),
        outputs=list(truth.outputs),
        units=truth.units,
    )
    generator = np.random.default_rng(7)
    values = {p.name: p.value for p in truth.parameters.free}
    start = {name: value * generator.uniform(0.7, 1.3) for name, value in values.items()}
    fit = fid.identify(truth.with_values(start), data, n_omega=40)
    worst = max(abs(fit.parameters[name].value / value - 1.0) for name, value in values.items())
    assert worst < 1e-6, f"{worst:.1e}, cost {fit.average_cost:.1e}"
