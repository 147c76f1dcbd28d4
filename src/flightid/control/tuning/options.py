"""Options of tuning beside the requirements; see `flightid.tune`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from flightid.control.gyro import Gyro
from flightid.frozen import dataclass
from flightid.options import Options, option

OtherLoops = Literal["closed", "open"]
TunedWith = Literal["flown", "suggested"]
DRAWS = 300
"""Plants drawn from the covariance for a search."""


@dataclass(frozen=True)
class TuneOptions(Options):
    """What a design of gains is told beside its requirements.

    Example
    -------
    >>> TuneOptions(gyro="raw").angle_loop
    True
    """

    gyro: Gyro = option(
        "filtered",
        choices=("filtered", "raw"),
        doc="Which rate the models end at: behind the gyro filters or ahead of them.",
    )
    angle_loop: bool = option(True, doc="Tune the angle loop too.")
    band_rad_s: tuple[float, float] | None = option(
        None,
        unit="rad/s",
        above=0.0,
        doc="Band that the models were identified in; default: what their fits say.",
    )
    signs: Mapping[str, float] | None = option(
        None, doc="−1 for an axis whose rate answers its command the other way round."
    )
    nominal: bool = option(False, doc="Take a model without covariance, for its own margins alone.")
    draws: int = option(DRAWS, minimum=1, doc="Plants drawn from the covariance.")
    seed: int = option(0, minimum=0, doc="Seed of the draws.")
    other_loops: OtherLoops = option(
        "closed",
        choices=("closed", "open"),
        doc="Loops of the other axes of one model while an axis is designed; open: each alone, "
        "and then judged with all closed.",
    )
    filters: TunedWith = option(
        "flown",
        choices=("flown", "suggested"),
        doc="Filters that the gains are tuned with: those that flew, or better ones for the gyro's "
        "noise in the log, which then bounds the output's noise.",
    )
    by_hand: Mapping[str, float] | None = option(
        None,
        doc="Gains by the autopilot's names in place of those of the search: their axes are judged "
        "as they stand, gains that are not named as flown. Of a PID of its own Kp, Ki, Kd, with "
        "several loops output/Kp; what is not named is zero.",
    )
    rigid: bool = option(
        False,
        doc="Declares that the vehicle carries nothing that swings or bends outside the band of "
        "its model: no sling load, fuel slosh, soft mounts or arms. Light modes there are then "
        "not allowed for; nothing shows it, and every promise says so.",
    )
    accept_red: bool = option(
        False,
        doc="Make gains where the data refuse them, and write them: every refusal stands in the "
        "result and in the files.",
    )
