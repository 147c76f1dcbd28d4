"""Options of a flight plan; see `flightid.plan_flight`."""

from __future__ import annotations

import math

from flightid.frozen import dataclass
from flightid.options import Options, option

VEHICLES = ("quad", "heli", "plane", "quadplane")
AUTOPILOTS = ("ardupilot", "px4", "betaflight", "inav")


@dataclass(frozen=True)
class PlanOptions(Options):
    """What a flight plan is asked for.

    Example
    -------
    >>> PlanOptions().n_records
    2
    """

    vehicle: str = option("quad", choices=VEHICLES, doc="Kind of vehicle, where no log tells it.")
    autopilot: str = option("ardupilot", choices=AUTOPILOTS, doc="Its autopilot, likewise.")
    axes: tuple[str, ...] | None = option(
        None, doc="Axes to sweep; default: those of which the log carries no model yet."
    )
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", above=0.0, doc="Band to sweep; default: by the loops that fly."
    )
    amplitude: float | None = option(
        None,
        above=0.0,
        doc="Of the sweep: share of full command; rad or rad/s of a set-point; default: by limits.",
    )
    duration_s: float | None = option(
        None, unit="s", above=0.0, maximum=255.0, doc="Length of one sweep; default: by the band."
    )
    n_records: int = option(2, minimum=1, doc="Sweeps of each axis.")
    control: float = option(
        0.25, above=0.0, maximum=1.0, doc="Limit: command about trim, as a share of the full one."
    )
    rate_rad_s: float = option(
        math.radians(60.0), unit="rad/s", above=0.0, doc="Limit: largest rate."
    )
    attitude_rad: float = option(
        math.radians(15.0), unit="rad", above=0.0, doc="Limit: largest attitude change."
    )
    loop_rate_hz: float | None = option(
        None,
        unit="Hz",
        above=0.0,
        doc="Rate of the controller, where the log does not tell it; default then: 400 Hz, amber.",
    )
