"""Inputs that move at random from sample to sample: held, though told as straight lines."""

from __future__ import annotations

import pytest

import flightid as fid
from tests.strangers.holds import TRUTH, flight, model


@pytest.mark.parametrize(("shape", "doubted"), [("held", True), ("straight", False)])
def test_lines_are_doubted_where_steps_fit_alike(shape: str, *, doubted: bool) -> None:
    fit = fid.identify(model(), flight(2, shape, told="first"), method="output_error")
    said = [found for found in fit.findings if found.code == "hold-contradicted"]
    assert bool(said) is doubted
    assert (fit.evidence.light.value == "green") is not doubted
    low, high = fit.parameters["tau"].interval95
    assert low < TRUTH["tau"] < high
    assert all("steps fit alike" in found.message for found in said)
