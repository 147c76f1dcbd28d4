"""Whether records were sampled too fast or too slowly, by a fit's bandwidth and poles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction_error.roots import POLE, FittedRoot
from flightid.uncertainty.quantiles import LEVEL, half_width

TIMES_BANDWIDTH = 10.0
"""Sampling rate over bandwidth that suits an identification."""
MANY = 100.0
"""Sampling rate over bandwidth above which poles crowd at z = 1."""
TOLERATED = 1.5
"""Ratio of a mode's frequency to the bandwidth up to which both ask for the same rate."""
SURE = 0.1
"""Largest half of an interval, over the distance from z = 1, of a pole that is no fit of noise."""
POINTS = 400
"""Frequencies at which a response is looked at, from one cycle of the record to Nyquist."""
NEAR_ORIGIN = 0.2
"""|z| of a pole that decays to a fifth and less within one sample."""

FAST, SLOW, TOLD = "sampled-fast", "sampled-slowly", "sampling-rate"
SAMPLING = (FAST, SLOW, TOLD)
"""Codes of these findings."""


class ResponseModel(Protocol):
    """A model with a response and a sample time."""

    @property
    def sample_time_s(self) -> float:
        """Time between samples, s."""

    def frequency_response(self, omega_rad_s: ArrayLike, /) -> NDArray[np.complex128]:
        """Response, shape (n_outputs, n_inputs, n_freqs)."""


def sampling_findings(
    model: ResponseModel, roots: Sequence[FittedRoot], duration_s: float
) -> tuple[Finding, ...]:
    """What a fit says of the sampling rate, and the rate that its bandwidth asks for.

    Where the plant has no pole outside the origin it was sampled too slowly. Else the bandwidth is
    read off the fitted response, where it leaves its peak by 3 dB: poles that only fit noise hardly
    move that. The fastest response counts; nothing is said where one keeps its gain to the Nyquist
    frequency, leaves its peak twice, or does so within two cycles of the record (an integrator).
    A mode beyond the bandwidth is not to be lost: the faster of both times ten is advised.

    Parameters
    ----------
    model : PolynomialModel or InnovationsModel
    roots : sequence of FittedRoot
        Of the model.
    duration_s : float
        Of the longest record, s.

    Returns
    -------
    tuple of Finding
        One, or none where nothing can be told.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.7: about ten times the bandwidth.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> structure = PolynomialModel.general(("u",), "y", nb=1, nf=1, nk=1)
    >>> lag = PolynomialModel.from_theta(structure, np.array([0.095, -0.905]), 0.01)
    >>> poles = [FittedRoot("y/u", "pole", 0.905 + 0j, None, None, None)]
    >>> print(sampling_findings(lag, poles, 10.0)[0])
    [green] sampled at about 63 times the bandwidth of 1.6 Hz, ten suit
    """
    poles = {root.z: root for root in roots if root.kind == POLE}
    if not poles:
        return ()
    sizes = [abs(z) for z in poles]
    rate_hz = 1.0 / model.sample_time_s
    if max(sizes) <= NEAR_ORIGIN:
        # Where errors reach as far as slower poles, nothing was shown.
        light = Light.AMBER if all(map(_is_near_origin, poles.values())) else Light.GREEN
        near = (
            f"|z| {min(sizes):.3g} to {max(sizes):.3g}" if len(sizes) > 1 else f"|z| {sizes[0]:.3g}"
        )
        message = (
            f"sampled too slowly: plant poles with {near} at {rate_hz:.4g} Hz lie at the origin: "
            "motion dies within a sample"
        )
        action = f"log at {TIMES_BANDWIDTH * rate_hz / math.tau:.3g} Hz or faster"
        return (Finding(SLOW, light, message, action),)
    bandwidth_hz = _bandwidth_hz(model, duration_s)
    if bandwidth_hz is None:
        return ()
    times = rate_hz / bandwidth_hz
    # Poles that only fit noise are fast: where there are any, coefficients do not hang together.
    if times > MANY and max(abs(np.log(z)) for z in poles) < math.tau / MANY:
        message = (
            f"sampled too fast: plant poles crowd at z = 1, {rate_hz:.4g} Hz is about {times:.2g} "
            "times the bandwidth: coefficients hang together, zeros of sampling appear"
        )
        fastest_hz = rate_hz * max(abs(np.log(z)) for z in poles) / math.tau
        advised_hz = TIMES_BANDWIDTH * max(bandwidth_hz, fastest_hz)
        action = f"resample to about {advised_hz:.2g} Hz (resample_to_s={1 / advised_hz:.2g})"
        if fastest_hz > TOLERATED * bandwidth_hz:
            action += f", ten times the fastest mode, at {fastest_hz:.2g} Hz"
        return (Finding(FAST, Light.GREEN, message, action),)
    message = f"sampled at about {times:.2g} times the bandwidth of {bandwidth_hz:.2g} Hz, ten suit"
    told = [rate_hz * abs(np.log(z)) / math.tau for z, root in poles.items() if _is_told(root)]
    if told and max(told) > TOLERATED * bandwidth_hz:
        message += f"; its fastest mode, at {max(told):.2g} Hz, is kept by ten times that"
    return (Finding(TOLD, Light.GREEN, message),)


def _bandwidth_hz(model: ResponseModel, duration_s: float) -> float | None:
    """Where the fastest response leaves its peak by 3 dB; None where that cannot be told."""
    nyquist = math.pi / model.sample_time_s
    omega = np.geomspace(math.tau / duration_s, nyquist, POINTS)
    edges: list[float] = []
    for gain in np.abs(model.frequency_response(omega)).reshape(-1, POINTS):
        inside = np.flatnonzero(gain >= gain.max() / math.sqrt(2.0))
        last = int(inside[-1])
        if (
            omega[last] < 2.0 * omega[0]
            or last == POINTS - 1
            or inside.size != last - inside[0] + 1
        ):
            return None
        edges.append(float(omega[last]) / math.tau)
    return max(edges)


def _is_told(root: FittedRoot) -> bool:
    """Whether errors leave a pole where it is: those that fit noise are anywhere."""
    if root.stderr is None or abs(root.z) <= NEAR_ORIGIN:
        return False
    return half_width(LEVEL) * math.hypot(*root.stderr) < SURE * abs(root.z - 1.0)


def _is_near_origin(root: FittedRoot) -> bool:
    if root.stderr is None:
        return False
    return abs(root.z) + half_width(LEVEL) * math.hypot(*root.stderr) < 2.0 * NEAR_ORIGIN
