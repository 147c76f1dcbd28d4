"""What gains must do: margins, bandwidth, noise and how far one step may go."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from functools import cache
from importlib.resources import files
from typing import Any, cast

from flightid.frozen import dataclass
from flightid.options import Options, option

PRESETS = ("gentle", "balanced", "firm")
OWN = "own_controller"
"""Of a preset: what else it means where no autopilot is tuned."""
OBJECTIVES = ("disturbance", "crossover", "disturbance_bandwidth")


@dataclass(frozen=True)
class TuningRequirements(Options):
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
    integral_factor : float or None
        Largest ratio of I to P, over that of the autopilot's defaults or over nothing where the
        flown gains have a larger one; without it I grows until a margin stops it.
    preset : {"gentle", "balanced", "firm"}
        Values of `presets.toml` for all of these that are left as usual; firm is less margin around
        a rig, more noise and a larger I on an autopilot.
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

    phase_margin_deg: float = option(
        45.0, unit="deg", above=0.0, below=90.0, doc="Least phase margin of the rate loop."
    )
    gain_margin_db: float = option(6.0, unit="dB", above=0.0, doc="Least gain margin, both ways.")
    sensitivity_peak: float = option(2.0, above=1.0, doc="Largest |1/(1 + L)|.")
    delay_margin_s: float | None = option(
        None, unit="s", above=0.0, doc="Least extra delay that the rate loop survives."
    )
    crossover_rad_s: float | None = option(
        None, unit="rad/s", above=0.0, doc="Target: least crossover of the rate loop."
    )
    disturbance_bandwidth_rad_s: float | None = option(
        None, unit="rad/s", above=0.0, doc="Target: least −3 dB frequency of the sensitivity."
    )
    disturbance_peak_db: float | None = option(
        None, unit="dB", above=0.0, doc="Largest sensitivity, where it is asked for in dB."
    )
    noise_growth: float | None = option(
        2.0, above=0.0, doc="Largest output noise over that of the flown gains."
    )
    output_noise_rms: float | None = option(
        None, above=0.0, doc="Largest output noise; full output is 1."
    )
    band_factor: float | None = option(
        3.0, above=0.0, doc="The identified band's upper edge over the crossover, at least."
    )
    step_limit: float = option(2.0, above=1.0, doc="Largest ratio of a gain to the flown one.")
    angle_phase_margin_deg: float = option(
        60.0, unit="deg", above=0.0, below=90.0, doc="Least phase margin of the angle loop."
    )
    angle_crossover_rad_s: float | None = option(
        None, unit="rad/s", above=0.0, doc="Target: least crossover of the angle loop."
    )
    integral_factor: float | None = option(
        2.0, above=0.0, doc="Largest ratio of I to P over that of the autopilot's defaults."
    )
    preset: str = option(
        "balanced", choices=PRESETS, doc="Values for all requirements that are left as usual."
    )
    objective: str = option(
        "disturbance", choices=OBJECTIVES, doc="What is made as good as the limits allow."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._fill(_presets()[self.preset])

    def _fill(self, values: Mapping[str, object]) -> None:
        usual = _usual()
        for name, value in values.items():
            if name != OWN and getattr(self, name) == usual[name]:
                object.__setattr__(self, name, value)

    def changed(self, **requirements: Any) -> TuningRequirements:  # noqa: ANN401
        """With some replaced, by name; another preset takes the place of all of the one before.

        Example
        -------
        >>> gentle = TuningRequirements(preset="gentle", sensitivity_peak=1.8)
        >>> firm = gentle.changed(preset="firm")
        >>> firm.phase_margin_deg, firm.sensitivity_peak
        (45.0, 1.8)
        """
        if "preset" not in requirements:
            return replace(self, **requirements)
        usual, before = _usual(), _presets()[self.preset]
        back = {n: usual[n] for n, v in before.items() if n != OWN and getattr(self, n) == v}
        return replace(self, **{**back, **requirements})

    def of_own_controller(self) -> TuningRequirements:
        """For a controller that is no autopilot's: no growth of noise, its own meaning of firm."""
        made = replace(self, noise_growth=None)
        made._fill(cast(Mapping[str, object], _presets()[self.preset].get(OWN, {})))
        return made

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


@cache
def _usual() -> dict[str, object]:
    return {each.name: each.default for each in fields(TuningRequirements)}


@cache
def _presets() -> dict[str, dict[str, object]]:
    """Requirements by preset and name, as data."""
    text = files("flightid.control.tuning").joinpath("presets.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
