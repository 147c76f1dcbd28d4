"""Verdicts on poles and zeros that lie together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import flightid as fid
from flightid.identification.prediction_error.findings import cancelling
from flightid.identification.prediction_error.roots import FittedRoot


def test_rounding_below_a_variance_of_zero_is_no_error() -> None:
    structure = fid.PolynomialModel.oe("u", "y", nb=2, nf=1)
    random = np.random.default_rng(0)
    record = fid.Record.from_arrays(
        0.1 * np.arange(200),
        inputs={"u": random.standard_normal(200)},
        outputs={"y": random.standard_normal(200)},
    )
    fitted = fid.identify(structure, record, loop="open")
    model = replace(fitted.model, covariance=-1e-20 * np.eye(3))
    slope = np.array([0.0, 0.0, 1.0 + 0.0j])
    pair = [
        FittedRoot("y/u", kind, z + 0j, None, None, None, gradient=turn * slope)
        for kind, z, turn in (("pole", 0.5, 1.0), ("zero", 0.5, 0.5))
    ]
    assert [root for found in cancelling(model, pair) for root in found[:2]] == pair
