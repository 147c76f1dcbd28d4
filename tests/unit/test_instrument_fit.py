"""Gains of a fit that a loop biases rest on the response to what was injected, and say so."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification.instrument_fit import instrument_fit
from tests.strangers import gains as flown

SEED = 5083
"""Gusts, which the loop feeds back: a fifth of the rate is left by output error."""


@pytest.fixture(scope="module")
def biased() -> fid.Fit:
    """Output error along two sweeps of a vehicle that NumPy flies with its loops closed."""
    flight = flown.drawn(SEED)
    assert flight.method == "output_error"
    return flown.fitted(flight, SEED)


def _truth() -> dict[str, float]:
    known = flown.drawn(SEED).craft.about
    return {"Ltphi": known["effect"], "Lp": known["damping"], "T_m": known["motor_s"]}


def test_the_excitation_takes_the_bias_of_feedback_away(biased: fid.Fit) -> None:
    found = instrument_fit(biased)
    assert found is not None
    assert "output error, which feedback of noise biases (" in found.reason
    for name, value in _truth().items():
        ours, theirs = found.fit.parameters[name], biased.parameters[name].value
        assert abs(ours.value - value) < 3.0 * ours.stderr, name
        assert abs(ours.value - value) < 0.4 * abs(theirs - value), "the bias that it takes away"
    assert found.fit.structure == biased.structure
    bound, before = (each.model_errors["p/tau_phi"].at(19.0) for each in (found.fit, biased))
    assert bound < 0.2 * before, "the bound is measured by way of the excitation too"
    assert instrument_fit(found.fit) is None


def test_gains_rest_on_it_and_say_so(biased: fid.Fit) -> None:
    flight = flown.drawn(SEED)
    design = fid.tune_pid(biased, gains=flown.loop_of(flight.flown, flight), draws=60, seed=SEED)
    (said,) = (each for each in design.findings if each.code == "instrument-fit")
    assert said.light is Light.AMBER
    assert design.exists
    assert flown.broken_promise(design, flight, SEED) == ""


def test_an_open_loop_or_nothing_injected_keeps_the_fit() -> None:
    model = fid.load_model("rate_first_order")
    time_s = np.arange(2000) * 0.02
    sweep = 0.1 * np.sin(0.1 * time_s**2)
    bare = fid.Record.from_arrays(time_s, inputs={"tau_phi": sweep}, hold="zero")
    bare = fid.simulate(model, bare, units={"p": "rad/s"}, noise=fid.Noise(sensor={"p": 0.02}))
    quiet = fid.Record.from_arrays(
        time_s,
        inputs={"tau_phi": sweep},
        outputs={"p": bare["p"]},
        excitations={"injected": sweep},
        units={"p": "rad/s"},
        hold="zero",
    )
    assert instrument_fit(fid.identify(model, quiet, loop="open")) is None
    assert instrument_fit(fid.identify(model, bare, loop="closed")) is None
    both = fid.identify(model, quiet, loop="closed")
    found = instrument_fit(both)
    assert found is not None
    for name, estimate in both.parameters.items():
        other = found.fit.parameters[name]
        spread = np.hypot(estimate.stderr, other.stderr)
        assert abs(other.value - estimate.value) < 4.0 * spread, name
