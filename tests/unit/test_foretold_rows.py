"""Fits of equations and of harmonics have no bars where inputs foretell what they leave."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.identification.methods import METHODS
from flightid.uncertainty.fitted_correlation import chance_of_lags
from flightid.uncertainty.foretold_harmonics import FittedHarmonics, HarmonicResponse
from tests.strangers import noises
from tests.strangers.output_error import COLOURS, flight, late, model

FOLLOWED = {"output_error", "filter_error"}
"""Which say themselves what inputs foretell; see their own tests."""
ASKED = {
    "fourier_output_error": ({}, {"band_rad_s": (0.0, 12.0)}),
    "fourier_regression": ({}, {"band_rad_s": (0.0, 12.0)}),
    "equation_error": ({},),
}
CASES = [(method, options) for method, every in ASKED.items() for options in every]
ROWS = 60


def test_every_method_of_equations_asks() -> None:
    found = {each.name for each in METHODS if fid.StateSpaceModel in each.kinds}
    # Responses are asked by their costs, joint fits as output error is.
    assert found - {"frequency_domain", "joint"} == FOLLOWED | set(ASKED)


@pytest.mark.parametrize(("method", "options"), CASES)
def test_a_missing_lag_has_no_bars_and_says_why(method: str, options: dict) -> None:
    fit = fid.identify(model(), late(0, 0.04, 0.02, noises.white), method=method, **options)
    (said,) = [each for each in fit.findings if each.code == "inputs-in-errors"]
    assert "dynamics are missing" in said.message
    assert fit.covariance is None
    assert fit.parameters["Lp"].reason == said.message
    assert str(fit.evidence.light) != "green"


@pytest.mark.parametrize("colour", ["white", "AR(1) 0.9"])
@pytest.mark.parametrize(("method", "options"), CASES)
def test_a_true_model_keeps_its_bars(method: str, options: dict, colour: str) -> None:
    record = flight(1, COLOURS[colour])
    # Equations are biased by noise on their states, which inputs do foretell: little is there.
    quiet = (
        record.replace({"p": fly_quietly(record)}) if method != "fourier_output_error" else record
    )
    fit = fid.identify(model(), quiet, method=method, **options)
    assert fit.covariance is not None
    assert fit.input_correlations


def fly_quietly(record: fid.Record) -> np.ndarray:
    """The same output with a tenth of its noise."""
    clean = flight(1, lambda _, n: np.zeros(n))["p"]
    return clean + 0.1 * (record["p"] - clean)


def test_the_form_of_harmonics_is_fishers_in_white_noise() -> None:
    random = np.random.default_rng(3)
    chances = []
    for _ in range(300):
        residual = random.standard_normal((1, ROWS))
        record = FittedHarmonics(
            residual,
            np.ones((1, ROWS)),
            np.zeros((1, ROWS, 0)),
            np.zeros((1, ROWS, 0)),
            random.standard_normal((1, 5, ROWS)),
            np.arange(1.0, ROWS / 2 + 1),
        )
        (found,) = HarmonicResponse([record], np.arange(5)).correlations()
        chances.append(found.p_value)
    # 15 of 300 by chance, within 3.3 standard deviations; fewer by Bonferroni's rule.
    assert 3 <= np.sum(np.array(chances) < 0.05) <= 28


def test_an_estimated_level_makes_chances_larger() -> None:
    raw, covariance = np.array([3.0, 0.0]), np.eye(2)
    known = chance_of_lags(raw, covariance, np.ones(2))
    doubted = chance_of_lags(raw, covariance, np.ones(2), 5.0)
    assert known is not None
    assert doubted is not None
    assert known[:2] == doubted[:2]
    assert doubted[2] > known[2]
