"""Filters: zero-phase and causal, the same for all channels unless said otherwise."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conditioning.detrend import chosen_channels
from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.record import Record, Step
from flightid.table import Cell


class FilterDesign(StrEnum):
    """Butterworth (recursive, maximally flat) or FIR (Hamming window, linear phase).

    Example
    -------
    >>> FilterDesign("fir")
    <FilterDesign.FIR: 'fir'>
    """

    BUTTERWORTH = "butterworth"
    FIR = "fir"


Band = Literal["lowpass", "highpass", "bandpass", "bandstop"]
BANDS = ("lowpass", "highpass", "bandpass", "bandstop")
LOWEST = 1e-6
"""Lowest cut-off over the sample rate: below it a filter's poles are one in double precision."""


@dataclass(frozen=True)
class _Filter:
    sections: NDArray[np.float64] | None
    taps: NDArray[np.float64] | None

    def apply(self, values: NDArray[np.float64], *, zero_phase: bool) -> NDArray[np.float64]:
        if self.sections is not None and zero_phase:
            return np.asarray(scipy.signal.sosfiltfilt(self.sections, values))
        if self.sections is not None:
            # Start in the steady state of the first sample: a filter at rest would ring.
            state = scipy.signal.sosfilt_zi(self.sections) * values[0]
            return np.asarray(scipy.signal.sosfilt(self.sections, values, zi=state)[0])
        taps = np.asarray(self.taps)
        half = (taps.size - 1) // 2
        if zero_phase:
            padded = np.pad(values, half, mode="reflect", reflect_type="odd")
            return np.asarray(scipy.signal.oaconvolve(padded, taps, mode="valid"))
        padded = np.concatenate([np.full(taps.size - 1, values[0]), values])
        return np.asarray(scipy.signal.oaconvolve(padded, taps, mode="valid"))

    def delay_samples(self, frequency: float) -> float:
        """Group delay at a frequency in cycles per sample."""
        if self.taps is not None:
            return (self.taps.size - 1) / 2
        total = 0.0
        for section in np.asarray(self.sections):
            _, delay = scipy.signal.group_delay((section[:3], section[3:]), [2 * np.pi * frequency])
            total += float(delay[0])
        return total


def filter_record(
    record: Record,
    cutoff_hz: float | tuple[float, float],
    *,
    kind: Band = "lowpass",
    design: FilterDesign | str = FilterDesign.BUTTERWORTH,
    order: int = 4,
    zero_phase: bool = True,
    channels: Iterable[str] | None = None,
) -> Record:
    """Filter channels, all alike by default so that responses between them stay unbiased.

    Zero phase: Butterworth sections run forward and backward (the gain is squared: −6 dB at the
    cut-off, twice the order); an FIR filter is shifted by its half length (−6 dB at the cut-off).
    Causal: the group delay in the pass band is in the history as ``delay_s``.

    Assumes: the record is long against the filter's memory; the ends are continued by odd
    reflection (zero phase) or by the first value (causal). Biased when: only the output or only
    the input of a pair is filtered; the filter then becomes part of the model.

    Parameters
    ----------
    record : Record
        Data.
    cutoff_hz : float or (float, float)
        Cut-off frequency, Hz; two for ``"bandpass"`` and ``"bandstop"``.
    kind : {"lowpass", "highpass", "bandpass", "bandstop"}
        What passes.
    design : FilterDesign
        ``"butterworth"`` or ``"fir"``.
    order : int
        Order of the Butterworth prototype, or the even number of taps less one.
    zero_phase : bool
        Zero phase rather than causal.
    channels : iterable of str, optional
        Channels to act on; default: all.

    Raises
    ------
    OptionError
        A cut-off outside (0, Nyquist), an odd or absurd order, an unknown band or design.
    DataError
        The record is shorter than the filter.
    UnknownNameError
        There is no such channel.

    Reference
    ---------
    Oppenheim & Schafer, Discrete-Time Signal Processing (3rd ed.), sections 7.2 and 7.5;
    Gustafsson (1996), IEEE Trans. Signal Processing 44(4), on forward-backward filtering.

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(500) / 100
    >>> record = Record.from_arrays(time_s, outputs={"p": np.sin(2 * np.pi * time_s)})
    >>> smooth = filter_record(record, 20.0)
    >>> bool(np.max(np.abs(smooth["p"] - record["p"])) < 1e-3)
    True
    """
    made = _design(record.sample_rate_hz, cutoff_hz, kind, design, order)
    length = order + 1 if made.taps is not None else 3 * (2 * len(np.asarray(made.sections)) + 1)
    if record.n_samples <= length:
        raise DataError(
            "the record is shorter than the filter",
            found=f"{record.n_samples} samples",
            needed=f"more than {length}",
            action="lower the order, or take a longer segment",
        )
    names = chosen_channels(record, channels)
    samples = {name: made.apply(record[name], zero_phase=zero_phase) for name in names}
    low, high = cutoff_hz if isinstance(cutoff_hz, tuple) else (cutoff_hz, None)
    options: dict[str, Cell] = {
        "band": kind,
        "cutoff_hz": low,
        "upper_cutoff_hz": high,
        "design": str(FilterDesign(design)),
        "order": order,
        "zero_phase": zero_phase,
        "channels": "all" if channels is None else ", ".join(names),
        "delay_s": 0.0 if zero_phase else _delay_s(made, record, kind, low, high),
    }
    # Inputs and outputs filtered alike keep the sampled relation that their hold made; an input
    # filtered by itself no longer moves as it did.
    alike = set(names) >= {*record.inputs, *record.outputs} or not set(names) & set(record.inputs)
    return record.replace(
        samples,
        step=Step("conditioning.filter_record", options),
        input_shape=record.input_shape if alike else record.input_shape.without_hold(),
    )


def _design(
    rate_hz: float,
    cutoff_hz: float | tuple[float, float],
    band: Band,
    design: FilterDesign | str,
    order: int,
) -> _Filter:
    if band not in BANDS:
        raise OptionError("band is not known", found=repr(band), needed=", ".join(BANDS))
    edges = np.atleast_1d(np.asarray(cutoff_hz, dtype=np.float64))
    n_edges = 2 if band.startswith("band") else 1
    if edges.size != n_edges or not (edges[0] >= LOWEST * rate_hz and edges[-1] < rate_hz / 2):
        raise OptionError(
            f"cut-off does not suit a {band} filter",
            found=f"{cutoff_hz} Hz",
            needed=f"{n_edges} of {LOWEST * rate_hz:g} Hz to {rate_hz / 2:g} Hz",
        )
    if n_edges == 2 and edges[0] >= edges[1]:
        raise OptionError("cut-offs are not in order", found=cutoff_hz, needed="(low, high)")
    try:
        kind = FilterDesign(design)
    except ValueError:
        raise OptionError(
            "filter design is not known", found=repr(design), needed="'butterworth' or 'fir'"
        ) from None
    if kind is FilterDesign.BUTTERWORTH:
        if not 1 <= order <= 12:
            raise OptionError("order is out of range", found=order, needed="1 to 12")
        made = scipy.signal.butter(
            order, edges if n_edges == 2 else edges[0], band, fs=rate_hz, output="sos"
        )
        return _Filter(np.asarray(made), None)
    if order < 2 or order % 2:
        raise OptionError("order of an FIR filter is not even", found=order, needed="2, 4, 6, …")
    taps = scipy.signal.firwin(order + 1, edges, pass_zero=band, fs=rate_hz)
    return _Filter(None, np.asarray(taps))


def _delay_s(made: _Filter, record: Record, band: str, low: float, high: float | None) -> float:
    """Group delay in the pass band: near zero frequency, mid band, or well above the cut-off."""
    frequency_hz = {
        "lowpass": 1e-3 * low,
        "bandpass": float(np.sqrt(low * (high or low))),
        "bandstop": 1e-3 * low,
        "highpass": (low + record.sample_rate_hz / 2) / 2,
    }[band]
    return made.delay_samples(frequency_hz * record.sample_time_s) * record.sample_time_s
