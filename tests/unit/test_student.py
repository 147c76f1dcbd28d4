"""Quantiles and chances of Student's distribution are those of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.special

from flightid.uncertainty.student import (
    LARGE,
    _beyond_normal,
    _fraction,
    _gamma_ratio,
    normal_quantile,
    student_chance,
    student_quantile,
)

SHARES = (1e-9, 1e-4, 0.025, 0.3, 0.5, 0.6, 0.95, 0.975, 1.0 - 1e-7)
FREEDOMS = (0.4, 1.0, 2.0, 3.7, 10.0, 99.0, 199.0, 201.0, 9999.0, 10_001.0, 1e7)


def test_quantiles_are_those_of_scipy() -> None:
    for share in SHARES:
        np.testing.assert_allclose(
            normal_quantile(share), scipy.special.ndtri(share), rtol=1e-13, atol=1e-15
        )
        for freedom in FREEDOMS:
            known = scipy.special.stdtrit(freedom, share)
            found = student_quantile(share, freedom)
            np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-13)


def test_quantiles_far_out_and_at_the_middle() -> None:
    for share in (*10.0 ** -np.arange(12.0, 300.0, 9.0), 0.45, 0.499, 0.5 - 1e-9):
        np.testing.assert_allclose(
            normal_quantile(share), scipy.special.ndtri(share), rtol=1e-13, atol=1e-15
        )
    assert normal_quantile(0.5) == 0.0
    assert [student_quantile(0.5, freedom) for freedom in FREEDOMS] == [0.0] * len(FREEDOMS)


def test_the_expansion_about_the_normal_quantile_has_its_terms() -> None:
    """Three of them: what is left falls with the fourth power of the degrees of freedom."""
    for share in (0.6, 0.75, 0.9, 0.975):
        z = normal_quantile(share)
        errors = [
            abs(z + _beyond_normal(z, n) - scipy.special.stdtrit(n, share)) for n in (64.0, 128.0)
        ]
        # Abramowitz & Stegun 26.7.5: the next term.
        y = z * z
        g4 = z * (((79 * y + 776) * y + 1482) * y * y - 1920 * y - 945) / 92160
        assert errors == pytest.approx([abs(g4) / 64.0**4, abs(g4) / 128.0**4], rel=0.2, abs=1e-13)


def test_the_ratio_of_gamma_functions_goes_on_as_a_series() -> None:
    """Γ(a + 1/2) / Γ(a) times the next one is a; the series lacks its fifth term."""
    for half in (0.25, 1.0, 7.0, 99.4, 0.5 * LARGE, 101.0, 1e3, 1e5):
        lacks = 2.0 * 399.0 / 262144.0 / half**5 if half >= 0.5 * LARGE else 0.0
        product = _gamma_ratio(half) * _gamma_ratio(half + 0.5)
        assert product / half - 1.0 == pytest.approx(lacks, abs=1e-14 + 1e-13 * (half == 99.4))


def test_no_denominator_of_the_fraction_is_zero() -> None:
    # The first of these is 1 - (a + b) x / (a + 1) = 0: the fraction has a pole there.
    assert 1e299 < _fraction(1.0, 1.0, 1.0) < 1e301


def test_chances_are_those_of_scipy() -> None:
    for freedom in FREEDOMS:
        # Of many millions of degrees the fraction is one of numbers near one: nine digits are left.
        close = 1e-11 if freedom < 2e4 else 1e-8
        for size in (0.0, 0.3, 1.0, 2.0, 5.0, 30.0):
            known = 2.0 * scipy.special.stdtr(freedom, -size)
            np.testing.assert_allclose(student_chance(size, freedom), known, rtol=close)
