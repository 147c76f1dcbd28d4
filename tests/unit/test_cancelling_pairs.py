"""Verdicts on poles and zeros that lie together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import flightid as fid
from flightid.identification.prediction_error.findings import cancelling
from flightid.identification.prediction_error.roots import FittedRoot
from tests.closeness import assert_close


def _fitted() -> fid.Fit:
    structure = fid.PolynomialModel.oe("u", "y", nb=2, nf=1)
    random = np.random.default_rng(0)
    record = fid.Record.from_arrays(
        0.1 * np.arange(200),
        inputs={"u": random.standard_normal(200)},
        outputs={"y": random.standard_normal(200)},
    )
    return fid.identify(structure, record, loop="open")


def _cancelling(variance: float) -> list[tuple[FittedRoot, FittedRoot, float]]:
    """Of a pole and a zero at a half, whose distance has a quarter of a parameter's variance."""
    model = replace(_fitted().model, covariance=variance * np.eye(3))
    slope = np.array([0.0, 0.0, 1.0 + 0.0j])
    pair = [
        FittedRoot("y/u", kind, 0.5 + 0j, None, None, None, gradient=turn * slope)
        for kind, turn in (("pole", 1.0), ("zero", 0.5))
    ]
    return cancelling(model, pair)


def test_rounding_below_a_variance_of_zero_is_no_error() -> None:
    ((pole, zero, _),) = _cancelling(-1e-20)
    assert (pole.kind, zero.kind) == ("pole", "zero")


def test_a_pair_that_may_lie_apart_cancels_nothing() -> None:
    """Up to the end of the gap's interval, over the pole's distance to the circle: a half."""
    ((_, _, seen),) = _cancelling((0.225 / 0.98) ** 2)
    assert_close(seen, 0.45, rtol=1e-3, why="1.96 deviations of 0.115 over a half")
    assert not _cancelling((0.3 / 0.98) ** 2)
