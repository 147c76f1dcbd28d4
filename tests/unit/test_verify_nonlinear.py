"""Verification of nonlinear models: their equations are integrated, shifts are solved for."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError
from tests.closeness import assert_close
from tests.truth.test_equation_records_truth import flown, longitudinal, stepped


def test_the_equations_are_integrated_not_their_linearisation() -> None:
    model = longitudinal()
    record = flown(model, stepped(), 0.0, 0)
    result = fid.verify(model, record, state_bias=False, output_bias=False)
    assert max(result.theil.values()) < 1e-12
    predicted = result.predictions[0].predicted
    assert_close(predicted["az"], record["az"], rtol=1e-10, atol=1e-10, why="the same run")
    assert "verification-nonlinear" in {finding.code for finding in result.findings}


def test_initial_state_and_shifts_are_found() -> None:
    model = longitudinal()
    start = {"alpha": 0.05, "q": -0.1}
    clean = flown(model, stepped(), 0.0, 0, initial_state=start)
    moved = clean.replace({"elevator": clean["elevator"] - 0.01, "az": clean["az"] + 2.0})
    result = fid.verify(
        model, moved, initial_state="estimate", state_bias=True, outputs=["q", "az"]
    )
    shifts = result.predictions[0].shifts
    assert shifts.rank == shifts.n_free == 5
    assert shifts.input_bias is not None
    assert_close(shifts.input_bias, [0.01], rtol=1e-6, why="no noise")
    assert_close(shifts.output_bias, [0.0, 2.0], atol=1e-6, why="no noise")
    assert_close(shifts.initial_state, [0.05, -0.1], rtol=1e-6, why="no noise")
    assert max(result.theil.values()) < 1e-7
    # A linearised run cannot do that well.
    trimmed = fid.verify(model, moved, outputs=["q", "az"], state_bias=False)
    assert max(trimmed.theil.values()) > 0.01


def test_a_model_that_explodes_is_an_error() -> None:
    model = longitudinal().with_values({"Ma": 60.0, "Maa": 900.0})
    with pytest.raises(DataError, match=r"diverges|not finite"):
        fid.verify(model, flown(longitudinal(), stepped(), 0.0, 0))


def test_both_holds_are_run() -> None:
    model = longitudinal()
    record = flown(model, stepped(), 0.0, 0, hold="zero")
    right, wrong = (
        fid.verify(model, record, state_bias=False, hold=hold).theil["q"]
        for hold in ("zero", "first")
    )
    assert right < 1e-12
    assert wrong > 1e-4
    assert np.isfinite(wrong)
