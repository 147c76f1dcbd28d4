"""Output error against SciPy's least squares on the same residuals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

import flightid as fid
from tests.closeness import assert_close

Array = NDArray[np.float64]


def _record() -> fid.Record:
    time_s = np.arange(400) * 0.02
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": np.sign(np.sin(2.0 * time_s))})
    truth = fid.load_model("rate_first_order").with_values(
        {"Lp": -6.0, "Ltphi": 180.0, "tau": 0.027}
    )
    flown = fid.simulate(truth, driven, units={"p": "rad/s"}, initial_state=[0.01])
    noise = np.random.default_rng(0).standard_normal(400)
    return flown.replace({"p": flown["p"] + 2.0 * noise + 1.0})


def test_the_minimum_is_that_of_scipy() -> None:
    record = _record()
    model = fid.load_model("rate_first_order")

    def residuals(x: Array) -> Array:
        tried = model.with_values(dict(zip(names, x[: len(names)].tolist(), strict=True)))
        run = fid.simulate(tried, record, initial_state=x[len(names) : -1])
        return np.asarray(record["p"] - run["p"] - x[-1])

    names = [parameter.name for parameter in model.parameters.free]
    fit = fid.identify(model, record)
    start = np.array([model.parameters[name].value or 0.0 for name in names] + [0.0, 0.0])
    start[: len(names)] *= 1.01
    lower = [model.parameters[name].minimum for name in names] + [-np.inf, -np.inf]
    upper = [model.parameters[name].maximum for name in names] + [np.inf, np.inf]
    peer = least_squares(
        residuals,
        np.clip(start, np.array(lower) + 1e-9, np.array(upper) - 1e-9),
        jac="3-point",
        bounds=(lower, upper),
        x_scale="jac",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    for name, value in zip(names, peer.x, strict=False):
        assert_close(fit.parameters[name].value, value, rtol=2e-5, why="one minimum of one cost")
    left = float(np.sum(fit.records[0].residuals ** 2))
    assert_close(left, 2.0 * peer.cost, rtol=1e-8, why="the same sum of squares")
    assert fit.noise_covariance is not None
    assert_close(fit.noise_covariance[0, 0], left / 400, rtol=1e-6, why="R is their mean square")
