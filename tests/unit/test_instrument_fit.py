"""Gains of a fit that a loop biases rest on the response to what was injected, and say so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification.instrument_fit import instrument_fit
from tests.strangers import gains as flown

SEED = 5083
"""Gusts, which the loop feeds back: a fifth of the rate is left by output error."""
STRAIGHT = 8291
"""Gusts that make the direct response another vehicle's: its effect is 56 % too large."""


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


def _swept(
    model: fid.TransferFunctionModel, *, n: int, rate_rad_s2: float
) -> tuple[fid.Record, fid.Record]:
    """A sweep of an open loop as simulated, and as a log holds it: with what was injected."""
    time_s = np.arange(n) * 0.02
    sweep = 0.1 * np.sin(rate_rad_s2 * time_s**2)
    bare = fid.Record.from_arrays(time_s, inputs={"tau_phi": sweep}, hold="zero")
    bare = fid.simulate(model, bare, units={"p": "rad/s"}, noise=fid.Noise(sensor={"p": 0.02}))
    logged = fid.Record.from_arrays(
        time_s,
        inputs={"tau_phi": sweep},
        outputs={"p": bare["p"]},
        excitations={"injected": sweep},
        units={"p": "rad/s"},
        hold="zero",
    )
    return bare, logged


def test_an_open_loop_or_nothing_injected_keeps_the_fit() -> None:
    model = fid.load_model("rate_first_order")
    bare, quiet = _swept(model, n=2000, rate_rad_s2=0.1)
    assert instrument_fit(fid.identify(model, quiet, loop="open")) is None
    assert instrument_fit(fid.identify(model, bare, loop="closed")) is None
    both = fid.identify(model, quiet, loop="closed")
    found = instrument_fit(both)
    assert found is not None
    for name, estimate in both.parameters.items():
        other = found.fit.parameters[name]
        spread = np.hypot(estimate.stderr, other.stderr)
        assert abs(other.value - estimate.value) < 4.0 * spread, name


@pytest.fixture(scope="module")
def flights() -> list[fid.Record]:
    """Two sweeps of half a minute, logged at every fourth loop."""
    flight = replace(flown.drawn(STRAIGHT), every=4)
    return [flown.record(flight, STRAIGHT + flown.OTHER * k, 30.0) for k in range(2)]


def test_a_direct_response_has_the_excitation_of_its_records_taken(
    flights: list[fid.Record],
) -> None:
    known = flown.drawn(STRAIGHT).craft.about
    response = fid.estimate_response(flights, inputs="tau_phi", outputs="p")
    # By coherence alone, above what was injected: there the loop shows itself.
    asked = {"n_omega": 25, "band_rad_s": response.pair("p", "tau_phi").usable_band()}
    direct = fid.identify(fid.load_model("rate_motor_lag", axis="roll"), response, **asked)
    found = instrument_fit(direct)
    assert found is not None
    assert "in place of the direct response, which feedback of noise biases" in found.reason
    for name, truth in {"Ltphi": known["effect"], "T_m": known["motor_s"]}.items():
        ours, theirs = found.fit.parameters[name].value, direct.parameters[name].value
        assert abs(theirs / truth - 1.0) > 0.5
        assert abs(ours / truth - 1.0) < 0.05
    assert found.fit.provenance["told"] == asked, "the fit's own options are kept"


def test_a_response_that_needs_no_other_way_knows_no_records(flights: list[fid.Record]) -> None:
    options = {"inputs": "tau_phi", "outputs": "p", "n_omega": 15}

    def excited(records: list[fid.Record], estimator: str = "composite") -> int:
        linear = fid.estimate_response(records, estimator=estimator, **options).linear
        assert linear is not None
        return len(linear.excited)

    assert excited(flights) == 2
    assert excited(flights, "instrument") == 0
    bare = [each.select(["tau_phi", "p"]) for each in flights]
    assert excited([flights[0], bare[1]]) == 0


def test_a_prewhitened_fit_that_fails_is_served_by_the_excitation_too() -> None:
    """No loop biases it; but one without errors carries no gains."""
    model = fid.load_model("rate_first_order")
    _, record = _swept(model, n=3000, rate_rad_s2=0.06)
    response = fid.estimate_response(record, estimator="prewhitened")
    fit = fid.identify(model, response)
    assert fit.covariance is not None
    assert instrument_fit(fit) is None, "it stands by itself"
    served = instrument_fit(replace(fit, covariance=None))
    assert served is not None
    assert served.reason.startswith("the response to what was injected in place of a prewhitened")
    assert served.fit.covariance is not None
