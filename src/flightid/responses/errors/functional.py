"""What an estimate does with changes of the outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Functional = Callable[[Sequence[NDArray[np.float64]]], NDArray[np.complex128]]
"""From changes of the outputs, one array (n_out, n_samples) for each record, to the change of the
response, shape (n_out, n_in, n_f); many changes at once stand along a further axis ahead."""


def one_by_one(apply: Functional) -> Functional:
    """A functional of single changes as one that takes many at once."""

    def applied(changes: Sequence[NDArray[np.float64]]) -> NDArray[np.complex128]:
        if changes[0].ndim == 2:
            return apply(changes)
        return np.stack([apply(one) for one in zip(*changes, strict=True)])

    return applied
