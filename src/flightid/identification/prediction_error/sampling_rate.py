"""Whether records were sampled too fast or too slowly, by the place of a fit's discrete poles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction_error.roots import POLE, FittedRoot
from flightid.uncertainty.quantiles import LEVEL, half_width

TIMES_BANDWIDTH = 10.0
"""Sampling rate over bandwidth that suits an identification."""
CROWDED = 2.0 * math.pi / 100.0
"""Largest |ln z| of poles that crowd at z = 1: sampling at more than 100 times the bandwidth."""
NEAR_ORIGIN = 0.2
"""|z| of a pole that decays to a fifth and less within one sample."""

FAST, SLOW, TOLD = "sampled-fast", "sampled-slowly", "sampling-rate"
SAMPLING = (FAST, SLOW, TOLD)
"""Codes of these findings."""


def sampling_findings(roots: Sequence[FittedRoot], sample_time_s: float) -> tuple[Finding, ...]:
    """What the poles of the plant say of the sampling rate, and the rate that they ask for.

    Poles that crowd at z = 1 were sampled too fast; where none is left outside the origin, too
    slowly. A pole at the origin beside slower ones may be that of noise: it is told, not judged.
    The bandwidth is taken as the largest natural frequency of a pole off the origin.

    Parameters
    ----------
    roots : sequence of FittedRoot
    sample_time_s : float
        s.

    Returns
    -------
    tuple of Finding
        One, or none where there is no pole.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.7: about ten times the bandwidth.

    Example
    -------
    >>> poles = [FittedRoot("y/u", "pole", 0.995 + 0.01j, None, None, None)]
    >>> sampling_findings(poles, 0.01)[0].code
    'sampled-fast'
    """
    poles = {root.z: root for root in roots if root.kind == POLE}
    if not poles:
        return ()
    sizes = [abs(z) for z in poles]
    rate_hz = 1.0 / sample_time_s
    near = f"|z| {min(sizes):.3g} to {max(sizes):.3g}" if len(sizes) > 1 else f"|z| {sizes[0]:.3g}"
    held = f"plant poles with {near} at {rate_hz:.4g} Hz"
    slow = [root for root in poles.values() if abs(root.z) > NEAR_ORIGIN]
    if not slow:
        # Where errors reach as far as slower poles, nothing was shown.
        light = Light.AMBER if all(map(_is_near_origin, poles.values())) else Light.GREEN
        message = f"sampled too slowly: {held} lie at the origin: motion dies within a sample"
        action = f"log at {TIMES_BANDWIDTH * rate_hz / math.tau:.3g} Hz or faster"
        return (Finding(SLOW, light, message, action),)
    # A negative real pole has no continuous counterpart, so no frequency; z = 1 has none either.
    fastest = max((abs(np.log(r.z)) for r in slow if r.z.imag or r.z.real > 0.0), default=None)
    if not fastest:
        return ()
    advised_hz = TIMES_BANDWIDTH * fastest * rate_hz / math.tau
    if fastest < CROWDED:
        message = (
            f"sampled too fast: {held} crowd at z = 1, {math.tau / fastest:.3g} times their "
            "bandwidth: coefficients hang together, zeros of sampling appear"
        )
        action = f"resample to about {advised_hz:.2g} Hz (resample_to_s={1 / advised_hz:.2g})"
        return (Finding(FAST, Light.GREEN, message, action),)
    message = f"sampled at {math.tau / fastest:.3g} times the bandwidth, ten suit: {held}"
    return (Finding(TOLD, Light.GREEN, message),)


def _is_near_origin(root: FittedRoot) -> bool:
    if root.stderr is None:
        return False
    return abs(root.z) + half_width(LEVEL) * math.hypot(*root.stderr) < 2.0 * NEAR_ORIGIN
