"""Bandwidth and phase delay of an attitude response."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.dynamics.handling_qualities.curve import (
    COHERENT,
    GRID_POINTS,
    GainPhaseCurve,
    Pair,
    smoother_of,
)
from flightid.dynamics.handling_qualities.result import AttitudeBandwidth
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.identification.uncertain_of import source_findings, uncertain_of
from flightid.responses import FrequencyResponse, PairResponse
from flightid.responses.response_band import spread_of
from flightid.responses.shown import WITHOUT_BIAS
from flightid.responses.unbiased import unbiased
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.uncertain import Uncertain, uncertain_numbers

PHASE_MARGIN_DEG = 45.0
GAIN_MARGIN_DB = 6.0
RESPONSE_TYPES = ("rate", "attitude")
OUTPUTS = ("attitude", "rate")
SHORTEST_SLOPE = 1.3
"""Band above ω_180, over ω_180, from which a slope of the phase is still taken."""
NONLINEAR = 0.1
"""Difference of both phase delays, over the larger, beyond which the phase is no line."""
SMALLEST_DELAY_S = 0.002
NOISY = 0.03
"""Random error at a crossing beyond which intervals of a reading cover less than they say."""
LATE = "begin the band lower: the phase has passed −135° where it begins"
SIGN_SURE_DEG = 45.0
"""Lead over the phase of the gain up to which the sign of a control is not in doubt."""
NO_FALL = "widen the band; take the attitude, or say that it is a rate, with its sign"
NO_LEAD = "above its unstable pair the phase never passes −135°: close an inner loop first"
AMBIGUOUS = 3.0
"""Width of all places where noise may put a passage, over that of its interval of first order."""
FEW_POINTS, SAME = 500, 1e-3
"""Points of a coarser grid, and how near its numbers are to be to those of the whole one."""
MOST_POINTS = 160
"""Measured points that carry errors: more say the same again."""
Array = NDArray[np.float64]


def attitude_bandwidth(
    source: object,
    inputs: str,
    outputs: str,
    *,
    band_rad_s: tuple[float, float] = (0.1, 100.0),
    response_type: str = "rate",
    output_is: str = "attitude",
    sign: int = 1,
) -> AttitudeBandwidth:
    """Bandwidth and phase delay of an attitude to a control, with 95 % intervals.

    Bandwidth is the highest frequency at which a pilot can still close the loop with 45° of phase
    margin, or with 6 dB of gain margin; phase delay says how fast the phase falls off beyond.

    Parameters
    ----------
    source : Fit, FrequencyResponse, model, LinearSystem, or a black-box fit
        Measured points with known errors are smoothed by local parabolas over a third of their
        frequency, and joined by straight lines of dB and degrees over log frequency; a model is
        evaluated where it is needed. Fits and measured responses give intervals.
    inputs, outputs : str
        Attitude and control.
    band_rad_s : tuple of float
        Band to look in, rad/s; of a measured response, what lies in it.
    response_type : {"rate", "attitude"}
        What the control commands: the lesser of both bandwidths counts for rate, that of the phase
        alone for attitude.
    output_is : {"attitude", "rate"}
        A rate is integrated to its attitude.
    sign : {1, -1}
        −1 for a control that pulls the other way.

    Raises
    ------
    DataError
        The phase does not pass −135° and −180° in the band.
    OptionError
        The band or another option has no meaning.
    UnknownNameError
        There is no such channel.

    Assumes
    -------
    A band that reaches above slow modes and begins before delay has cost 105°: the sign and the
    branch of the phase are read near crossover, against the phase that the gain asks for.
    Intervals of first order, from the covariance of parameters or of the measured response:
    biased where coherence is low near ω_180 or its double, and after arithmetic by what windows
    blur; before it `without_bias` takes that out. Where noise may move a passage to another place
    there is no interval. Of several passages through −180° above unstable modes the first counts,
    which noise makes earlier.

    Reference
    ---------
    ADS-33E-PRF, *Handling Qualities Requirements for Military Rotorcraft* (2000), §3.3.2.1 and
    figure 5; MIL-STD-1797A, appendix A, §4.2.1.2; slope of the phase: Tischler & Remple, *Aircraft
    and Rotorcraft System Identification*, 2nd ed., section 7.8.

    Example
    -------
    >>> import flightid as fid
    >>> model = fid.load_model("attitude_first_order", axis="roll")
    >>> found = attitude_bandwidth(model, model.inputs[0], model.outputs[0])
    >>> found.phase_bandwidth_rad_s < found.omega_180_rad_s
    True
    """
    pair = _pair(outputs, inputs, band_rad_s, output_is, sign)
    for name, given, known in (
        ("response_type", response_type, RESPONSE_TYPES),
        ("output_is", output_is, OUTPUTS),
    ):
        if given not in known:
            raise OptionError(f"{name} is not known", found=given, needed=" or ".join(known))
    if isinstance(source, FrequencyResponse):
        chosen = source.select(outputs=[outputs], inputs=[inputs])
        chosen = unbiased(chosen, refined=True) or chosen
        data: object = chosen
        curve = GainPhaseCurve.of(chosen, pair, smoother_of(chosen, pair))
    else:
        data = source
        curve = GainPhaseCurve.of(uncertain_of(source).value, pair)
    values = bandwidth_numbers(curve)
    if not np.all(np.isfinite(values[:2])):
        raise DataError(
            f"{outputs}/{inputs} has no bandwidth in the band",
            found=f"phase from {curve.degrees[0]:.0f}° to {curve.degrees[-1]:.0f}°",
            needed="a phase that passes −135° and −180°",
            action=_next(curve),
        )
    errors = _errors(data, pair, values)
    nonlinear = _is_nonlinear(values)
    findings = (
        *_judge(curve, values, nonlinear, response_type),
        *_coherence(data, pair, values),
        *source_findings(data),
    )
    return AttitudeBandwidth(outputs, inputs, response_type, errors, curve, nonlinear, findings)


def _next(curve: GainPhaseCurve) -> str:
    if curve.branch.above > curve.omega[0] and not curve.branch.reversed:
        return NO_LEAD
    if curve.degrees[0] > PHASE_MARGIN_DEG - 180.0:
        return NO_FALL
    return LATE if abs(curve.branch.lead) <= SIGN_SURE_DEG else f"{LATE}; or turn the sign"


def _pair(output: str, control: str, band: tuple[float, float], output_is: str, sign: int) -> Pair:
    low, high = band
    if not (np.isfinite(low) and np.isfinite(high) and 0.0 < low < high):
        raise OptionError("band_rad_s has no meaning", found=band, needed="0 < low < high")
    if sign not in (1, -1):
        raise OptionError("sign has no meaning", found=sign, needed="1 or -1")
    return Pair(output, control, low, high, output_is == "rate", sign)


def bandwidth_numbers(curve: GainPhaseCurve) -> Array:
    """ω_180, phase bandwidth, gain bandwidth, phase delay by two points and by the slope."""
    crossing = curve.falls_through(-180.0)
    margin = curve.falls_through(PHASE_MARGIN_DEG - 180.0)
    found: list[float | None] = [crossing, margin, None, None, None]
    if crossing is not None:
        end = min(2.0 * crossing, float(curve.omega[-1]))
        found[2] = curve.above(crossing, GAIN_MARGIN_DB)
        found[3] = curve.phase_delay(crossing)
        if end >= SHORTEST_SLOPE * crossing:
            found[4] = curve.phase_slope(crossing, end)[0]
    return np.array([np.nan if each is None else each for each in found])


def _errors(data: object, pair: Pair, values: Array) -> Uncertain[Array]:
    """Covariance of the numbers, about the values of the whole curve."""
    smoother = None
    if isinstance(data, FrequencyResponse):
        data = _thinned(data, pair, values)
        smoother = smoother_of(data, pair)
    source = uncertain_of(data, pair.output, pair.input)
    points = GRID_POINTS if isinstance(data, FrequencyResponse) else _enough(source, pair, values)
    found = source.carried(
        lambda thing: bandwidth_numbers(GainPhaseCurve.of(thing, pair, smoother, points))
    )
    covariance = found.covariance
    if covariance is not None and isinstance(data, FrequencyResponse):
        covariance = _certain(covariance, data, pair)
    return uncertain_numbers(values, covariance, found.reason)


def _enough(source: Uncertain[Any], pair: Pair, values: Array) -> int:
    """Points of a model's grid by which its errors are found: few where they see what all do.

    Passages are refined by the model itself, whatever grid they are first seen on.
    """
    if not source.known:
        return GRID_POINTS
    seen = bandwidth_numbers(GainPhaseCurve.of(source.value, pair, points=FEW_POINTS))
    same = np.allclose(seen, values, rtol=SAME, atol=0.0, equal_nan=True)
    return FEW_POINTS if same else GRID_POINTS


def _certain(covariance: Array, data: FrequencyResponse, pair: Pair) -> NDArray[np.float64]:
    """NaN in the rows of what hangs on a passage that noise may have moved to another place.

    The first passage through a level lies between where the lower edge of the phase's band first
    reaches it and where the upper edge does; where that is far wider than first order says, the
    phase comes near the level more than once.
    """
    spread = spread_of(data)
    if spread is None:
        return covariance
    curve = GainPhaseCurve.of(data, pair)
    inside = (data.omega_rad_s >= pair.low) & (data.omega_rad_s <= pair.high)
    sizes = np.abs(data.response[0, 0, inside])
    half = np.degrees(half_width() * spread[1, inside] / sizes)
    found = covariance.copy()
    for place, level in ((0, -180.0), (1, PHASE_MARGIN_DEG - 180.0)):
        low = replace(curve, degrees=curve.degrees - half).falls_through(level)
        high = replace(curve, degrees=curve.degrees + half).falls_through(level)
        wide = 2.0 * half_width() * float(np.sqrt(covariance[place, place]))
        if low is None or high is None or high - low > AMBIGUOUS * wide:
            lost = [place] if place else [0, 2, 3, 4]
            found[lost, :] = found[:, lost] = np.nan
    return found


def _thinned(response: FrequencyResponse, pair: Pair, values: Array) -> FrequencyResponse:
    """The part of a measured response that the numbers depend on, at most `MOST_POINTS` of it."""
    omega = response.omega_rad_s
    first = 0.6 * float(np.nanmin(values[:3]))
    inside = np.flatnonzero((omega >= pair.low) & (omega <= min(pair.high, 2.75 * values[0])))
    near = inside[omega[inside] >= first]
    below = inside[omega[inside] < first]
    keep = (
        near
        if len(near) <= MOST_POINTS
        else near[np.unique(np.linspace(0, len(near) - 1, MOST_POINTS).round().astype(int))]
    )
    # The lowest points only say on which branch the phase begins.
    few = below[:: max(1, len(below) // 20)]
    return response.select(omega_rad_s=omega[np.concatenate([few, keep])])


def _is_nonlinear(values: Array) -> bool:
    two_points, slope = values[3], values[4]
    if not (np.isfinite(two_points) and np.isfinite(slope)):
        return False
    larger = max(abs(two_points), abs(slope), SMALLEST_DELAY_S / NONLINEAR)
    return bool(abs(two_points - slope) > NONLINEAR * larger)


def _judge(
    curve: GainPhaseCurve, values: Array, nonlinear: bool, response_type: str
) -> tuple[Finding, ...]:
    crossing, margin, gain, delay, slope = values
    found = []
    if curve.branch.reversed:
        text = f"the phase lies {curve.branch.lead:.0f}° ahead of what the gain asks for"
        action = "turn the sign if the control pulls the other way; begin the band above slow modes"
        found.append(Finding("sign-doubtful", Light.AMBER, text, action))
    if np.isnan(gain):
        text = "the gain is never 6 dB above that at ω_180 below it"
        action = "begin the band lower; a response that is flat there has no gain bandwidth"
        found.append(Finding("gain-bandwidth", Light.UNKNOWN, text, action))
    elif gain < margin and response_type == "rate":
        text = f"the gain sets the bandwidth: {gain:.3g} rad/s, below {margin:.3g} of the phase"
        action = "a pilot who presses loses stability at once: look at the gain near ω_180"
        found.append(Finding("gain-limited", Light.AMBER, text, action))
    higher = "widen the band, or excite higher frequencies"
    if np.isnan(delay):
        text = f"twice ω_180, {2 * crossing:.3g} rad/s, lies beyond the band"
        found.append(Finding("phase-delay", Light.UNKNOWN, text, higher))
    if np.isnan(slope):
        text = f"the band ends at {curve.omega[-1]:.3g} rad/s, too near ω_180 for a slope"
        found.append(Finding("phase-slope", Light.UNKNOWN, text, higher))
    if nonlinear:
        text = (
            f"the phase beyond ω_180 is no line: phase delay {delay:.3g} s by two points, "
            f"{slope:.3g} s by its slope"
        )
        found.append(Finding("phase-nonlinear", Light.AMBER, text, "the slope is what counts"))
    if (times := len(curve.falls(-180.0))) > 1:
        text = f"the phase falls through −180° {times} times; the first counts"
        action = (
            "look at the phase there: noise, or a resonance; narrow the band around the right one"
        )
        found.append(Finding("several-crossings", Light.AMBER, text, action))
    return tuple(found)


def _coherence(data: object, pair: Pair, values: Array) -> tuple[Finding, ...]:
    """Warnings on a measured response: windows, and points of low coherence."""
    if not isinstance(data, FrequencyResponse):
        return ()
    measured = data.pair(pair.output, pair.input)
    found = (*_windows(data), *_noise(measured, values))
    low, high = 0.95 * float(np.nanmin(values[:3])), 2.0 * float(values[0])
    inside = (measured.omega_rad_s >= low) & (measured.omega_rad_s <= high)
    if not np.any(inside) or np.min(measured.coherence[inside]) >= COHERENT:
        return found
    place = np.flatnonzero(inside)[np.argmin(measured.coherence[inside])]
    text = (
        f"coherence falls to {measured.coherence[place]:.2f} at "
        f"{measured.omega_rad_s[place]:.3g} rad/s, between bandwidth and twice ω_180"
    )
    action = f"excite these frequencies more; below {COHERENT:g} the phase is a guess"
    return (*found, Finding("low-coherence", Light.AMBER, text, action))


def _noise(measured: PairResponse, values: Array) -> tuple[Finding, ...]:
    """Warning where intervals are too narrow, since the first of several crossings is read."""
    places = np.clip(
        np.searchsorted(measured.omega_rad_s, values[:2]), 0, len(measured.response) - 1
    )
    largest = float(np.max(measured.random_error[places]))
    if largest <= NOISY:
        return ()
    text = f"random error {100.0 * largest:.0f} % where the phase is read: intervals are too narrow"
    return (
        Finding("noisy-crossing", Light.AMBER, text, "average more, or fit a model and read that"),
    )


def _windows(data: FrequencyResponse) -> tuple[Finding, ...]:
    """Warning that an estimate is blurred, which no interval holds."""
    if not data.window_s or data.estimator.endswith(WITHOUT_BIAS):
        return ()
    text = "read from a response that windows blur; its intervals hold random errors alone"
    action = "read it from a model fitted to the response: identify takes the windows out"
    return (Finding("windows-blur", Light.AMBER, text, action),)
