"""One response of a set: one output, one input, everything one-dimensional over frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses.bands import usable_band
from flightid.responses.injected_power import InjectedPower
from flightid.units import DIMENSIONLESS


@dataclass(frozen=True)
class PairResponse:
    """Response of one output to one input, everything one-dimensional over frequency.

    Attributes
    ----------
    output, input, unit : str
    omega_rad_s : ndarray, shape (n_f,)
    response : ndarray of complex, shape (n_f,)
    coherence, random_error : ndarray, shape (n_f,)
    injected : InjectedPower, optional
        How strongly each frequency was injected by way of the input; None where nobody knows.

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> response = fid.FrequencyResponse.from_values([1.0, 2.0], [1j, 0.1j], inputs=["u"],
    ...                                              outputs=["p"])
    >>> response.pair("p", "u").magnitude_db
    array([  0., -20.])
    """

    output: str
    input: str
    unit: str
    omega_rad_s: NDArray[np.float64]
    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    injected: InjectedPower | None = None

    @property
    def magnitude_db(self) -> NDArray[np.float64]:
        """Magnitude, dB."""
        return np.asarray(20.0 * np.log10(np.abs(self.response)))

    @property
    def phase_rad(self) -> NDArray[np.float64]:
        """Unwrapped phase, rad; negative is lag."""
        return np.unwrap(np.angle(self.response))

    def usable_band(self, minimum_coherence: float = 0.6) -> tuple[float, float] | None:
        """Widest unbroken band with at least this coherence, rad/s; None where there is none."""
        return usable_band(self.omega_rad_s, self.coherence, minimum_coherence)


def quotient_unit(output: str, under: str) -> str:
    """Unit of a response: that of the output over that of the input."""
    if under == DIMENSIONLESS:
        return output
    over = output if "/" not in output else f"({output})"
    return f"{over}/{under}" if "/" not in under else f"{over}/({under})"
