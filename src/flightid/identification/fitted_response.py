"""One measured response with the fitted model beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.responses import PairResponse


@dataclass(frozen=True)
class FittedResponse:
    """One measured response with the model beside it.

    Attributes
    ----------
    name : str
        ``"output/input"``.
    cost : float
        J of this response; guide: at most 100, and 150 to 200 for a single off-axis one.
    measured : PairResponse
        The whole measured response.
    omega_rad_s : ndarray, shape (n,)
        Frequencies that were fitted, rad/s.
    model : ndarray of complex, shape (n_f,)
        The fitted model at every measured frequency.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator")
    >>> data = fid.FrequencyResponse.from_values(omega, model.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fid.identify(model, data).responses[0].name
    'p/tau_phi'
    """

    name: str
    cost: float
    measured: PairResponse
    omega_rad_s: NDArray[np.float64]
    model: NDArray[np.complex128]

    @property
    def band_rad_s(self) -> tuple[float, float]:
        """Lowest and highest fitted frequency, rad/s."""
        return float(self.omega_rad_s[0]), float(self.omega_rad_s[-1])

    def to_dict(self) -> dict[str, object]:
        """Plain values without the curves."""
        low, high = self.band_rad_s
        return {
            "cost": self.cost,
            "band_rad_s": [low, high],
            "n_frequencies": len(self.omega_rad_s),
        }
