"""The one estimate that is shown: what is drawn, and what bars, coherence and bands belong to."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.responses.bands import COHERENT, allowed_coherence, coherent_parts, usable_band
from flightid.responses.corrected import CorrectedResponse, corrected
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.errors.random_error import CovarianceSource

Real = NDArray[np.float64]
WITHOUT_BIAS = "without leakage"
LOST = 0.2
"""Share of the octaves of a band that were leakage, from which that is said."""


@dataclass(frozen=True, eq=False)
class ErrorsByInput:
    """Errors of a response to each input by itself; what inputs share is not known.

    Attributes
    ----------
    matrices : ndarray, shape (n_out, n_in, 2 n_f, 2 n_f)
        Real parts, then imaginary parts.
    """

    matrices: Real

    def covariance(
        self, outputs: NDArray[np.intp], inputs: NDArray[np.intp], frequencies: NDArray[np.intp]
    ) -> Real:
        """See `CovarianceSource`."""
        half, n_in, n_f = self.matrices.shape[-1] // 2, len(inputs), len(frequencies)
        found = np.zeros((len(outputs), 2, n_in, n_f, 2, n_in, n_f))
        rows = np.add.outer((0, half), frequencies)
        for place, column in enumerate(inputs):
            known = self.matrices[outputs, column][:, rows[:, :, None, None], rows]
            found[:, :, place, :, :, place] = known
        return found.reshape(len(outputs), 2 * n_in * n_f, -1)


class MeasuredEstimate(Protocol):
    """What of a measured response is asked here."""

    @property
    def omega_rad_s(self) -> Real:
        """Frequencies, rad/s."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names."""

    @property
    def response(self) -> NDArray[np.complex128]:
        """By output, input and frequency."""

    @property
    def coherence(self) -> Real:
        """By output, input and frequency."""

    @property
    def random_error(self) -> Real:
        """By output, input and frequency."""

    @property
    def estimator(self) -> str:
        """How it was estimated."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What to know."""

    @property
    def errors(self) -> CovarianceSource | None:
        """How its errors hang together."""

    @property
    def linear(self) -> LinearEstimate | None:
        """Weights on the measured outputs."""


def shown_values(response: MeasuredEstimate) -> dict[str, Any]:
    """Fields in which the estimate that is shown differs from what windows gave, by name.

    Where a pilot foretells the leakage it is taken out. Where none can be had the
    values stay and are coherent nowhere: nobody knows what of them is leakage.

    Parameters
    ----------
    response : MeasuredEstimate
        A `FrequencyResponse`.

    Returns
    -------
    dict of str to object
        Coherence alone, or none, where the estimate has no windows that leak, or where its records
        are gone.
    """
    linear, errors = response.linear, response.errors
    if linear is None or errors is None or not linear.weights.tells_parts:
        least = np.minimum(response.coherence, allowed_coherence(response.random_error))
        return {} if np.array_equal(least, response.coherence) else {"coherence": least}
    values, relative = np.array(response.response), np.array(response.random_error)
    coherence, n_f = np.zeros_like(relative), len(response.omega_rad_s)
    matrices = np.zeros((*relative.shape[:2], 2 * n_f, 2 * n_f))
    unknown: list[str] = []
    columns = np.arange(len(response.inputs))
    for rows, found in _by_outputs(linear, response.omega_rad_s):
        if found is None:
            unknown += [f"{response.outputs[k]}/{name}" for k in rows for name in response.inputs]
            for column in columns:
                places = rows, columns[column : column + 1], np.arange(n_f)
                matrices[rows, column] = errors.covariance(*places)
            continue
        values[rows], relative[rows] = found.values, found.relative
        coherence[rows] = found.coherence(response.coherence[rows])
        matrices[rows] = found.errors.swapaxes(0, 1)
    return {
        "response": values,
        "random_error": relative,
        "coherence": coherence,
        "errors": ErrorsByInput(matrices),
        "linear": None,
        "estimator": f"{response.estimator}, {WITHOUT_BIAS}",
        "findings": (*response.findings, *_lost(response, coherence, unknown)),
    }


def _by_outputs(
    linear: LinearEstimate, omega_rad_s: Real
) -> list[tuple[NDArray[np.intp], CorrectedResponse | None]]:
    """Rows of outputs and what they are without leakage, or None."""
    whole = corrected(linear, omega_rad_s, by_input=True)
    rows, columns, points = (np.arange(len(each)) for each in linear.places)
    if whole is not None or len(rows) == 1:
        return [(rows, whole)]
    found: list[tuple[NDArray[np.intp], CorrectedResponse | None]] = []
    for row in rows[:, None]:  # what one output lacks, others may have
        part = linear.select(row, columns, points)
        own = None if part is None else corrected(part, omega_rad_s, by_input=True)
        found.append((row, own))
    return found


def _lost(response: MeasuredEstimate, coherence: Real, unknown: list[str]) -> list[Finding]:
    """What much of the windows' coherence was, where it was leakage or may be."""
    omega, words = response.omega_rad_s, []
    for row, output in enumerate(response.outputs):
        for column, source in enumerate(response.inputs):
            before, after = response.coherence[row, column], coherence[row, column]
            band = usable_band(omega, before)
            if band is None or f"{output}/{source}" in unknown:
                continue
            gone = np.where(after < COHERENT, before, 0.0)
            inside = (omega >= band[0]) & (omega <= band[1])
            if np.mean(gone[inside] >= COHERENT) >= LOST:
                parts = [part for part in coherent_parts(omega, gone) if part[1] > part[0]]
                spans = ", ".join(f"{low:.3g} to {high:.3g} rad/s" for low, high in parts)
                words.append(f"{output}/{source} {spans or 'at single frequencies'}")
    found = []
    if words:
        text = "coherent by leakage of the records' ends alone, which tells nothing of the vehicle"
        action = (
            "keep the whole manoeuvre, from rest to rest, and let a sweep fade out; or use the "
            "usable band alone"
        )
        found.append(Finding("leakage", Light.AMBER, f"{text}: {'; '.join(words)}", action))
    if unknown:
        text = "the records hold too few samples to tell a response from the leakage of their ends"
        action = "use longer records, from rest to rest"
        found.append(
            Finding("leakage-unknown", Light.AMBER, f"{text}: {', '.join(unknown)}", action)
        )
    return found
