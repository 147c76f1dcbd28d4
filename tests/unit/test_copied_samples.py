"""One flight given twice counts once: every method says so, and shows no bars."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.evidence.copied_samples import COPIED, judge_copies
from tests.strangers import noises
from tests.strangers.output_error import flight, model

METHODS = (
    "output_error",
    "equation_error",
    "fourier_regression",
    "fourier_output_error",
    "filter_error",
)


def _flown(seed: int = 1) -> fid.Record:
    return flight(seed, noises.white, duration_s=10.0)


def _said(fit: fid.Fit) -> None:
    (told,) = [each for each in fit.evidence.checks if "count twice" in each.what]
    assert str(told.light) == "red"
    assert str(fit.evidence.light) == "red"
    assert fit.covariance is None
    free = [each for each in fit.parameters.values() if each.status == "free"]
    assert all("count twice" in (each.reason or "") for each in free)
    assert "inputs-in-errors" not in [each.code for each in fit.findings]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_of_equations_says_that_a_record_is_given_twice(method: str) -> None:
    record = _flown()
    _said(fid.identify(model(), [record, record], method=method))


@pytest.mark.parametrize("structure", ["arx", "oe"])
def test_black_boxes_say_it_too(structure: str) -> None:
    record, orders = _flown(), {"arx": {"na": 1, "nb": 1}, "oe": {"nb": 1, "nf": 1}}
    make = getattr(fid.PolynomialModel, structure)
    _said(fid.identify(make("da", "p", **orders[structure]), [record, record], loop="open"))


@pytest.mark.parametrize("estimator", ["composite", "local_polynomial"])
def test_so_do_fits_of_their_responses(estimator: str) -> None:
    record = _flown()
    data = fid.estimate_response(
        [record, record], band_rad_s=(1.0, 12.0), estimator=estimator, loop="open"
    )
    _said(fid.identify(model(), data))


def test_cuts_that_overlap_are_copies_in_part() -> None:
    record = _flown()
    (said,) = judge_copies([record.segment(0.0, 6.0), record.segment(4.0, 10.0)], ["p"])
    assert said.code == COPIED
    assert "records 1 and 2 hold the same 10" in said.message


def test_flights_that_are_others_are_not() -> None:
    record = _flown()
    cuts = [record.segment(0.0, 4.99), record.segment(5.0, 10.0)]
    assert not judge_copies([*cuts, _flown(2), _flown(3)], ["p"])


def test_rest_is_no_copy() -> None:
    time_s = np.arange(400) * 0.02
    still = np.round(np.where(time_s > 4.0, np.sin(3.0 * time_s**2), 0.0), 1)
    other = np.round(np.where(time_s > 4.0, np.cos(5.0 * time_s), 0.0), 1)
    records = [
        fid.Record.from_arrays(time_s, outputs={"p": row}, units={"p": "rad/s"})
        for row in (still, other)
    ]
    assert not judge_copies(records, ["p"])


def test_records_behind_a_response_lose_their_line_and_are_known() -> None:
    record = _flown()
    whole = fid.estimate_response(record, band_rad_s=(1.0, 12.0), loop="open")
    (said,) = judge_copies([whole, record.segment(2.0, 8.0)], ["p"])
    assert "records 1 and 2 hold the same 3" in said.message
