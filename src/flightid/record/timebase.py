"""One uniform time base from channels that each have their own stamps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.reading import VARIABLE, memory_budget
from flightid.record.hold import InputHold
from flightid.record.interpolation import Interpolation, sample_at
from flightid.record.stamps import GAP_FACTOR, StampedSamples, StampPolicy, stamped
from flightid.record.uniform_base import ChannelResampling, UniformBase, UniformSpan, doubts
from flightid.table import Cell

Policy = TypeVar("Policy", bound=StrEnum)


class GapPolicy(StrEnum):
    """What to do where a channel has no sample for long.

    A gap is a spacing above 2.5 median spacings of the channel (or above `max_gap_s`, for `ERROR`
    and `SPLIT`). `ERROR` refuses; `SPLIT` returns one span on each side; `INTERPOLATE` bridges
    gaps up to `max_gap_s` with straight lines and refuses longer ones.

    Example
    -------
    >>> [policy.value for policy in GapPolicy]
    ['error', 'split', 'interpolate']
    """

    ERROR = "error"
    SPLIT = "split"
    INTERPOLATE = "interpolate"


def to_uniform(
    channels: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    sample_time_s: float | None = None,
    reference: str | None = None,
    span_s: tuple[float, float] | None = None,
    gaps: GapPolicy | str = GapPolicy.ERROR,
    max_gap_s: float | None = None,
    stamps: StampPolicy | str = StampPolicy.ERROR,
    interpolation: Interpolation | str | Mapping[str, Interpolation | str] = "band-limited",
    hold: Mapping[str, InputHold] | None = None,
) -> UniformBase:
    """Bring stamped channels to one uniform time base.

    A channel that is faster than the grid is low-passed with zero phase below the grid's Nyquist
    frequency (pass band to 80 % of it, 100 dB stop band); a slower one is interpolated as chosen.
    The grid starts at the first instant that all channels cover. A channel that already lies on
    the grid is copied, bit for bit.

    Parameters
    ----------
    channels : mapping of str to (time_s, values)
        Stamps, s, and samples of each channel, shape (n,); n differs between channels. Samples
        that are not finite count as missing, and the gap policy judges the hole they leave.
    sample_time_s : float, optional
        Spacing of the grid, s.
    reference : str, optional
        Channel whose median stamp spacing becomes the grid's spacing. Exactly one of
        `sample_time_s` and `reference` is given: no sample time is invented.
    span_s : (float, float), optional
        First and last instant, s; default: what all channels cover.
    gaps : GapPolicy
        What to do where a channel has a gap.
    max_gap_s : float, optional
        Longest spacing that is bridged, s; required with `INTERPOLATE`.
    stamps : StampPolicy
        What to do with repeated and backward stamps.
    interpolation : Interpolation or mapping of str to Interpolation
        How samples arise between stamps, for all channels or by name (others: band-limited).
    hold : mapping of str to {"zero", "first", "band_limited"}, optional
        What is known of channels between their stamps: the low-pass is then that of the steps or
        the straight lines, without which a held channel comes half of its own sample too early.

    Raises
    ------
    OptionError
        Neither or both of `sample_time_s` and `reference`; a spacing that is not positive, or
        so short that the grid takes more than the memory budget.
    UnknownNameError
        `reference` or a key of `interpolation` is not a channel.
    DataError
        Disordered stamps, gaps, or channels without a common span.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 9 (sampling and anti-aliasing);
    Oppenheim & Schafer, Discrete-Time Signal Processing (3rd ed.), section 4.6.

    Example
    -------
    >>> import numpy as np
    >>> fast, slow = np.arange(0, 2, 0.001), np.arange(0, 2, 0.02)
    >>> base = to_uniform({"p": (fast, np.sin(5 * fast)), "tau": (slow, np.cos(5 * slow))},
    ...                   sample_time_s=0.01)
    >>> base.only.time_s.size, sorted(base.only.samples)
    (199, ['p', 'tau'])
    """
    gap_policy = _choice(GapPolicy, gaps, "gap policy")
    stamp_policy = _choice(StampPolicy, stamps, "stamp policy")
    methods = _methods(channels, interpolation)
    if gap_policy is GapPolicy.INTERPOLATE and max_gap_s is None:
        raise OptionError(
            "interpolation over gaps needs a limit", needed="max_gap_s, the longest gap bridged"
        )
    checked = {key: stamped(key, *pair, stamp_policy) for key, pair in channels.items()}
    step = _grid_step(checked, sample_time_s, reference)
    start, stop = _common_span(checked, span_s)
    pieces = _pieces(checked.values(), start, stop, gap_policy, max_gap_s)
    spans: list[UniformSpan] = []
    done: dict[str, str] = {}
    short = 0
    _require_samples(step, sum(last - first for first, last in pieces), len(checked))
    for first, last in pieces:
        grid = _grid(start, step, first, last)
        if grid.size < 2:
            short += 1
            continue
        samples = {}
        for key, channel in checked.items():
            part = _stretch(channel, first, last, gap_policy, max_gap_s)
            samples[key], done[key] = sample_at(
                part, grid, step, methods[key], (hold or {}).get(key)
            )
        spans.append(UniformSpan(grid, samples))
    if not spans:
        raise DataError(
            "no span holds two samples of the grid",
            found=f"{len(pieces)} spans between gaps, sample time {step:.6g} s",
            needed="a span longer than two sample times",
        )
    options: dict[str, Cell] = {
        "sample_time_s": step,
        "reference": reference,
        "gaps": str(gap_policy),
        "max_gap_s": max_gap_s,
        "stamps": str(stamp_policy),
        **{f"{key}": text for key, text in done.items()},
    }
    account = tuple(
        ChannelResampling(
            key,
            channel.sample_time_s,
            channel.jitter,
            channel.n_disordered,
            channel.n_missing,
            len(channel.gaps()),
            done[key],
        )
        for key, channel in checked.items()
    )
    return UniformBase(step, tuple(spans), account, options, doubts(account, gap_policy, short))


def _choice(kind: type[Policy], value: Policy | str, subject: str) -> Policy:
    try:
        return kind(value)
    except ValueError:
        raise OptionError(
            f"{subject} is not known", found=repr(value), needed="one of " + ", ".join(kind)
        ) from None


def _methods(
    channels: Iterable[str], interpolation: Interpolation | str | Mapping[str, Interpolation | str]
) -> dict[str, Interpolation]:
    names = list(channels)
    if not names:
        raise OptionError("there is no channel to resample", needed="at least one")
    if isinstance(interpolation, str):
        return dict.fromkeys(names, _choice(Interpolation, interpolation, "interpolation"))
    for key in interpolation:
        if key not in names:
            raise UnknownNameError(
                "interpolation names no channel", found=key, needed="one of " + ", ".join(names)
            )
    return {
        key: _choice(Interpolation, interpolation.get(key, "band-limited"), "interpolation")
        for key in names
    }


def _grid_step(
    channels: Mapping[str, StampedSamples], sample_time_s: float | None, reference: str | None
) -> float:
    if (sample_time_s is None) == (reference is None):
        raise OptionError(
            "the sample time must be named in one way",
            found="neither" if reference is None else "both",
            needed="either sample_time_s or reference, the channel whose median spacing it is",
        )
    if reference is not None:
        if reference not in channels:
            raise UnknownNameError(
                "the reference is no channel",
                found=reference,
                needed="one of " + ", ".join(channels),
            )
        return channels[reference].median_spacing_s
    step = float(sample_time_s or 0.0)
    if not (np.isfinite(step) and step > 0):
        raise OptionError("sample time is not positive", found=sample_time_s, needed="above 0 s")
    return step


def _common_span(
    channels: Mapping[str, StampedSamples], span_s: tuple[float, float] | None
) -> tuple[float, float]:
    begins = {key: float(c.time_s[0]) for key, c in channels.items()}
    ends = {key: float(c.time_s[-1]) for key, c in channels.items()}
    late, early = max(begins, key=lambda key: begins[key]), min(ends, key=lambda key: ends[key])
    start, stop = (begins[late], ends[early]) if span_s is None else span_s
    if start < begins[late] or stop > ends[early] or stop <= start:
        raise DataError(
            "the channels do not cover the span",
            found=f"{late!r} begins at {begins[late]:.6f} s, {early!r} ends at {ends[early]:.6f} s",
            needed="channels that overlap" if span_s is None else f"{start} s to {stop} s",
            action="leave out the channel that is too short, or choose another span",
        )
    return start, stop


def _pieces(
    channels: Iterable[StampedSamples],
    start: float,
    stop: float,
    policy: GapPolicy,
    max_gap_s: float | None,
) -> list[tuple[float, float]]:
    """Spans between gaps, in order."""
    holes = [
        (max(gap[0], start), min(gap[1], stop), channel)
        for channel in channels
        for gap in channel.gaps(max_gap_s)
        if gap[1] > start and gap[0] < stop
    ]
    if not holes:
        return [(start, stop)]
    pieces = []
    begin = start
    for first, last, _ in sorted(holes, key=lambda hole: (hole[0], hole[1])):
        if first > begin:
            pieces.append((begin, first))
        begin = max(begin, last)
    if begin < stop:
        pieces.append((begin, stop))
    if policy is not GapPolicy.SPLIT:
        first, last, channel = max(holes, key=lambda hole: hole[1] - hole[0])
        limit = GAP_FACTOR * channel.median_spacing_s if max_gap_s is None else max_gap_s
        raise DataError(
            f"channel {channel.name!r} has a gap",
            found=f"{len(holes)} gaps in all, the longest {last - first:.6g} s at {first:.6f} s",
            needed=f"spacings of at most {limit:.6g} s",
            action=_longest(pieces) + "choose the gap policy 'split', or 'interpolate' with a "
            "longer max_gap_s",
        )
    return pieces


def _longest(pieces: Sequence[tuple[float, float]]) -> str:
    """The longest piece between gaps, as the option that takes it alone; empty where none is."""
    if not pieces:
        return ""
    low, high = max(pieces, key=lambda piece: piece[1] - piece[0])
    # Inside by a hundredth of a second: a rounded end shall not reach into the gap.
    low, high = math.ceil(100.0 * low) / 100.0, math.floor(100.0 * high) / 100.0
    if high <= low:
        return ""
    return f"take the longest piece without one ({high - low:.3g} s: span_s=[{low}, {high}]), or "


def _stretch(
    channel: StampedSamples, first: float, last: float, policy: GapPolicy, max_gap_s: float | None
) -> StampedSamples:
    """The channel around a piece, as far as its own gaps: filters need the neighbours."""
    if policy is not GapPolicy.SPLIT:
        return channel.bridged()
    low, high = float(channel.time_s[0]), float(channel.time_s[-1])
    for begin, end in channel.gaps(max_gap_s):
        if end <= first:
            low = max(low, end)
        if begin >= last:
            high = min(high, begin)
    return channel.within(low, high).bridged()


def _require_samples(step: float, span_s: float, n_channels: int) -> None:
    """Refuse a grid of more than the memory budget, before it is made."""
    n_bytes = 8.0 * (1 + n_channels) * span_s / step
    if n_bytes > memory_budget():
        raise OptionError(
            f"the grid of sample_time_s={step:g} takes more than the memory budget",
            found=f"{span_s / step:.3g} samples, {n_bytes / (1 << 20):,.0f} MiB",
            needed=f"at most {memory_budget() >> 20:,} MiB",
            action=f"take a longer sample time (resample_to_s), or allow more by {VARIABLE}",
        )


def _grid(start: float, step: float, first: float, last: float) -> NDArray[np.float64]:
    """Points of the one grid ``start + k step`` inside a piece."""
    low = int(np.ceil((first - start) / step - 1e-6))
    high = int(np.floor((last - start) / step + 1e-6))
    return np.asarray(start + step * np.arange(low, high + 1), dtype=np.float64)
