"""Arrays reach the native half row by row, whatever order they have in memory."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flightid import _native

FACE = Path(__file__).parents[2] / "crates" / "python" / "src"


def _with_gaps(array: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.repeat(array, 2, axis=-1)[..., ::2]


@pytest.mark.parametrize("kept", [np.asfortranarray, _with_gaps])
def test_the_order_in_memory_changes_no_answer(
    kept: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> None:
    random = np.random.default_rng(0)
    a, b = -np.eye(3) + 0.3 * random.standard_normal((3, 3)), random.standard_normal((3, 2))
    c, d = random.standard_normal((2, 3)), random.standard_normal((2, 2))
    arrays = (a, b, c, d, np.zeros(2), random.standard_normal((2, 40)), np.ones(3))
    expected = _native.simulate_linear(*arrays, 0.1, False)
    found = _native.simulate_linear(*map(kept, arrays), 0.1, False)
    assert not any(kept(each).flags.c_contiguous for each in arrays[:4])
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_every_face_takes_arrays_through_the_one_that_orders_them() -> None:
    found = [p.name for p in FACE.rglob("*.rs") if "PyReadonlyArray" in p.read_text("utf-8")]
    assert found == ["row_major.rs"]
