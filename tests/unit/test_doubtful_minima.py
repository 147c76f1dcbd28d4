"""Output error in slow noise: what is said of inputs, and bars about one of two equal minima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.identification.innovation_tests import NOISE_MODEL, InnovationTests
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.coefficient_covariance import (
    SearchResult,
    _fits_elsewhere,
)


@pytest.mark.parametrize(
    ("loss", "apart", "doubtful"),
    [(1.001, 44.0, True), (1.01, 44.0, False), (1.001, 2.0, False)],
)
def test_bars_hold_where_no_far_minimum_fits_as_well(
    loss: float, apart: float, *, doubtful: bool
) -> None:
    minima = (
        LocalMinimum(1.0, 1, {"f1": 0.0}, "cost"),
        LocalMinimum(loss, 1, {"f1": apart}, "cost"),
    )
    found = SearchResult(np.zeros(1), np.eye(1), 1200, minima, 1, [], 0)
    assert _fits_elsewhere(found) is doubtful
    assert not _fits_elsewhere(replace(found, covariance=None))


def test_missing_dynamics_are_not_claimed_of_slow_noise() -> None:
    (said,) = InnovationTests(0.5, 1e-9, 3.0, slow=14.6).findings(biased=False)
    assert said.action == NOISE_MODEL
    assert said.light is not Light.GREEN
    assert "cannot be told from noise" in said.message
    assert "biased" not in said.message
