"""What a study of a simulated flight should find, and whether it did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import shown
from flightid.vehicles import Flight, RateTruth
from flightid.vehicles.truth import AXES, RATES

if TYPE_CHECKING:
    from flightid.models import GreyBoxModel

NAMES = {
    "damping_1_s": ("Lp", "Mq", "Nr"),
    "gain_rad_s2": ("Ltphi", "Mttheta", "Ntpsi"),
    "motor_lag_s": ("T_m",),
    "lead_s": ("T_r",),
}
"""Names that model files give to the truth's fields."""
SAME = 1e-9
"""Relative difference up to which two transfer functions count as the same."""
UNLIKELY, SURPRISING = 0.05, 0.01
"""A count of misses rarer than this under honest intervals is doubtful, or a failure."""


@dataclass(frozen=True)
class Truth:
    """Exact transfer functions of a simulated vehicle.

    Attributes
    ----------
    rates : mapping of str to RateTruth
        By body-rate channel.
    """

    rates: Mapping[str, RateTruth]

    @classmethod
    def of_flight(cls, flight: Flight) -> Truth:
        """Truth of every rate axis of a simulated flight."""
        return cls({rate: flight.truth(axis) for rate, axis in zip(RATES, AXES, strict=True)})

    def response(
        self, model: GreyBoxModel, omega_rad_s: NDArray[np.float64]
    ) -> NDArray[np.complex128] | None:
        """Exact response of the model's output, shape (n_freqs,); None where it is no body rate."""
        truth = self.rates.get(model.outputs[0])
        return None if truth is None else truth.frequency_response(omega_rad_s)

    def parameters(self, model: GreyBoxModel) -> dict[str, float]:
        """True value of each parameter of a model that can follow the true response exactly.

        Parameters
        ----------
        model : TransferFunctionModel or StateSpaceModel
            Model with one response; its parameters carry the library's names.

        Returns
        -------
        dict of str to float
            Empty where the model has another structure: its parameters then have no true value.
        """
        truth = self.rates.get(model.outputs[0])
        if truth is None:
            return {}
        values = {
            name: float(getattr(truth, field)) for field, names in NAMES.items() for name in names
        }
        values["tau"] = truth.effective_delay_s()
        if not set(model.parameters) <= set(values):
            return {}
        chosen = {name: values[name] for name in model.parameters}
        omega = np.geomspace(0.1, 100.0, 9)
        followed = model.frequency_response(omega, chosen)[0, 0]
        return chosen if np.allclose(followed, truth.continuous(omega), rtol=SAME) else {}

    def to_dict(self) -> dict[str, object]:
        """Plain values by rate channel."""
        return {rate: truth.to_dict() for rate, truth in self.rates.items()}


def inside(
    parameter: Estimate, true_value: float | None, dropped: Mapping[str, float]
) -> bool | None:
    """Whether an interval holds the truth; of what a reduction dropped, whether it is that.

    Parameters
    ----------
    parameter : Estimate
    true_value : float or None
    dropped : mapping of str to float
        Values at which a reduction has fixed parameters.

    Returns
    -------
    bool or None
        None where nothing is claimed, or no truth is known.

    Example
    -------
    >>> inside(Estimate("Lu", 0.0, "1/s"), 0.004, {"Lu": 0.0})
    False
    >>> inside(Estimate("Lu", 0.0, "1/s"), 0.004, {}) is None
    True
    """
    if true_value is None:
        return None
    if parameter.name in dropped:
        return bool(dropped[parameter.name] == true_value)
    ends = parameter.interval(shown())
    return None if ends is None else ends[0] <= true_value <= ends[1]


def recovered(inside: NDArray[np.bool_]) -> Finding:
    """Verdict on how many true values lie inside their 95 % intervals.

    Parameters
    ----------
    inside : ndarray of bool, shape (n_parameters,)
        One for each true value.
    """
    missed = int(inside.size - inside.sum())
    message = f"{inside.size - missed} of {inside.size} true values lie inside their 95 % intervals"
    if missed == 0:
        return Finding("truth-recovered", Light.GREEN, message + ".")
    chance = float(scipy.special.bdtrc(missed - 1, inside.size, 0.05))
    message += f"; honest intervals miss as many in {100 * chance:.2g} % of flights."
    if chance > UNLIKELY:
        return Finding("truth-recovered", Light.GREEN, message)
    light = Light.AMBER if chance > SURPRISING else Light.RED
    action = "compare other seeds, and the model's structure with the simulated one"
    return Finding("truth-missed", light, message, action)
