"""What stands beside fits in gusts, and beside output error that one start alone made."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.conventions import Light
from tests.strangers.gusts import flight, model


def _check(fit: fid.Fit, name: str) -> tuple[Light, str]:
    assert fit.evidence is not None
    (found,) = (each for each in fit.evidence.checks if each.name == name)
    return found.light, found.what


def test_filter_error_is_asked_what_inputs_alone_explain() -> None:
    """Its predictions one sample ahead explain no band; short flights had been "narrow"."""
    record = flight(0, 0.5, 1.0, 20.0)
    fit = fid.identify(model(0.9), record, method="filter_error", gust_states=False)
    light, said = _check(fit, "excitation band")
    assert light is Light.GREEN
    assert "the free run explains" in said


def _lagged_rate(seed: int) -> fid.Record:
    """A rate behind a lag that the model has not."""
    random, n = np.random.default_rng(seed), 1500
    u = np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30), 30)
    behind = lfilter([0.0, 0.2], [1.0, -0.8], u)
    p = lfilter([0.0, 0.1], [1.0, -0.95], behind) + 0.01 * random.standard_normal(n)
    return fid.Record.from_arrays(
        np.arange(n) * 0.02,
        inputs={"u": u},
        outputs={"p": p},
        units={"u": "1", "p": "rad/s"},
        hold="zero",
    )


def _first_order() -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"u": "1"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lu*u"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -2.0, "1/s"), fid.Parameter("Lu", 4.0, "1/s^2")]
        ),
    )


@pytest.mark.parametrize(("starts", "doubted"), [(1, True), (4, False)])
def test_one_start_is_no_settled_search_where_inputs_stay_in_errors(
    starts: int, doubted: bool
) -> None:
    """A local minimum leaves what a missing lag leaves: it had been green, and others blamed."""
    fit = fid.identify(_first_order(), _lagged_rate(0), method="output_error", starts=starts)
    light, said = _check(fit, "estimator settled")
    assert (light is Light.AMBER) is doubted
    assert ("local minimum" in said) is doubted
