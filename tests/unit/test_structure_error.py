"""Plants moved by the error of a model: as far as it was, and real at zero frequency."""

from __future__ import annotations

import numpy as np

from flightid.control.tuning.structure_error import perturbed
from flightid.identification.model_error import ModelErrorBound
from tests.closeness import assert_close

SHOWN = ModelErrorBound(np.geomspace(1.0, 100.0, 41), np.full(41, 0.3))


def moved(omega: list[float], count: int = 60) -> np.ndarray:
    factors = perturbed({"p/u": SHOWN}, ["p"], ["u"], np.array(omega), count, turn=0.1)
    return factors[:, 0, 0] - 1.0


def test_in_the_band_plants_lie_on_the_circle_of_the_bound() -> None:
    found = moved([1.0, 10.0, 100.0])
    assert_close(np.abs(found[1:]), 0.3, rtol=1e-12, why="the bound in every direction")
    assert np.all(found[0] == 0.0), "the estimate stands first"
    assert np.ptp(np.angle(found[1:, 0])) > 6.0, "all the way round"


def test_below_the_band_errors_grow_to_a_half_and_turn_to_the_real_axis_as_a_lag_does() -> None:
    found = moved([1.0, 0.8, 0.1, 0.001])[1:]
    grown = found[:, :1] * [[1.0, 1.0 / 0.8, 0.5 / 0.3, 0.5 / 0.3]]
    assert_close(found.real, grown.real, rtol=1e-9, why="with the period, up to a half")
    turned = grown.imag * [1.0, 0.8, 0.1, 0.001]
    assert_close(found.imag, turned, rtol=1e-9, why="in proportion to frequency")
