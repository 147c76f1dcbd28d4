"""What margins say of a loop, judged at the worse end of their intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.loop_metrics import LoopMetrics
from flightid.control.margins.loop_source import BrokenLoop
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.uncertainty.estimate import Estimate, Reading

UNREAD, CONTRADICTED = "stability-not-read", "nyquist-criterion-contradicted"
"""Of loops whose stability is unknown: reading ends before the gain has passed one for good, or the
response turns as no loop of that many unstable poles does."""
AT_END = "worst at an end of what was read, and may be worse beyond"
"""Of a peak or a least distance of a measurement."""
COHERENCE = 0.6
"""Below this a measured response near crossover says little."""


def guide_finding(
    quantity: Reading, guide: float, code: str, action: str, *, at_least: bool = True
) -> Finding:
    """Whether a number keeps a guide, at the worse end of its interval.

    Parameters
    ----------
    quantity : Estimate
        With a value.
    guide : float
        In its unit.
    code, action : str
    at_least : bool
        Whether the guide is a least or a greatest value.

    Returns
    -------
    Finding
        Red: the estimate misses the guide; amber: its interval reaches over it.

    Example
    -------
    >>> from flightid.uncertainty.estimate import Estimate
    >>> pm = Estimate("phase margin", 50.0, "deg", 3.5)
    >>> guide_finding(pm, 45.0, "phase-margin", "add lead").light.value
    'amber'
    """
    assert quantity.value is not None
    sign = 1.0 if at_least else -1.0
    text = f"{quantity.name} {quantity.text}, guide {'at least' if at_least else 'at most'} "
    text += f"{guide:g} {quantity.unit}"
    if sign * (quantity.value - guide) < 0.0:
        return Finding(code, Light.RED, f"{text}: missed", action)
    if quantity.reason == AT_END:
        wider = "measure a wider band, or fit a model"
        return Finding(code, Light.UNKNOWN, f"{text}: kept as far as was read", wider)
    if quantity.interval95 is None:
        return Finding(code, Light.GREEN, f"{text}: kept by the estimate, without interval")
    end = quantity.interval95[0 if at_least else 1]
    if sign * (end - guide) < 0.0:
        reach = f"{text}: the interval reaches beyond it, to {end:.3g}"
        return Finding(code, Light.AMBER, reach, f"{action}, or measure it better")
    return Finding(code, Light.GREEN, f"{text}: kept in the whole interval")


def as_far_as_read(
    reading: Reading, distance: NDArray[np.float64], gain_at_end: float = 0.0
) -> Reading:
    """A worst value of a measurement, without interval where it may be worse beyond its ends.

    Parameters
    ----------
    reading : Estimate
    distance : ndarray, shape (n_f,)
        Distance from what is worst, over frequency.
    gain_at_end : float
        Of the loop at the highest frequency: from one on it has still to pass −1.

    Example
    -------
    >>> from flightid.uncertainty.estimate import Estimate
    >>> peak = Estimate("peak", 1.1, "dB", 0.5)
    >>> as_far_as_read(peak, np.array([9.0, 3.0, 0.9, 1.1])).interval95 is None
    False
    >>> as_far_as_read(peak, np.array([9.0, 3.0, 1.1, 0.9])).reason
    'worst at an end of what was read, and may be worse beyond'
    """
    inside = 0 < np.argmin(distance) < len(distance) - 1
    if reading.value is None or (inside and gain_at_end < 1.0):
        return reading
    return Estimate(reading.name, reading.value, reading.unit, None, AT_END)


def margin_findings(
    loop: BrokenLoop,
    metrics: LoopMetrics,
    made: Mapping[str, Reading],
    *,
    phase_guide_deg: float,
    gain_guide_db: float,
) -> tuple[Finding, ...]:
    """Findings of `margins`.

    Parameters
    ----------
    loop : BrokenLoop
    metrics : LoopMetrics
        Of the estimate.
    made : mapping of str to Estimate
    phase_guide_deg, gain_guide_db : float

    Returns
    -------
    tuple of Finding
    """
    found = [*stability_findings(loop, metrics)]
    # What an unstable loop has to give back is no margin that a guide could judge.
    guides = (
        ()
        if metrics.unstable_poles > 0.0
        else (
            ("phase_margin", phase_guide_deg, "take gain or lag out of the loop"),
            ("gain_margin", gain_guide_db, "lower the gain"),
            ("gain_reduction_margin", gain_guide_db, "raise the gain"),
        )
    )
    for key, guide, action in guides:
        quantity = made[key]
        if quantity.value is not None:
            found.append(guide_finding(quantity, guide, key.replace("_", "-"), action))
    if made["crossover"].value is None:
        found.append(
            Finding(
                "no-crossover",
                Light.UNKNOWN,
                "the gain does not pass one in the band"
                + (f" ({loop.unread})" if loop.unread else "")
                + ": there is no phase margin to speak of",
                "widen the band, if the loop is meant to act there",
            )
        )
    elif loop.coherence is not None:
        at = np.interp(made["crossover"].value, loop.omega_rad_s, loop.coherence)
        if at < COHERENCE:
            found.append(
                Finding(
                    "coherence-at-crossover",
                    Light.AMBER,
                    f"coherence at the crossover is {at:.2f}",
                    "excite that band better, or fit a model",
                )
            )
    found += source_findings(loop, made["crossover"])
    if not loop.uncertain.known:
        found.append(
            Finding("no-intervals", Light.UNKNOWN, f"no intervals: {loop.uncertain.reason}")
        )
    found += unread_findings(loop.unread)
    if loop.measured:
        found.append(_verdict_of_band(loop))
    return tuple(found)


def source_findings(loop: BrokenLoop, crossover: Reading) -> list[Finding]:
    """What is known of where the loop comes from, and whether it is known where it crosses one."""
    found, valid = list(loop.uncertain.findings), loop.uncertain.valid_rad_s
    if valid is None or crossover.value is None or valid[0] <= crossover.value <= valid[1]:
        return found
    return [
        *found,
        Finding(
            "crossover-outside-band",
            Light.AMBER,
            f"the crossover at {crossover.value:.3g} rad/s lies outside {valid[0]:.3g} to "
            f"{valid[1]:.3g} rad/s, where the model is known",
            "excite that band, or move the crossover into it",
        ),
    ]


def unread_findings(unread: str) -> list[Finding]:
    """What of a measured loop is not read, for want of coherence; nothing where all is."""
    if not unread:
        return []
    return [
        Finding(
            "not-read",
            Light.UNKNOWN,
            f"crossings and turns about −1 that are {unread}",
            "excite what lies beyond better, look at another band, or fit a model",
        )
    ]


def _verdict_of_band(loop: BrokenLoop) -> Finding:
    low, high = loop.omega_rad_s[[0, -1]]
    return Finding(
        "stability-of-the-band",
        Light.UNKNOWN,
        f"whether the closed loop is stable is judged from {low:.3g} to {high:.3g} rad/s and "
        f"{loop.unstable_poles} unstable poles of the open loop: other turns about −1 are not seen",
        "measure from below the lowest crossing, or fit a model",
    )


def _ends_open(loop: BrokenLoop) -> bool:
    """Whether reading ends, for want of coherence, where the loop may still turn about −1."""
    if not loop.unread:
        return False
    last = loop.of(loop.uncertain.value, loop.omega_rad_s)[-1]
    return bool(abs(last) >= 1.0)


def stability_findings(loop: BrokenLoop, metrics: LoopMetrics) -> list[Finding]:
    """What the Nyquist criterion says, where it does not say that all is well."""
    count = round(float(metrics.unstable_poles))
    open_poles = f"{loop.unstable_poles} unstable poles of the open"
    if _ends_open(loop):
        high = loop.omega_rad_s[-1]
        seen = f"turns up to there make {count} unstable poles" if count else "none is seen so far"
        return [
            Finding(
                UNREAD,
                Light.AMBER if count else Light.UNKNOWN,
                f"whether the closed loop is stable cannot be told: the gain is above one at "
                f"{high:.3g} rad/s, and what follows is {loop.unread}; {seen}, "
                f"from {open_poles} loop",
                "excite higher frequencies until the gain has passed one, or fit a model",
            )
        ]
    if count > 0:
        return [
            Finding(
                "closed-loop-unstable",
                Light.RED,
                f"the closed loop is unstable: {count} unstable poles by the Nyquist criterion, "
                f"from {open_poles} loop; its margins are what must be taken back, and negative",
                "change the gains; for a measurement that began too high, or an unstable vehicle, "
                "give unstable_poles",
            )
        ]
    if count < 0:
        return [
            Finding(
                CONTRADICTED,
                Light.AMBER,
                f"the response turns about −1 as if it had more than {open_poles} loop",
                "give unstable_poles, or begin the band lower",
            )
        ]
    return []
