"""What gains must do: margins, bandwidth, noise and how far one step may go."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields

from flightid.errors import OptionError

OBJECTIVES = ("disturbance", "crossover", "disturbance_bandwidth")
_OPTIONAL = (
    "crossover_rad_s",
    "disturbance_bandwidth_rad_s",
    "disturbance_peak_db",
    "delay_margin_s",
    "noise_growth",
    "output_noise_rms",
    "band_factor",
    "angle_crossover_rad_s",
)


@dataclass(frozen=True)
class TuningRequirements:
    """Requirements on the loops of one axis; each must hold for every plant the data allow.

    Without a target the gains are those of the highest `objective` within the limits. With
    `crossover_rad_s` or `disturbance_bandwidth_rad_s` as a target they are those of the largest
    distance from all limits that still reach it.

    Attributes
    ----------
    phase_margin_deg, gain_margin_db : float
        Least margins of the rate loop; the gain margin counts both ways where there is one below.
    sensitivity_peak : float
        Largest |1/(1 + L)|: the reciprocal of the distance from the critical point.
    delay_margin_s : float or None
        Least extra delay that the rate loop survives, s.
    crossover_rad_s, disturbance_bandwidth_rad_s : float or None
        Targets: least crossover of the rate loop, and least frequency at which its sensitivity
        passes −3 dB, rad/s.
    disturbance_peak_db : float or None
        Largest |1/(1 + L)| in dB, where that is how it is asked for.
    noise_growth : float or None
        Largest output noise from white gyro noise, over that of the flown gains.
    output_noise_rms : float or None
        Largest output noise from the gyro noise of the log, in output units (full output is 1).
    band_factor : float or None
        The crossover stays below the upper edge of the identified band over this factor.
    step_limit : float
        Largest ratio of a gain to the flown one in a single step.
    angle_phase_margin_deg : float
        Least phase margin of the angle loop; its gain margin and peak are those of the rate loop.
    angle_crossover_rad_s : float or None
        Target: least crossover of the angle loop, rad/s.
    objective : {"disturbance", "crossover", "disturbance_bandwidth"}
        What is made as good as the limits allow: the rate that a step of disturbance at the
        output leaves (root of its square integrated over time), the rate loop's crossover, or the
        −3 dB frequency of its sensitivity; the last two keep a small weight on the first, which
        settles the integral gain.

    Raises
    ------
    OptionError
        A number without meaning.

    Example
    -------
    >>> TuningRequirements(phase_margin_deg=50.0).step_limit
    2.0
    """

    phase_margin_deg: float = 45.0
    gain_margin_db: float = 6.0
    sensitivity_peak: float = 2.0
    delay_margin_s: float | None = None
    crossover_rad_s: float | None = None
    disturbance_bandwidth_rad_s: float | None = None
    disturbance_peak_db: float | None = None
    noise_growth: float | None = 2.0
    output_noise_rms: float | None = None
    band_factor: float | None = 3.0
    step_limit: float = 2.0
    angle_phase_margin_deg: float = 60.0
    angle_crossover_rad_s: float | None = None
    objective: str = "disturbance"

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise OptionError(
                "objective is not known", found=repr(self.objective), needed=f"one of {OBJECTIVES}"
            )
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name == "objective" or (value is None and each.name in _OPTIONAL):
                continue
            if not (math.isfinite(value) and value > 0.0):
                raise OptionError(f"{each.name} has no meaning", found=value, needed="positive")
        if min(self.sensitivity_peak, self.step_limit) <= 1.0:
            raise OptionError(
                "sensitivity_peak and step_limit must leave room",
                found=f"{self.sensitivity_peak:g} and {self.step_limit:g}",
                needed="more than 1",
            )
        if max(self.phase_margin_deg, self.angle_phase_margin_deg) >= 90.0:
            raise OptionError(
                "a phase margin of 90° leaves no bandwidth",
                found=f"{max(self.phase_margin_deg, self.angle_phase_margin_deg):g}°",
                needed="less than 90°",
            )

    @property
    def has_target(self) -> bool:
        """Whether a bandwidth is asked for, instead of the highest."""
        return self.crossover_rad_s is not None or self.disturbance_bandwidth_rad_s is not None

    @property
    def peak(self) -> float:
        """Largest sensitivity, whichever way it is asked for."""
        if self.disturbance_peak_db is None:
            return self.sensitivity_peak
        return float(min(self.sensitivity_peak, 10.0 ** (self.disturbance_peak_db / 20.0)))

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key."""
        return {"schema": "flightid.tuning_requirements/1", **asdict(self)}
