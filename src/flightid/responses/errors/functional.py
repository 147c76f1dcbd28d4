"""What an estimate does with changes of the outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Functional = Callable[[Sequence[NDArray[np.float64]]], NDArray[np.complex128]]
"""From changes of the outputs, one array (n_out, n_samples) for each record, to the change of the
response, shape (n_out, n_in, n_f)."""
