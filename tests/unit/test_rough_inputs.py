"""Inputs that move at random from sample to sample: held, though told as straight lines."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

import flightid as fid
from flightid.identification.rival_holds import OtherHold
from flightid.identification.told_hold import steps_told_otherwise
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


@pytest.mark.parametrize(("gain", "doubted"), [(-1.0, True), (-2.0, False)])
def test_steps_fit_alike_within_one_and_a_half_of_likelihood(gain: float, *, doubted: bool) -> None:
    rivals = SimpleNamespace(
        logged=False, made_by=lambda by: False, records=[flight(2, "held", told="first")],
        fit=SimpleNamespace(model=model()), assumed="first",
    )  # fmt: skip
    steps = OtherHold("zero", "tau", 3.0, gain)
    found = steps_told_otherwise(steps, cast(Any, rivals), "as the record says")
    assert (found is not None) is doubted
