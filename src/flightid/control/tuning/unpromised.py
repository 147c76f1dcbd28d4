"""Why a margin is not promised, in words: what is read outside the band of the model."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.control.margins.mode_slack import TAKEN
from flightid.control.tuning.modes_outside import BELOW_BAND, OF_ABOVE
from flightid.control.tuning.worst_cases import WorstCase

BAND = "the band in which the model was shown to hold"


def outside_words(cases: Iterable[WorstCase], *, above: bool = False) -> str:
    """Where the margins without a promise are read, and which of them below the band.

    Parameters
    ----------
    cases : iterable of WorstCase
    above : bool
        Whether it is known already that some are read above.

    Returns
    -------
    str
        Empty where none is read outside.

    Example
    -------
    >>> from flightid.uncertainty.estimate import Estimate
    >>> angle = Estimate("angle loop: phase margin", None, "deg", reason=BELOW_BAND)
    >>> outside_words([WorstCase("angle loop", "phase margin", angle, None, None, None)])
    'what lies below the band in which the model was shown to hold (phase margin of angle loop)'
    """
    without = [each for each in cases if each.worst is None]
    below = [each for each in without if each.estimate.reason in (BELOW_BAND, TAKEN["below"])]
    above = above or any(each.estimate.reason in OF_ABOVE for each in without)
    named = ", ".join(dict.fromkeys(f"{each.name} of {each.loop}" for each in below))
    if not below:
        return f"what lies above {BAND}" if above else ""
    return (
        f"what lies above {BAND}, or below it ({named})"
        if above
        else (f"what lies below {BAND} ({named})")
    )
