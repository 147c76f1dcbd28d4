"""What Betaflight's rate controller was in the versions that a header may name."""

from __future__ import annotations

import math
from collections.abc import Mapping

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.logs.blackbox.settings import VERSION

TPA_OF_D = 1.0
"""`tpa_mode` D: throttle takes from D alone, else from P and D."""
FIR = 2.0
"""Type of a low-pass before 3.4, a moving mean; PT2 since 4.3."""
NEWEST = 99.0


@dataclass(frozen=True)
class BetaflightEra:
    """How a version weighs its terms.

    Attributes
    ----------
    yaw_integral : float
        What the firmware multiplies the I of yaw by.
    has_yaw_d : bool
        Whether yaw has a D term.
    tpa_of_d : bool
        Whether throttle takes from D alone where the settings do not tell.
    setpoint_weight : float
        Share of the set-point in what D differentiates.
    weight_is_filtered : bool
        Whether that share passes the D-term filters.
    gyro_at_once : bool
        Whether all gyro filters run at the gyro's rate; else the second low-pass alone.
    integral_limit : float
        Of I, in counts of the PID sum; not a number: a share of its limit.

    Reference
    ---------
    Betaflight, src/main/flight/pid.c of 3.1 (D on the weighted error behind its filters), 3.2 (its
    weight in 127ths), 3.4 (D on the gyro, the set-point beside it), 4.0 (feed-forward, yaw's I
    times 2.5, `tpa_mode`), 4.3 (gyro filters at the loop's rate).
    """

    yaw_integral: float = 2.5
    has_yaw_d: bool = True
    tpa_of_d: bool = True
    setpoint_weight: float = 0.0
    weight_is_filtered: bool = False
    gyro_at_once: bool = False
    integral_limit: float = math.nan


def era_of(settings: Mapping[str, float]) -> BetaflightEra:
    """The era of a version.

    Parameters
    ----------
    settings : mapping of str to float
        As `settings_of` makes them; without a version: the newest.

    Raises
    ------
    DataError
        The D-term passes a moving mean, which is not modelled.

    Example
    -------
    >>> era_of({"firmware_version": 3.05, "dterm_setpoint_weight": 60.0}).setpoint_weight
    0.6
    """
    version = settings.get(VERSION, NEWEST)
    if version >= 4.03:
        return BetaflightEra()
    if version >= 4.0:
        return BetaflightEra(
            gyro_at_once=True, integral_limit=settings.get("iterm_limit", math.nan)
        )
    if version < 3.04 and settings.get("dterm_lpf1_type") == FIR:
        raise DataError(
            "the D-term passes a moving mean, which is not modelled",
            found="dterm_filter_type 2 (FIR)",
            needed="PT1 or BIQUAD",
            action="fly another type of filter, or a newer firmware",
        )
    whole = 127.0 if 3.02 <= version < 3.04 else 100.0
    return BetaflightEra(
        yaw_integral=1.0,
        has_yaw_d=False,
        tpa_of_d=False,
        setpoint_weight=settings.get("dterm_setpoint_weight", 0.0) / whole,
        weight_is_filtered=version < 3.04,
        gyro_at_once=True,
        integral_limit=settings.get("iterm_limit", 250.0),
    )


def has_gyro_mean(settings: Mapping[str, float]) -> bool:
    """Whether the gyro passes a moving mean, which a plant from the filtered rate holds."""
    return settings.get(VERSION, NEWEST) < 3.04 and settings.get("gyro_lpf1_type") == FIR


def throttle_shares(
    settings: Mapping[str, float], throttle: float, era: BetaflightEra
) -> tuple[float, float]:
    """What TPA leaves of P and of D at a throttle from 0 to 1."""
    begin = (settings.get("tpa_breakpoint", 1350.0) - 1000.0) / 1000.0
    rate = settings.get("tpa_rate", 0.0) / 100.0
    if begin >= 1.0:
        return 1.0, 1.0
    left = 1.0 - rate * max(throttle - begin, 0.0) / (1.0 - begin)
    mode = settings.get("tpa_mode", TPA_OF_D if era.tpa_of_d else 0.0)
    return (1.0 if mode == TPA_OF_D else left), left
