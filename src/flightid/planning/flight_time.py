"""How long a plan takes in the air, and what it asks of the battery."""

from __future__ import annotations

import math
from collections.abc import Iterable

from flightid.frozen import dataclass
from flightid.inspection.flight_phases import FlightPhases
from flightid.logs import Log
from flightid.review.identity import flight_identity

CAPACITIES = ("BATT_CAPACITY", "BAT1_CAPACITY", "BAT_CAPACITY")
USABLE = 0.7
"""Share of the capacity that a test flight may draw: cells below 30 % sag, and so do gains."""
OVERHEAD_S = 60.0
"""Take-off, climb and landing of one flight, s."""


@dataclass(frozen=True)
class FlightTime:
    """Time in the air and charge.

    Attributes
    ----------
    run_s : tuple of float
        One run of each axis, waiting included, s.
    total_s : float
        All runs and take-offs, s.
    needed_mah, capacity_mah : float or None
        Charge at the current of the log, and what the battery holds by the parameters; None where
        the log does not tell.
    """

    run_s: tuple[float, ...]
    total_s: float
    needed_mah: float | None = None
    capacity_mah: float | None = None

    @property
    def batteries(self) -> int | None:
        """How many charged batteries the plan takes; None where the log does not tell."""
        if self.needed_mah is None or self.capacity_mah is None:
            return None
        return math.ceil(self.needed_mah / (USABLE * self.capacity_mah))

    @property
    def words(self) -> str:
        """Time and batteries in words."""
        said = f"{self.total_s / 60.0:.0f} min in the air"
        if self.needed_mah is not None:
            said += f", about {self.needed_mah:.0f} mAh at the current of this log"
        if self.batteries is not None:
            plural = "battery" if self.batteries == 1 else "batteries"
            return f"{said}: {self.batteries} {plural} of {self.capacity_mah:.0f} mAh, 70 % used"
        return f"{said}; what the battery holds is not told: count it yourself"


def flight_time(
    run_s: Iterable[float], n_records: int, log: Log | None, phases: FlightPhases | None
) -> FlightTime:
    """Time and charge of all runs, one take-off an axis."""
    runs = tuple(run_s)
    total_s = sum(n_records * run + OVERHEAD_S for run in runs)
    if log is None or phases is None:
        return FlightTime(runs, total_s)
    battery = flight_identity(log, phases).battery
    mean_a = None if battery is None else battery.mean_a
    held = next((log.parameters[n] for n in CAPACITIES if log.parameters.get(n, 0.0) > 0.0), None)
    needed = None if mean_a is None else mean_a * total_s / 3.6
    return FlightTime(runs, total_s, needed, held)
