"""Orders that are too high for errors: the simpler structure that stands in for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.conventions import Light
from flightid.identification.prediction_error.findings import CANCELS
from flightid.identification.simpler_structure import simpler_fit
from tests.closeness import assert_close
from tests.strangers.noises import Array

STEP_S = 0.1
POLE, GAIN = 0.7, 1.0
P = fid.PolynomialModel
TRUE = P.oe("u", "y", nb=1, nf=1)
RICH = {
    "oe": P.oe("u", "y", nb=2, nf=2),
    "bj": P.bj("u", "y", nb=2, nf=2, nc=0, nd=1),
    "armax": P.armax("u", "y", na=2, nb=2, nc=2),
    "subspace": fid.InnovationsModel.subspace("u", "y", order=2),
}


def _record(seed: int, *, colour: float = 0.0, noise: float = 0.05) -> fid.Record:
    """A lag in SciPy's recursion: y = 0.7 y(t-1) + 0.3 u(t-1), and noise of the sensor."""
    random, n = np.random.default_rng(seed), 1500
    u = np.repeat(random.choice([-1.0, 1.0], n // 5), 5)
    y: Array = lfilter([0.0, GAIN * (1.0 - POLE)], [1.0, -POLE], u)
    hiss = lfilter([1.0], [1.0, -colour], random.standard_normal(n))
    return fid.Record.from_arrays(
        STEP_S * np.arange(n),
        inputs={"u": u},
        outputs={"y": y + noise * y.std() * hiss},
        hold="zero",
    )


def _bare(kind: str) -> tuple[fid.Fit, fid.Record]:
    """The first record whose fit with one pole too many has no errors."""
    for seed in range(20):
        record = _record(seed, colour=0.9 if kind == "bj" else 0.0)
        fit = fid.identify(RICH[kind], record, loop="open")
        if fit.carried is None:
            return fit, record
    raise AssertionError


@pytest.mark.parametrize("kind", [*RICH])
def test_a_spare_pole_is_left_out(kind: str) -> None:
    """What is left knows its errors, and they hold the vehicle's pole and gain."""
    rich, _ = _bare(kind)
    simpler = simpler_fit(rich)
    assert simpler is not None
    assert rich.withheld in simpler.reason
    (pole,) = (root.z for root in simpler.fit.details.roots if root.kind == "pole")
    gain = simpler.fit.details.gains["y/u"]
    assert_close(pole.real, POLE, atol=0.02, why="4 standard errors of 0.004 with colour")
    assert abs(gain.value - GAIN) < 4.0 * gain.stderr
    assert simpler.fit.provenance["told"] == rich.provenance["told"]
    assert simpler_fit(simpler.fit) is None


def test_nothing_is_left_out_of_a_fit_that_lacks_dynamics() -> None:
    """A lag alone cannot stand for two: neither for its fit nor for one without errors."""
    record = _record(3)
    second = lfilter([0.2], [1.0, -0.8], record["y"])
    record = record.replace({"y": second})
    poor = fid.identify(P.armax("u", "y", na=1, nb=1, nc=1), record, loop="open")
    assert poor.carried is None
    assert simpler_fit(poor) is None


def test_numbers_taken_for_exact_carry_nothing_on() -> None:
    """A pole cancels and the noise model keeps its errors: no margin rests on them alone."""
    fits = [fid.identify(RICH["bj"], _record(k, colour=0.9), loop="open") for k in (4, 8)]
    assert all(fit.names == ("d1",) and fit.covariance is not None for fit in fits)
    assert [fit.withheld for fit in fits] == [CANCELS, CANCELS]
    assert not any(fit.uncertain().known for fit in fits)


def test_gains_rest_on_the_simpler_structure_and_say_so() -> None:
    fit, record = _bare("oe")
    design = fid.tune_controller(fit, draws=40, controller=fid.ControllerOptions(controller="pi"))
    (said,) = (each for each in design.findings if each.code == "simpler-structure")
    assert said.light is Light.AMBER
    assert "OE with nb 1, nf 1, nk 1 in place of nb 2, nf 2, nk 1" in said.message
    known = fid.tune_controller(
        fid.identify(TRUE, record, loop="open"),
        draws=40,
        controller=fid.ControllerOptions(controller="pi"),
    )
    assert design.gains == known.gains
    bare = fid.tune_controller(fit, draws=40, nominal=True)
    assert [each.code for each in bare.findings if each.light is Light.AMBER][
        -1
    ] == "no-uncertainty"
