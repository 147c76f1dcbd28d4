"""The gust that a fit found: severe turbulence is the strongest that air holds.

Where a model lacks what the inputs do, a gust state can hold it, and is as strong as that takes.
"""

from __future__ import annotations

import math

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.units import conversion_factor, same_dimension

SEVEREST_FT_S = 23.6
"""Root mean square of the strongest turbulence called severe, ft/s: at 7,500 ft, exceeded once in
10⁵. Below 1,000 ft it is less: a tenth of a wind of 45 kt is 7.6 ft/s upright, 14.9 ft/s level.

MIL-F-8785C (1980), figures 7, 10 and 11, read as JSBSim's `FGWinds` has them."""


def judge_gust(
    state: str, unit: str, deviation: float, time_s: float, long_s: float
) -> list[Finding]:
    """Say how large a gust is: red where it is stronger than severe turbulence.

    Parameters
    ----------
    state : str
        The one that it adds to.
    unit : str
        Of the state; only speeds are judged.
    deviation : float
        Root mean square of the gust, in that unit.
    time_s : float
        Its memory.
    long_s : float
        Length of the longest record: of a longer memory it sees little.

    Returns
    -------
    list of Finding
        One: green where the air can be so, and of no speed.

    Example
    -------
    >>> [str(each.light) for each in judge_gust("w", "m/s", 20.0, 1.5, 60.0)]
    ['red']
    >>> print(*judge_gust("w", "m/s", 5.0, 1.5, 60.0))
    [green] a gust on w of 5 m/s (rms 4.88 m/s within one record), memory 1.5 s, is filtered out
    """
    felt = deviation * math.sqrt(felt_share(time_s, long_s))
    speed = same_dimension(unit, "ft/s")
    limit = SEVEREST_FT_S * conversion_factor("ft/s", unit) if speed else math.inf
    if felt <= limit:
        what = (
            f"a gust on {state} of {deviation:.3g} {unit} (rms {felt:.3g} {unit} within one "
            f"record), memory {time_s:.3g} s, is filtered out"
        )
        return [Finding("gust-found", Light.GREEN, what)]
    return [
        Finding(
            "gust-beyond-severe",
            Light.RED,
            f"the gust on {state} that explains these records is {felt:.3g} {unit} (rms within one "
            f"of them); the strongest turbulence that MIL-F-8785C calls severe is {limit:.3g} "
            f"{unit}: this is no air, but what the model or its units lack",
            "check units and structure, fit with gust_states=False beside it, and look where "
            "the prediction parts from the record",
        )
    ]


def felt_share(time_s: float, long_s: float) -> float:
    """Share of a first-order gust's variance that lies about its own mean over a record.

    Reference
    ---------
    Bendat & Piersol, *Random Data*, 4th ed., section 8.2: variance of a mean.

    Example
    -------
    >>> round(felt_share(0.1, 100.0), 3), round(felt_share(100.0, 1.0), 4)
    (0.998, 0.0033)
    """
    ratio = time_s / long_s
    # 1 − e^(−1/ratio) loses its digits to the difference below where memories are very long.
    if ratio > 1e3:
        return 1.0 / (3.0 * ratio)
    return 1.0 - 2.0 * ratio * (1.0 + ratio * math.expm1(-1.0 / ratio))
