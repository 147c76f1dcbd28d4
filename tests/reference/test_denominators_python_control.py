"""Responses of models with a denominator in common, against python-control."""

from __future__ import annotations

import control
import numpy as np

import flightid as fid
from tests.closeness import assert_close


def test_python_control_has_the_same_response_poles_and_gains():
    below = [1.0, -1.5, 0.7]
    model = fid.PolynomialModel(
        ("u", "v"), "y", 0.1, b=[[1.0, 0.5], [-2.0, 1.0]], f=[below, below], nk=(1, 2),
        denominators="common",
    )  # fmt: skip
    omega = np.geomspace(0.1, 30.0, 20)
    for place, (name, above) in enumerate((("u", [1.0, 0.5, 0.0]), ("v", [-2.0, 1.0]))):
        peer = control.tf(above, [*below, 0.0], 0.1)
        assert_close(
            model.frequency_response(omega)[0, place], peer(np.exp(0.1j * omega)), rtol=1e-12,
            why="the same polynomials",
        )  # fmt: skip
        assert_close(model.gains()[f"y/{name}"], peer.dcgain().real, rtol=1e-12, why="at z = 1")
        poles = sorted(model.poles()[f"y/{name}"], key=np.imag)
        theirs = sorted(np.roots(below), key=np.imag)
        assert_close(poles, theirs, rtol=1e-12, why="the same polynomial")
