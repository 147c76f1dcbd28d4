"""Interpretation of the published twin-rotor models, equations (3) to (6), and of fits."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid.errors import ModelError
from flightid.plot.polynomial import pole_zero
from tests.closeness import assert_close
from tests.innovations_records import SINGLE, flown

P = fid.PolynomialModel
EQUATION_3 = P(
    ("u1",), "y1", 0.1, a=[1, -2.372, 1.465, 0.2673, -0.351], b=[[-0.0007, 0.007, 0.0001, 0.006]]
)


def from_roots(output, source, poles, zeros):
    a, b = (np.atleast_1d(np.real(np.poly(roots))) for roots in (poles, zeros))
    return P((source,), output, 0.1, a=a, b=[b])


EQUATION_5 = from_roots(
    "y2", "u1", [0.9573, -0.5961, 0.9773 + 0.0492j, 0.9773 - 0.0492j],
    [0.6971, 0.0515 + 1.8236j, 0.0515 - 1.8236j],
)  # fmt: skip
EQUATION_6 = from_roots(
    "y2", "u2", [0.773, -0.582, 0.982 + 0.0497j, 0.982 - 0.0497j],
    [-1.48, 0.91 + 1.5089j, 0.91 - 1.5089j],
)  # fmt: skip


def codes(found):
    return [finding.code for finding in found.findings]


def test_equation_3_holds_the_published_resonance():
    found = fid.interpret(EQUATION_3)
    (mode,) = found.resonances
    assert_close(mode.frequency_hz, 0.335, atol=5e-4, why="three digits printed")
    assert_close(mode.root.damping.value, 0.037, atol=5e-4, why="two digits printed")
    assert "no-continuous-counterpart" in codes(found)
    assert "non-minimum-phase" not in codes(found)
    (far,) = [item for item in found.roots if "leading coefficient" in item.character]
    assert_close(far.root.z.real, 10.09, rtol=2e-3, why="printed in equation (4)")
    assert any("slow real pole" in text and "0.617 s" in text for text in found.sentences)
    assert found.transfer_functions["y1/u1"].startswith("(-0.0007 z^3 + 0.007 z^2")


def test_equation_4_must_read_plus_042():
    pair = [0.971 + 0.21j, 0.971 - 0.21j]
    wanted = np.asarray(EQUATION_3.a)
    right = np.real(np.poly([0.8488, -0.42, *pair]))
    printed = np.real(np.poly([0.8488, 0.42, *pair]))
    assert np.max(np.abs(right - wanted)) < 0.01
    assert np.max(np.abs(printed - wanted)) > 0.5


@pytest.mark.parametrize(
    ("model", "hertz", "damping", "pole"),
    [(EQUATION_5, 0.0872, 0.396, -0.5961), (EQUATION_6, 0.0848, 0.317, -0.582)],
)
def test_yaw_models_are_damped_oscillations_with_a_mode_at_a_tenth_hertz(
    model, hertz, damping, pole
):
    found = fid.interpret(model)
    (mode,) = [item for item in found.roots if "damped oscillation" in item.character]
    assert_close(mode.frequency_hz, hertz, rtol=2e-3, why="recomputed from the printed poles")
    assert_close(mode.root.damping.value, damping, rtol=3e-3, why="recomputed")
    assert {"no-continuous-counterpart", "non-minimum-phase"} <= set(codes(found))
    assert f"z = {pole:.4g}" in " ".join(map(str, found.findings))


def test_sampling_zeros_are_not_called_non_minimum_phase():
    found = fid.interpret(EQUATION_6)
    (made,) = [item for item in found.roots if item.root.z == pytest.approx(-1.48)]
    assert made.character.startswith("made by sampling")


def test_a_fit_brings_intervals_to_every_meaning():
    record = flown(SINGLE, 1, n=600, noise=0.2)
    fit = fid.identify(fid.InnovationsModel.subspace("u", "y", 2, offsets="none"), record)
    found = fid.interpret(fit)
    (mode,) = found.resonances
    low, high = mode.root.natural_frequency.interval95
    assert low < SINGLE.modes()[0].natural_frequency_rad_s < high
    assert repr(found) in found.summary().to_text()
    assert json.loads(json.dumps(found.to_dict()))["roots"]
    assert "<table" in found._repr_html_()
    assert len(pole_zero(fit).data) >= 5
    bare = fid.interpret(fit.model)
    assert bare.resonances[0].root.natural_frequency.interval95 is None
    assert repr(bare.resonances[0]).startswith("InterpretedRoot(pole of all responses at 0.8")


def test_lags_integrators_growth_and_cancellation_are_named():
    found = fid.interpret(from_roots("y", "u", [1.0, 0.3, 0.9, 1.05, 0.0], [0.91, 1.3, 0.2, -0.2]))
    words = " | ".join(item.character for item in found.roots)
    assert "integrator" in words
    assert "fast real pole" in words
    assert "unstable slow real pole" in words
    assert "near-cancellation" in codes(found)
    lag = fid.interpret(from_roots("y", "u", [np.exp(-0.5)], []))
    assert_close(lag.roots[0].time_constant.value, 0.2, rtol=1e-12, why="exp(-T/tau)")
    grows = fid.interpret(from_roots("y", "u", [1.0 + 0.3j, 1.0 - 0.3j], []))
    assert grows.roots[0].character == "unstable oscillation"


def test_time_constants_turn_intervals_over():
    truth = P(("u",), "y", 0.1, a=[1, -0.8], b=[[1.0]])
    drawn = np.random.default_rng(1)
    u, e = drawn.standard_normal((2, 400))
    record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u}, outputs={"y": e})
    record = record.replace({"y": truth.simulate(record) + 0.1 * e})
    fit = fid.identify(P.oe("u", "y", nb=1, nf=1), record)
    tau = fid.interpret(fit).roots[0].time_constant
    omega = fit.details.modes[0].natural_frequency
    assert_close(tau.interval95, [1 / omega.interval95[1], 1 / omega.interval95[0]], rtol=1e-12,
                 why="monotone")  # fmt: skip


def test_other_models_are_refused():
    with pytest.raises(ModelError, match="only discrete black-box models"):
        fid.interpret(fid.load_model("short_period"))
