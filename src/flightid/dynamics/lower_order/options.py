"""Options of an equivalent system of low order; see `flightid.lower_order`."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.dynamics.lower_order.structures import STRUCTURES
from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class LowerOrderOptions(Options):
    """Which equivalent system, of which pair, over which band.

    Example
    -------
    >>> LowerOrderOptions(kind="roll").band_rad_s
    (0.1, 10.0)
    """

    kind: str = option(choices=STRUCTURES, doc="Equivalent system.")
    inputs: str | None = option(None, doc="Control, where there are several.")
    outputs: str | None = option(None, doc="Output, where there are several.")
    band_rad_s: tuple[float, float] = option(
        (0.1, 10.0), unit="rad/s", above=0.0, doc="Band of the fit."
    )
    n_omega: int = option(20, minimum=8, doc="Frequencies, evenly spaced in log.")
    t_theta2_s: float | None = option(
        None, unit="s", above=0.0, doc="T_theta2, held fixed: pitch rate alone hardly tells it."
    )
    airspeed_m_s: float | None = option(
        None, unit="m/s", above=0.0, doc="For the control anticipation parameter."
    )
    n_alpha: float | None = option(
        None, unit="g/rad", above=0.0, doc="Load factor by angle of attack."
    )
    fixed: Mapping[str, float] | None = option(None, doc="Parameters held fixed.")
    correct_bias: bool = option(
        True, doc="Of a measured response: take out what windows leave in it."
    )
