"""Several loops opened at once: bare responses behind a known controller, with their errors.

With y = H u and u = r + F y + V r, the measured T = y/r gives H = T (1 + V + F T)⁻¹.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ShapeError, SingularError
from flightid.frozen import dataclass
from flightid.responses.errors.random_error import (
    CovarianceSource,
    JointErrors,
    Points,
    combined,
)
from flightid.responses.response import FrequencyResponse

Complex = NDArray[np.complex128]
SINGULAR = 1e-9
"""Reciprocal condition number below which what enters the vehicle cannot be told."""


@dataclass(frozen=True)
class OpenedErrors(JointErrors):
    """Errors of H: δH = L δT R at each frequency.

    Attributes
    ----------
    errors : CovarianceSource
        Of T.
    left : ndarray of complex, shape (n_f, n_out, n_out)
    right : ndarray of complex, shape (n_f, n_in, n_in)
    """

    errors: CovarianceSource
    left: Complex
    right: Complex

    def covariances(self, wanted: Sequence[Points]) -> list[NDArray[np.float64]]:
        """See `JointErrors`."""
        found = []
        for each in wanted:
            size = 2 * len(each.inputs) * len(each.frequencies)
            found.append(self.combined([each], [np.eye(size)]))
        return found

    def combined(
        self, wanted: Sequence[Points], gains: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """See `JointErrors`."""
        n_out, n_in = self.left.shape[1], self.right.shape[1]
        everything = np.arange(n_in, dtype=np.intp)
        frequencies = np.unique(np.concatenate([each.frequencies for each in wanted]))
        points = [Points(output, everything, frequencies) for output in range(n_out)]
        total = [np.zeros((len(gains[0]), 2 * n_in * len(frequencies))) for _ in points]
        for each, gain in zip(wanted, gains, strict=True):
            for output in range(n_out):
                total[output] += gain @ self._slope(each, output, frequencies)
        return combined(self.errors, points, total)

    def _slope(
        self, wanted: Points, output: int, frequencies: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """Derivative of the wanted points by real and imaginary parts of one output of T."""
        n_in, n_f, n_w = self.right.shape[1], len(frequencies), len(wanted.frequencies)
        slope = np.zeros((len(wanted.inputs), n_w, n_in, n_f), dtype=np.complex128)
        places = np.searchsorted(frequencies, wanted.frequencies)
        for k, (frequency, place) in enumerate(zip(wanted.frequencies, places, strict=True)):
            share = self.left[frequency, wanted.output, output]
            slope[:, k, :, place] = share * self.right[frequency][:, wanted.inputs].T
        flat = slope.reshape(len(wanted.inputs) * n_w, n_in * n_f)
        return np.block([[flat.real, -flat.imag], [flat.imag, flat.real]])


def open_loops(
    response: FrequencyResponse, feedback: Complex, forward: Complex | None = None
) -> FrequencyResponse:
    """Take a known controller out of measured closed-loop responses.

    Parameters
    ----------
    response : FrequencyResponse
        T, from the inputs before the controller adds to them to what it reads and more.
    feedback : ndarray of complex, shape (n_in, n_out, n_f)
        F: what the controller adds to the inputs for each output.
    forward : ndarray of complex, shape (n_in, n_in, n_f), optional
        V: what it adds for each input before it.

    Returns
    -------
    FrequencyResponse
        H, with the errors carried to first order and coherences as they were.

    Raises
    ------
    ShapeError
        The controller does not fit the response.
    SingularError
        At some frequency the loops leave no trace of the vehicle.

    Assumes
    -------
    A controller known without error. Biased when something else moves the inputs: a gust that the
    controller feeds back is seen as the vehicle's unless T was estimated with the sticks as inputs.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.4: indirect identification.
    """
    n_out, n_in, n_f = response.response.shape
    ahead = np.zeros((n_in, n_in, n_f), dtype=np.complex128) if forward is None else forward
    for name, given, needed in (
        ("feedback", feedback, (n_in, n_out, n_f)),
        ("forward", ahead, (n_in, n_in, n_f)),
    ):
        if np.shape(given) != needed:
            raise ShapeError(f"{name} does not fit", found=np.shape(given), needed=needed)
    t, f, v = (
        np.moveaxis(np.asarray(each), -1, 0) for each in (response.response, feedback, ahead)
    )
    around = np.eye(n_in) + v + f @ t
    worst = int(np.argmin(1.0 / np.linalg.cond(around)))
    if 1.0 / np.linalg.cond(around[worst]) < SINGULAR:
        raise SingularError(
            "the controller takes out all that enters the vehicle",
            found=f"at {response.omega_rad_s[worst]:g} rad/s",
            needed="a response where the inputs do something",
        )
    right: Complex = np.asarray(np.linalg.inv(around), dtype=np.complex128)
    opened = t @ right
    left: Complex = np.asarray(np.eye(n_out) - opened @ f, dtype=np.complex128)
    noise = np.moveaxis((np.abs(response.response) * response.random_error) ** 2, -1, 0)
    spread = np.sqrt(np.abs(left) ** 2 @ noise @ np.abs(right) ** 2)
    size = np.abs(opened)
    relative = np.divide(spread, size, out=np.zeros_like(spread), where=size > 0.0)
    errors = None if response.errors is None else OpenedErrors(response.errors, left, right)
    return replace(
        response,
        response=np.moveaxis(opened, 0, -1),
        random_error=np.moveaxis(relative, 0, -1),
        input_spectrum=None,
        cross_spectrum=None,
        output_spectrum=None,
        errors=errors,
        linear=None,
        estimator=f"{response.estimator.removesuffix(', loops opened')}, loops opened",
    )
