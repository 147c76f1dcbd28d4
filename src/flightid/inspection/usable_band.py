"""The band of each axis in which a model can be supported: coherence, windows, logging rate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.inspection.axes import AxisChannels, axes_of
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.excited_to import excited_to
from flightid.inspection.injected import injected_share
from flightid.inspection.signals import Signal, Span, find
from flightid.inspection.stretches import FlightStretches, packed
from flightid.inspection.thresholds import (
    BAND_LEAST,
    CYCLES_IN_WINDOW,
    INDEPENDENT_WINDOWS,
    LONGEST_WINDOW,
    MINIMUM_COHERENCE,
    SAMPLES_PER_CYCLE,
    SAMPLES_PER_CYCLE_LEAST,
)
from flightid.logs import Log
from flightid.record import Record
from flightid.responses.bands import coherent_parts
from flightid.responses.estimators.composite import Composite
from flightid.responses.running import SpectralSum

OF_WINDOW = 2.0
"""Above the lowest coherent frequency: there a window holds two cycles, and a fit wants four."""
LOOP_ALONE = (
    "what was injected explains too little of the rate (coherence of 0.6 in no half decade), so "
    "that what hangs together with the command may be gusts that the loop answers"
)
UNSWEPT_CODE = "unswept"
UNSWEPT = "in a loop without a sweep what hangs together with the command is the loop's own"
NARROW = "too narrow for more than a gain"
N_OMEGA = 60
"""Frequencies at which coherence is computed."""
SHORTENED = 6
"""Lengths of windows that are tried until enough of them are independent."""
NARROWEST = 1.2
"""Highest frequency over the lowest below which nothing is looked at."""
ROUNDING = 1e-9
"""Share by which a record may be short of a window by rounding."""
SAME_RATE = 1.01
"""Rates nearer to each other than this ratio are one: medians of stamps scatter so much."""


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
        Band in which a model is fitted, rad/s, to three digits: `coherent_rad_s` from twice its
        lowest frequency, where a window holds four cycles. None where nothing is left of it.
    coherence : float or None
        Mean partial coherence in the band; the largest anywhere where there is no band.
    largest_coherence : float or None
        Largest partial coherence at any frequency that the logging rate supports; None where none
        was computed.
    reason : str
        Why there is no band; empty where there is one.
    excited_to_rad_s : float
        Where the power of the sweeps of this axis ends, rad/s; infinite without any.
    coherent_rad_s : tuple of float, or None
        Widest band in which the partial coherence reaches 0.6 with at least five independent
        windows and ten samples a cycle, and that ends where the power of the sweeps does, rad/s.
    rates_hz : tuple of float, or None
        Rates of input and output, Hz; None where one is missing.
    injected_coherence : float or None
        Largest coherence of the rate with what was injected, where that leaves no band.
    """

    axis: str
    input: str
    output: str
    rate_hz: float
    band_rad_s: tuple[float, float] | None
    coherence: float | None
    reason: str = ""
    largest_coherence: float | None = None
    excited_to_rad_s: float = math.inf
    coherent_rad_s: tuple[float, float] | None = None
    rates_hz: tuple[float, float] | None = None
    injected_coherence: float | None = None

    @property
    def logged(self) -> str:
        """What is logged how fast, the slower of the two first; empty where one is missing.

        Example
        -------
        >>> AxisBand("roll", "RATE.ROut", "RATE.R", 9.62, None, None, rates_hz=(9.62, 31.25)).logged
        'RATE.ROut is logged at 9.62 Hz and RATE.R at 31.25 Hz'
        """
        if self.rates_hz is None:
            return ""
        slow, fast = sorted(zip(self.rates_hz, (self.input, self.output), strict=True))
        if fast[0] < SAME_RATE * slow[0]:
            return f"{self.input} and {self.output} are logged at {slow[0]:.4g} Hz"
        return f"{slow[1]} is logged at {slow[0]:.4g} Hz and {fast[1]} at {fast[0]:.4g} Hz"

    @property
    def words(self) -> str:
        """The band in Hz; empty without one."""
        return hertz_words(self.band_rad_s) if self.band_rad_s else ""

    @property
    def is_usable(self) -> bool:
        """Whether what is coherent is wide enough for a model."""
        if self.band_rad_s is None:
            return False
        low, high = self.coherent_rad_s or self.band_rad_s
        return high / low >= BAND_LEAST.value

    @property
    def told_rad_s(self) -> tuple[float, float] | None:
        """Band of fits, or what is coherent where that is too narrow for one, rad/s."""
        return self.band_rad_s if self.is_usable else self.coherent_rad_s or self.band_rad_s

    @property
    def span(self) -> float:
        """Highest over lowest frequency of the band; 0 without one."""
        return self.band_rad_s[1] / self.band_rad_s[0] if self.band_rad_s else 0.0


def hertz_words(band_rad_s: tuple[float, float]) -> str:
    """A band as people say it, everywhere.

    Example
    -------
    >>> hertz_words((1.35, 23.6))
    '0.215 to 3.76 Hz'
    """
    low, high = (each / math.tau for each in band_rad_s)
    return f"{low:.3g} to {high:.3g} Hz"


@dataclass(frozen=True, eq=False)
class AxesCoherence:
    """What commands explain of the rates, of all axes at once.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
    inputs, outputs : tuple of str
        Commands that moved, and rates.
    composite : Composite
        Of every rate with every command.
    cut : str
        What gaps did to the windows; empty where none cut a span.
    """

    omega_rad_s: NDArray[np.float64]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    composite: Composite
    cut: str


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
    One that nobody swept has none: command and rate hang together by the controller.
    """
    axes = axes_of(log.vehicle)
    held = packed(_found(log, [name for names in axes.values() for name in names[:2]]))
    by_name = {signal.name: signal for signal in held}
    inputs = {axis: by_name.get(names.command) for axis, names in axes.items()}
    outputs = {axis: by_name.get(names.rate) for axis, names in axes.items()}
    present = [axes[axis] for axis in axes if inputs[axis] and outputs[axis]]
    signals = tuple(by_name[name] for names in present for name in names[:2])
    known: dict[tuple[Span, ...], AxesCoherence | str] = {}
    found = []
    for axis, (tau, rate, _) in axes.items():
        command, motion = inputs[axis], outputs[axis]
        if command is None or motion is None:
            both = (("mixer command", command), ("body rate", motion))
            absent = [name for name, signal in both if signal is None]
            missing = f"{' and '.join(absent)} {'are' if absent[1:] else 'is'} not logged"
            found.append(AxisBand(axis, "", "", 0.0, None, None, missing))
            continue
        own = tuple((e.start_s, e.stop_s) for e in excited if e.is_injected and e.axis == axis)
        chosen = own or spans
        if chosen not in known:
            known[chosen] = _explained(signals, present, chosen)
        explained = known[chosen]
        slowest = min(command.rate_hz, motion.rate_hz)
        labels = (command.label, motion.label)
        coherent, coherence, largest, injected, why = None, None, None, None, ""
        highest = excited_to(log, axis, excited)
        if isinstance(explained, str):
            why = explained
        elif tau in explained.inputs:
            coherent, coherence, largest, reason = _band(explained, rate, tau, slowest, highest)
            why = f"{reason}{explained.cut}" if reason else ""
        else:
            why = f"{labels[0]} did not move"
        band = None if coherent is None else _fitted(coherent)
        if coherent is not None and band is None:
            why = f"coherence reaches 0.6 from {hertz_words(coherent)} alone: too narrow for a fit"
        if band is not None:
            share = injected_share(log, axis, excited, motion, highest)
            if share is not None and share.width < BAND_LEAST.value:
                band, coherent, why, injected = None, None, LOOP_ALONE, share.largest
        if coherent is not None and not any(e.axis == axis and e.is_sweep for e in excited):
            band, coherent, coherence, why = None, None, largest, UNSWEPT
        rates_hz = command.rate_hz, motion.rate_hz
        told = band, coherence, why, largest, highest, coherent, rates_hz, injected
        found.append(AxisBand(axis, labels[0], labels[1], slowest, *told))
    return tuple(found)


def _fitted(coherent: Span) -> Span | None:
    """Band of a fit in a coherent one, rad/s; None where nothing is left."""
    low, high = float(f"{OF_WINDOW * coherent[0]:.3g}"), float(f"{coherent[1]:.3g}")
    return (low, high) if low < high else None


def _found(log: Log, names: list[str]) -> Iterator[Signal]:
    """Signals that the log holds, one after the other."""
    return (signal for name in names if (signal := find(log, name)) is not None)


def _explained(
    signals: tuple[Signal, ...], axes: list[AxisChannels], spans: tuple[Span, ...]
) -> AxesCoherence | str:
    """Coherence of all axes at once, or the reason where that is not possible."""
    commands, outputs = [axis.command for axis in axes], [axis.rate for axis in axes]
    if not spans or not axes:
        return "nothing was flown" if axes else "no axis has command and rate logged"
    stretches = FlightStretches(signals, frozenset(commands), spans)
    # A long flight is read twice, for it is not held.
    flown: Iterable[Record] = stretches if stretches.are_long else list(stretches)
    lengths, moved, step_s = [], set(), 0.0
    for record in flown:
        step_s = step_s or record.sample_time_s
        lengths.append(record.duration_s)
        moved |= {name for name in commands if np.ptp(record[name]) > 0}
    inputs = [name for name in commands if name in moved]
    if not inputs:
        return "no command moved" if lengths else "no span holds command and rate together"
    # Conditioning on each other input costs one independent window.
    wanted = INDEPENDENT_WINDOWS.value + len(inputs) - 1
    cut = _cut(lengths, stretches)
    found: AxesCoherence | str = "no window"
    ends = _longest_window(lengths, wanted), _whole_window(lengths, wanted)
    # Parts of windows count for less than their length; where the longest of the windows weighs
    # most, enough at other frequencies alone tears a band apart.
    some: AxesCoherence | str = ""
    for window in np.geomspace(*ends, SHORTENED):
        found = _of_windows(flown, (tuple(inputs), tuple(outputs)), float(window), step_s, cut)
        if isinstance(found, str):
            break
        enough = _enough(found.composite.n_independent)
        if np.all(enough):
            return found
        some = some or (found if np.any(enough) else "")
    return some or found


def _of_windows(
    flown: Iterable[Record],
    names: tuple[tuple[str, ...], tuple[str, ...]],
    window_s: float,
    step_s: float,
    cut: str,
) -> AxesCoherence | str:
    """Coherence of outputs with inputs by windows of one length, and of half of it."""
    inputs, outputs = names
    low = CYCLES_IN_WINDOW.value * 2.0 * math.pi / window_s
    high = 2.0 * math.pi / (step_s * SAMPLES_PER_CYCLE_LEAST.value)
    if high < NARROWEST * low:
        return (
            f"the windows reach down to {low / (2 * math.pi):.3g} Hz, the sampling up to "
            f"{high / (2 * math.pi):.3g} Hz: no band is left{cut}"
        )
    omega = np.geomspace(low, high, N_OMEGA)
    windows = [window_s, window_s / 2] if high > 4 * low else [window_s]
    total = SpectralSum((*inputs, *outputs), windows, omega, step_s)
    for record in flown:
        if record.duration_s >= window_s:
            total.add({name: record[name] for name in (*inputs, *outputs)})
    try:
        found = total.composite(list(inputs), list(outputs))
    except FlightidError as error:
        return error.problem
    return AxesCoherence(omega, inputs, outputs, found, cut)


def _enough(n_independent: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where five independent windows stand behind an estimate."""
    return np.asarray(n_independent >= INDEPENDENT_WINDOWS.value - 0.5)


def _longest_window(lengths: list[float], windows: float) -> float:
    """The longest window of which the records that hold it give enough, s, up to the cap.

    Records shorter than it are scraps: no window lies in them.
    """
    ordered = np.sort(lengths)[::-1]
    reach = np.minimum(ordered, np.cumsum(ordered) / windows)
    return min(float(reach.max()), LONGEST_WINDOW.value)


def _whole_window(lengths: list[float], windows: float) -> float:
    """The longest window that lies so often in the records without a part of one, s, up to the cap.

    A record of one window and a half holds one that is independent.
    """
    count = math.ceil(windows)
    candidates = np.concatenate([np.array(lengths) / k for k in range(1, count + 1)])
    held = np.floor(np.array(lengths) / candidates[:, None] * (1.0 + ROUNDING)).sum(axis=1)
    return min(float(candidates[held >= count].max()), LONGEST_WINDOW.value)


def _cut(lengths: list[float], flown: FlightStretches) -> str:
    """What gaps did to the windows; empty where none cut a span."""
    if len(lengths) <= flown.n_parts:
        return ""
    pieces = len(lengths) - flown.n_parts + len(flown.spans)
    return (
        f"; gaps cut the flight into {pieces} pieces, the longest "
        f"{max(lengths):.2g} s: close them first"
    )


def _band(
    explained: AxesCoherence, output: str, tau: str, rate_hz: float, highest: float
) -> tuple[tuple[float, float] | None, float | None, float | None, str]:
    row, column = explained.outputs.index(output), explained.inputs.index(tau)
    omega, found = explained.omega_rad_s, explained.composite
    enough = _enough(found.n_independent[row, column])
    coherence = np.where(enough, found.coherence[row, column], 0.0)
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
    excited = fast_enough & (omega <= highest)
    if not np.any(excited):
        return None, None, None, "the sweep ends below the lowest frequency that its length tells"
    parts = coherent_parts(omega[fast_enough], coherence[fast_enough], MINIMUM_COHERENCE.value)
    clipped = [(low, min(high, highest)) for low, high in parts]
    wide = [part for part in clipped if part[1] > part[0]]
    band = max(wide, key=lambda part: part[1] / part[0]) if wide else None
    largest = float(coherence[excited].max())
    if band is None:
        # Rounded down, so that what stays below the limit is not written as the limit.
        size = f"(largest {math.floor(100.0 * largest) / 100.0:.2f})"
        reached = largest >= MINIMUM_COHERENCE.value
        why = "reaches 0.6 at single frequencies only" if reached else "stays below 0.6"
        return None, largest, largest, f"partial coherence {why} {size}"
    low, high = _fitted(band) or band
    within = (omega >= low) & (omega <= high)
    if not np.any(within):
        within = (omega >= band[0]) & (omega <= band[1])
    return band, float(np.mean(coherence[within])), largest, ""
