"""The one way tests compare numbers: tolerances are keyword-only and carry their reason."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def assert_close(
    actual: ArrayLike, expected: ArrayLike, *, why: str, rtol: float = 0.0, atol: float = 0.0
) -> None:
    """Assert closeness; at least one tolerance must be given, and none may swallow the value."""
    assert rtol > 0 or atol > 0, "name a tolerance"
    assert rtol <= 0.5, f"rtol={rtol} cannot fail"
    np.testing.assert_allclose(actual, expected, rtol=rtol, atol=atol, err_msg=why)
