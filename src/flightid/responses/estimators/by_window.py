"""A windowed estimate taken apart: what each of its window lengths alone makes of the outputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.errors.covariance import WindowedErrors
from flightid.responses.errors.linear_estimate import LinearEstimate, WindowedWeights
from flightid.responses.estimators.composite import Composite, combine

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
CYCLES = 4.0, 40.0
"""Of a frequency in the windows that tell narrow errors there: the half-power width of a Hann
window's transform is 1.44 over its length, so they resolve modes of damping ratios from .18 down
to .02. What is narrower still few flights of a minute excite."""
LONGEST = 3
"""Window lengths that are asked, from the longest on: a composite leans on the others anyway."""


@dataclass(frozen=True, eq=False)
class NarrowResidual:
    """What one window length alone makes of what the model leaves of an output.

    Attributes
    ----------
    window_s : float
    omega_rad_s : ndarray, shape (n,)
    error : ndarray of complex, shape (n,)
        Relative to the model.
    spread : ndarray, shape (n,)
        Its standard deviation as a complex number.
    """

    window_s: float
    omega_rad_s: Real
    error: Complex
    spread: Real


@dataclass(frozen=True, eq=False)
class WindowResidual:
    """What one window length makes of what a model leaves of the outputs.

    Attributes
    ----------
    window_s : float
    omega_rad_s : ndarray, shape (n_f,)
        Those of the estimate with as many cycles in the window as `CYCLES` has.
    response : ndarray of complex, shape (n_out, n_in, n_f)
    spread : ndarray, shape (n_out, n_in, n_f)
        Standard deviation of the response's magnitude as a complex number.
    """

    window_s: float
    omega_rad_s: Real
    response: Complex
    spread: Real

    def relative(self, row: int, column: int, model: Complex, omega_rad_s: Real) -> NarrowResidual:
        """Of one pair, over a model's response at all frequencies of the estimate."""
        beside = model[np.searchsorted(omega_rad_s, self.omega_rad_s)]
        return NarrowResidual(
            self.window_s,
            self.omega_rad_s,
            self.response[row, column] / beside,
            self.spread[row, column] / np.abs(beside),
        )


def residuals_by_window(
    linear: LinearEstimate,
    omega_rad_s: Real,
    residuals: Sequence[Real],
    band_rad_s: tuple[float, float],
    resonant_rad_s: float = 0.0,
) -> Iterator[WindowResidual]:
    """The estimate of what a model leaves, by each window length alone.

    A composite leans on its short windows, where they are less noisy: they smooth a narrow error
    of the model away, which the long ones still resolve.

    Parameters
    ----------
    linear : LinearEstimate
        Of the response that the model was fitted to.
    omega_rad_s : ndarray, shape (n_f,)
        Of the response.
    residuals : sequence of ndarray, each shape (n_out, n_samples)
        Measured less modelled outputs of each record.
    band_rad_s : tuple of float
        In which they are wanted.
    resonant_rad_s : float
        As for `LinearEstimate.errors_of`.

    Yields
    ------
    WindowResidual
        Nothing of an estimate without windows.
    """
    weights, (low, high) = linear.weights, band_rad_s
    if not isinstance(weights, WindowedWeights):
        return
    rows, columns, points = linear.places
    whole = weights.errors_of(residuals, rows, resonant_rad_s)
    if not isinstance(whole, WindowedErrors) or not isinstance(whole.composite, Composite):
        return
    parts = zip(whole.windows.shares, whole.composite.parts, strict=True)
    for share, part in islice(parts, LONGEST):
        window_s = share.plan.length * linear.sample_time_s
        cycles = omega_rad_s * window_s / (2.0 * np.pi)
        told = (cycles >= CYCLES[0]) & (cycles <= CYCLES[1])
        places = np.flatnonzero(told & (omega_rad_s >= low) & (omega_rad_s <= high))
        if not places.size:
            continue
        valid = np.ones((1, len(whole.windows.omega)), dtype=bool)
        windows = replace(whole.windows, shares=(share,))
        alone = replace(whole, windows=windows, composite=combine([part], valid))
        left = WindowedWeights(alone).functional(rows, columns, points[places])(residuals)
        each = [np.diag(c) for c in alone.covariance(rows, columns, points[places])]
        variances = np.array(each).reshape(len(rows), 2, len(columns), len(places)).sum(axis=1)
        yield WindowResidual(window_s, omega_rad_s[places], left, np.sqrt(variances))
