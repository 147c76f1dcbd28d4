"""What injected sweeps reach of a record: the band of a response, and inputs that none moves."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record import Record
from flightid.study.proposal.stretches import rounded
from flightid.study.proposal.structures_of import CYCLES, SAMPLES_PER_CYCLE, GroupScans

Inside = NDArray[np.bool_]
REACHED = 0.01
"""Part of a sweep's power that may lie beyond either end of the band."""


def swept_band(asked: GroupScans) -> tuple[float, float] | None:
    """Band of a response by way of what was injected, rad/s: what all sweeps reach as fitted.

    None where the stretch is too short for one.
    """
    parts = _fitted(asked)
    low, high = _resolved(*parts[0])
    for name in asked.scans.injected:
        moved = [(r[name][at], r.sample_rate_hz) for r, at in parts if _moves(r, at, name)]
        ends = [reached(*each) for each in moved]
        if ends:
            low = max(low, min(first for first, _ in ends))
            high = min(high, max(last for _, last in ends))
    return (rounded(low), rounded(high)) if high > 2.0 * low else None


def unswept(inputs: tuple[str, ...], asked: GroupScans) -> list[Finding]:
    """That fewer sweeps move in what was flown than the equations have inputs: no fit takes that.

    Records are judged whole: what is fitted of one keeps every sweep.

    Parameters
    ----------
    inputs : tuple of str
        Of the equations, those that stand still among them.
    asked : GroupScans
    """
    injected, flown = asked.scans.injected, [record for record, _ in _fitted(asked)]
    moved = [n for n in injected if any(n in r and np.ptp(r[n]) > 0.0 for r in flown)]
    missing = len(inputs) - len(moved)
    if not injected or missing <= 0:
        return []
    still = [each for each in inputs if not any(_is_of(name, each) for name in moved)]
    which = ", ".join(still) if len(still) == missing else f"{missing} of {', '.join(inputs)}"
    said = (
        f"{which}: not swept, {', '.join(moved) or 'nothing'} alone is, and a fit by way of what "
        "was injected is refused without a sweep of each input"
    )
    action = "fly a sweep of each, or of the others beside this flight, and write the study anew"
    return [Finding("inputs-unswept", Light.RED, said, action)]


def all_fitted(asked: GroupScans) -> list[Finding]:
    """That nothing stays unseen, where a record has one sweep of each input and no other is there.

    Parameters
    ----------
    asked : GroupScans
    """
    if asked.segments.unseen:
        return []
    said = (
        f"a stretch to verify on: every cut of {asked.group.parts[0].name} leaves an input without "
        "its only sweep, or nothing that moves, so all of it is fitted"
    )
    action = "fly a second flight, sweeps or doublets, and write the study of both files"
    return [Finding("nothing-unseen", Light.AMBER, said, action)]


def _fitted(asked: GroupScans) -> list[tuple[Record, Inside]]:
    """Records that are fitted, and which of their samples."""
    segments = asked.segments
    names = segments.together or (segments.fitted,)
    found = []
    for name, part, span in segments.all:
        if name in names:
            time_s = part.record.time_s
            start, stop = span or (float(time_s[0]), float(time_s[-1]))
            found.append((part.record, (time_s >= start) & (time_s <= stop)))
    return found


def _resolved(record: Record, inside: Inside) -> tuple[float, float]:
    """What a response of so many samples can tell at all, rad/s."""
    rate_hz = record.sample_rate_hz
    span_s = (np.count_nonzero(inside) - 1) / rate_hz
    return CYCLES * math.tau / span_s, math.tau * rate_hz / SAMPLES_PER_CYCLE


def _moves(record: Record, inside: Inside, name: str) -> bool:
    return name in record and bool(np.ptp(record[name][inside]) > 0.0)


def _is_of(injected: str, channel: str) -> bool:
    """Whether an injected channel bears the name of an input, as sweep_lat does of lat."""
    return injected == channel or injected.endswith(f"_{channel}")


def reached(samples: NDArray[np.float64], rate_hz: float) -> tuple[float, float]:
    """Frequencies between which all but `REACHED` at either end of a channel's power lies."""
    power = np.abs(np.fft.rfft(samples - np.mean(samples))) ** 2
    share = np.cumsum(power) / np.sum(power)
    omega = math.tau * np.fft.rfftfreq(len(samples), 1.0 / rate_hz)
    first, last = np.searchsorted(share, (REACHED, 1.0 - REACHED))
    return float(omega[max(int(first), 1)]), float(omega[min(int(last), len(omega) - 1)])
