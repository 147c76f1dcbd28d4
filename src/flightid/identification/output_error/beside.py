"""Data that are fitted together with records, as the native search takes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WhitenedResponses = tuple[
    Sequence[tuple[Array, NDArray[np.complex128], Array, Array]], Sequence[tuple[int, int, Array]]
]
"""Frequencies, response and two weights, not used, of each; first response, number and matrix."""
WrittenResiduals = tuple[Callable[[Array], Array], Callable[[Array], Array], int]
"""Residuals of unit variance by the free parameters, their Jacobian, and how many there are."""
