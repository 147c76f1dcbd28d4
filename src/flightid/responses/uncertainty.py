"""How the errors of a response hang together: the protocol, and its selections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class CovarianceSource(Protocol):
    """What can say how the errors of a response hang together."""

    def covariance(
        self, output: int, inputs: NDArray[np.intp], frequencies: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """Covariance of real parts (inputs, then frequencies within) and then imaginary parts."""
        ...


@dataclass(frozen=True)
class Selected:
    """Errors of some outputs, inputs and frequencies of a response."""

    errors: CovarianceSource
    outputs: NDArray[np.intp]
    inputs: NDArray[np.intp]
    frequencies: NDArray[np.intp]

    def covariance(
        self, output: int, inputs: NDArray[np.intp], frequencies: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """See `CovarianceSource`."""
        return self.errors.covariance(
            int(self.outputs[output]), self.inputs[inputs], self.frequencies[frequencies]
        )
