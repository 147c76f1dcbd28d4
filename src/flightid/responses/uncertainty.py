"""How the errors of a response hang together: the protocol, and its selections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class CovarianceSource(Protocol):
    """What can say how the errors of a response hang together."""

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Covariance for each output, shape (n_out, 2 n_in n_f, 2 n_in n_f).

        Rows are real parts (inputs, and frequencies within an input) and then imaginary parts.
        """
        ...


@dataclass(frozen=True)
class Selected:
    """Errors of some outputs, inputs and frequencies of a response."""

    errors: CovarianceSource
    outputs: NDArray[np.intp]
    inputs: NDArray[np.intp]
    frequencies: NDArray[np.intp]

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        return self.errors.covariance(
            self.outputs[outputs], self.inputs[inputs], self.frequencies[frequencies]
        )


@dataclass(frozen=True)
class Known:
    """A covariance at all frequencies that was computed before (or read from a file).

    Attributes
    ----------
    matrix : ndarray, shape (n_out, 2 n_in n_f, 2 n_in n_f)
    n_frequencies : int
    """

    matrix: NDArray[np.float64]
    n_frequencies: int

    def covariance(
        self,
        outputs: NDArray[np.intp],
        inputs: NDArray[np.intp],
        frequencies: NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        half = self.matrix.shape[1] // 2
        real = np.add.outer(inputs * self.n_frequencies, frequencies).ravel()
        rows = np.concatenate([real, real + half])
        return np.asarray(self.matrix[np.ix_(outputs, rows, rows)])
