"""The band of each axis in which a model can be supported: coherence, windows, logging rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flightid.errors import FlightidError
from flightid.inspection.axes import AxisChannels, axes_of
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Span, find, records
from flightid.inspection.thresholds import (
    CYCLES_IN_WINDOW,
    INDEPENDENT_WINDOWS,
    MINIMUM_COHERENCE,
    SAMPLES_PER_CYCLE,
    SAMPLES_PER_CYCLE_LEAST,
)
from flightid.logs import Log
from flightid.record import Record
from flightid.responses import FrequencyResponse, estimate_response
from flightid.responses.bands import usable_band
from flightid.surface import speaking


@dataclass(frozen=True)
class AxisBand:
    """What one axis can support.

    Attributes
    ----------
    axis : str
        ``"roll"``, ``"pitch"`` or ``"yaw"``.
    input, output : str
        Where they were logged; empty where they were not.
    rate_hz : float
        Rate of the slower of the two, Hz; 0 where one is missing.
    band_rad_s : tuple of float, or None
        Widest band in which the partial coherence reaches 0.6 with at least five independent
        windows and ten samples a cycle, rad/s.
    coherence : float or None
        Mean partial coherence in the band; the largest anywhere where there is no band.
    largest_coherence : float or None
        Largest partial coherence at any frequency that the logging rate supports; None where none
        was computed.
    reason : str
        Why there is no band; empty where there is one.
    """

    axis: str
    input: str
    output: str
    rate_hz: float
    band_rad_s: tuple[float, float] | None
    coherence: float | None
    reason: str = ""
    largest_coherence: float | None = None

    @property
    def span(self) -> float:
        """Highest over lowest frequency of the band; 0 without one."""
        return self.band_rad_s[1] / self.band_rad_s[0] if self.band_rad_s else 0.0


def lowest_hz(airborne_s: float) -> float:
    """Lowest frequency of which five independent windows hold two cycles each, Hz."""
    if airborne_s <= 0:
        return math.inf
    return INDEPENDENT_WINDOWS.value * CYCLES_IN_WINDOW.value / airborne_s


def axis_bands(
    log: Log, spans: tuple[Span, ...], excited: tuple[FoundExcitation, ...]
) -> tuple[AxisBand, ...]:
    """Usable band of each axis, with all mixer commands as inputs.

    An axis with injected runs is judged by them alone: windows without excitation are no evidence.
    """
    axes = axes_of(log.vehicle)
    inputs = {axis: find(log, names.command) for axis, names in axes.items()}
    outputs = {axis: find(log, names.rate) for axis, names in axes.items()}
    present = [axes[axis] for axis in axes if inputs[axis] and outputs[axis]]
    known: dict[tuple[Span, ...], tuple[FrequencyResponse | None, str]] = {}
    found = []
    for axis, (tau, rate, _) in axes.items():
        command, motion = inputs[axis], outputs[axis]
        if command is None or motion is None:
            absent = [name for name, s in ((tau, command), (rate, motion)) if s is None]
            missing = f"{' and '.join(absent)} not logged"
            found.append(AxisBand(axis, "", "", 0.0, None, None, missing))
            continue
        own = tuple((e.start_s, e.stop_s) for e in excited if e.is_injected and e.axis == axis)
        chosen = own or spans
        if chosen not in known:
            known[chosen] = _response(log, present, chosen)
        response, why = known[chosen]
        slowest = min(command.rate_hz, motion.rate_hz)
        labels = (command.label, motion.label)
        band, coherence, largest = None, None, None
        if response is not None and tau in response.inputs:
            band, coherence, largest, reason = _band(response, rate, tau, slowest)
            why = f"{reason}{why}" if reason else ""
        elif response is not None:
            why = f"{labels[0]} did not move"
        found.append(AxisBand(axis, *labels, slowest, band, coherence, why, largest))
    return tuple(found)


def _response(
    log: Log, axes: list[AxisChannels], spans: tuple[Span, ...]
) -> tuple[FrequencyResponse | None, str]:
    """Estimate all axes at once; None with the reason where that is not possible."""
    if not spans or not axes:
        return None, "nothing was flown" if axes else "no axis has command and rate logged"
    made = _records(log, axes, spans)
    inputs = [axis.command for axis in axes if _moves(made, axis.command)]
    if not inputs:
        return None, "no command moved" if made else "no span holds command and rate together"
    # Conditioning on each other input costs one independent window.
    windows = INDEPENDENT_WINDOWS.value + len(inputs) - 1
    kept = _without_scraps(made, windows)
    total = sum(record.duration_s for record in kept)
    window = min(total / windows, kept[-1].duration_s)
    low = CYCLES_IN_WINDOW.value * 2.0 * math.pi / window
    high = 2.0 * math.pi * kept[0].sample_rate_hz / SAMPLES_PER_CYCLE_LEAST.value
    if high < 1.2 * low:
        return None, (
            f"the windows reach down to {low / (2 * math.pi):.3g} Hz, the sampling up to "
            f"{high / (2 * math.pi):.3g} Hz: no band is left{_cut(made, kept, spans)}"
        )
    try:
        # Nobody reads the findings of this response: no command's options are looked up for them.
        with speaking(str):
            return estimate_response(
                kept,
                inputs=inputs,
                outputs=[axis.rate for axis in axes],
                band_rad_s=(low, high),
                n_omega=60,
                window_s=[window, window / 2] if high > 4 * low else [window],
                covariance=False,
            ), _cut(made, kept, spans)
    except FlightidError as error:
        return None, error.problem


def _records(log: Log, axes: list[AxisChannels], spans: tuple[Span, ...]) -> list[Record]:
    """Records of the spans, cut at gaps."""
    wanted = [find(log, name) for axis in axes for name in (axis.command, axis.rate)]
    signals = [signal for signal in wanted if signal is not None]
    return records(signals, {axis.command for axis in axes}, spans)


def _without_scraps(made: list[Record], windows: float) -> list[Record]:
    """The longest records, as many as give the longest windows that all of them hold."""
    ordered = sorted(made, key=lambda record: -record.duration_s)
    lengths = np.array([record.duration_s for record in ordered])
    reach = np.minimum(lengths, np.cumsum(lengths) / windows)
    return ordered[: int(np.argmax(reach)) + 1]


def _cut(made: list[Record], kept: list[Record], spans: tuple[Span, ...]) -> str:
    """What gaps did to the windows; empty where none cut a span."""
    if len(made) <= len(spans):
        return ""
    return (
        f"; gaps cut the flight into {len(made)} pieces, the longest "
        f"{kept[0].duration_s:.2g} s: close them first"
    )


def _moves(made: list[Record], name: str) -> bool:
    return any(float(np.ptp(record[name])) > 0 for record in made)


def _band(
    response: FrequencyResponse, output: str, tau: str, rate_hz: float
) -> tuple[tuple[float, float] | None, float | None, float | None, str]:
    row, column = response.outputs.index(output), response.inputs.index(tau)
    omega = response.omega_rad_s
    enough = response.n_independent[row, column] >= INDEPENDENT_WINDOWS.value - 0.5
    coherence = np.where(enough, response.coherence[row, column], 0.0)
    fast_enough = omega <= 2.0 * math.pi * rate_hz / SAMPLES_PER_CYCLE.value
    if not np.any(fast_enough):
        return (
            None,
            None,
            None,
            (
                f"logged at {rate_hz:.3g} Hz: ten samples a cycle end below the lowest frequency "
                "of which the flight holds enough cycles"
            ),
        )
    if not np.any(enough & fast_enough):
        windows = "fewer than five independent windows stand behind every frequency"
        return None, None, None, f"{windows}: coherence is not judged"
    band = usable_band(omega[fast_enough], coherence[fast_enough], MINIMUM_COHERENCE.value)
    largest = float(coherence[fast_enough].max())
    if band is None:
        # Rounded down, so that what stays below the limit is not written as the limit.
        size = f"(largest {math.floor(100.0 * largest) / 100.0:.2f})"
        reached = largest >= MINIMUM_COHERENCE.value
        why = "reaches 0.6 at single frequencies only" if reached else "stays below 0.6"
        return None, largest, largest, f"partial coherence {why} {size}"
    within = (omega >= band[0]) & (omega <= band[1])
    return band, float(np.mean(coherence[within])), largest, ""
