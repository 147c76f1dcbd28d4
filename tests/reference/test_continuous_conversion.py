"""Conversion between discrete and continuous models against scipy and python-control."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.signal import cont2discrete

import flightid as fid
from flightid.errors import DataError, ModelError, OptionError
from tests.closeness import assert_close

HOLDS = {"zero": "zoh", "first": "foh", "tustin": "bilinear"}
A = np.array([[-1.0, 4.0, 0.0], [-4.0, -1.0, 0.5], [0.0, 0.0, -3.0]])
_DRAWN = np.random.default_rng(0)
B, C = _DRAWN.standard_normal((3, 2)), _DRAWN.standard_normal((2, 3))
D = 0.1 * _DRAWN.standard_normal((2, 2))
CHANNELS = ("u", "v"), ("y", "z")


def response(system, omega):
    a, b, c, d, delays = system.state_space()
    s = 1j * omega[:, None, None]
    return (c @ np.linalg.solve(s * np.eye(len(a)) - a, b + 0j) + d) * np.exp(-s * delays)


@pytest.mark.parametrize("hold", HOLDS)
def test_scipy_makes_the_same_discrete_model(hold):
    made = fid.to_discrete(fid.LinearSystem(A, B, C, D, *CHANNELS), 0.1, hold)
    peer = cont2discrete((A, B, C, D), 0.1, HOLDS[hold])[:4]
    for ours, theirs in zip(made.matrices, peer, strict=False):
        assert_close(ours, theirs, atol=1e-13, why="the same integrals")


@pytest.mark.parametrize("hold", HOLDS)
def test_python_control_makes_the_same_response(hold):
    made = fid.to_discrete(fid.LinearSystem(A, B, C, D, *CHANNELS), 0.1, hold)
    omega = np.array([0.3, 2.0, 9.0])
    peer = control.sample_system(control.ss(A, B, C, D), 0.1, method=HOLDS[hold])
    assert_close(
        made.frequency_response(omega), peer(np.exp(0.1j * omega)), rtol=1e-10, why="one system"
    )


@pytest.mark.parametrize("hold", HOLDS)
def test_there_and_back_with_delays(hold):
    system = fid.LinearSystem(A, B, C, D, *CHANNELS, [0.2, 0.0])
    back = fid.to_continuous(fid.to_discrete(system, 0.1, hold), hold)
    omega = np.array([0.3, 2.0, 9.0])
    assert np.asarray(back.a).shape == (3, 3)
    assert_close(back.delays_s, [0.2, 0.0], atol=1e-12, why="poles at the origin are delays")
    assert_close(response(back, omega), response(system, omega), rtol=1e-9, why="one system")


def test_polynomial_models_keep_their_delay():
    model = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], nk=(4,))
    made = fid.to_continuous(model)
    assert_close(made.delays_s, [0.3], rtol=1e-12, why="the hold accounts for one sample")
    assert_close(
        np.sort_complex(np.exp(0.1 * np.linalg.eigvals(made.a))),
        np.sort_complex(model.poles()["y/u"]),
        rtol=1e-9,
        why="s = ln z / T",
    )
    omega = np.array([0.5, 3.0])
    again = fid.to_discrete(made, 0.1)
    assert_close(
        again.frequency_response(omega), model.frequency_response(omega), rtol=1e-9, why="back"
    )


def test_published_model_has_no_continuous_counterpart():
    printed = fid.PolynomialModel(
        ("u1",), "y1", 0.1, a=[1, -2.372, 1.465, 0.2673, -0.351],
        b=[[-0.0007, 0.007, 0.0001, 0.006]],
    )  # fmt: skip
    with pytest.raises(ModelError, match=r"no real continuous counterpart: found z = -0\.4192"):
        fid.to_continuous(printed)
    bilinear = fid.to_continuous(printed, "tustin")
    assert np.max(np.linalg.eigvals(bilinear.a).real) < 0.0


def test_what_cannot_be_converted_is_refused():
    fir = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5, 0.2, 0.1]])
    with pytest.raises(ModelError, match="not a delay of an input"):
        fid.to_continuous(fir)
    with pytest.raises(OptionError, match="unknown hold"):
        fid.to_continuous(fir, "cubic")
    edge = fid.InnovationsModel(("u",), ("y",), 0.1, [[-1.0]], [[1.0]], [[1.0]])
    with pytest.raises(ModelError, match="pole at -1"):
        fid.to_continuous(edge, "tustin")
    system = fid.LinearSystem(A, B, C, D, *CHANNELS, [0.25, 0.0])
    with pytest.raises(DataError, match="part of a sample"):
        fid.to_discrete(system, 0.1, "tustin")
    assert fid.to_discrete(system, 0.1).order == system.order + 3
    with pytest.raises(DataError, match="sample time is not positive"):
        fid.to_discrete(system, 0.0)
