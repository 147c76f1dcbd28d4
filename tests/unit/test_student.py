"""Quantiles and chances of Student's distribution are those of SciPy."""

from __future__ import annotations

import numpy as np
import scipy.special

from flightid.uncertainty.student import normal_quantile, student_chance, student_quantile

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


def test_chances_are_those_of_scipy() -> None:
    for freedom in FREEDOMS:
        # Of many millions of degrees the fraction is one of numbers near one: nine digits are left.
        close = 1e-11 if freedom < 2e4 else 1e-8
        for size in (0.0, 0.3, 1.0, 2.0, 5.0, 30.0):
            known = 2.0 * scipy.special.stdtr(freedom, -size)
            np.testing.assert_allclose(student_chance(size, freedom), known, rtol=close)
