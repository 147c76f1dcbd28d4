"""What resampling made: spans on one uniform grid, and an account of how."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table


@dataclass(frozen=True)
class UniformSpan:
    """Channels on one uniform stretch of time.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Stamps, s.
    samples : mapping of str to ndarray, shape (n,)
        Samples by channel name.
    """

    time_s: NDArray[np.float64]
    samples: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class ChannelResampling:
    """What was found in one channel and what was done to it.

    Attributes
    ----------
    name : str
        Channel.
    source_sample_time_s : float
        Mean spacing of its stamps outside gaps, s.
    jitter : float
        Root mean square departure of the spacing from that mean, as a fraction of it.
    n_disordered, n_missing, n_gaps : int
        Samples dropped or moved for their stamps, samples that were not finite, and gaps.
    done : str
        Method, for example ``"low-pass 45 Hz, zero phase"``.
    """

    name: str
    source_sample_time_s: float
    jitter: float
    n_disordered: int
    n_missing: int
    n_gaps: int
    done: str


@dataclass(frozen=True)
class UniformBase(Result, schema="flightid.uniform_base/1"):
    """Channels on one uniform grid, in one or several spans, with an account of how.

    Attributes
    ----------
    sample_time_s : float
        Spacing of the grid, s.
    spans : tuple of UniformSpan
        One, or several where gaps split the data; all lie on the same grid.
    channels : tuple of ChannelResampling
        Account by channel.
    options : mapping
        Options for the history of a record.
    findings : tuple of Finding
        Doubts: dropped samples, bridged gaps, jitter, spans too short to keep.

    Example
    -------
    >>> import numpy as np
    >>> from flightid.record.timebase import to_uniform
    >>> fast = np.arange(100) / 100
    >>> to_uniform({"p": (fast, np.sin(fast))}, sample_time_s=0.01)
    UniformBase(1 spans, 100 samples, 100 Hz, channels [p])
    """

    sample_time_s: float
    spans: tuple[UniformSpan, ...]
    channels: tuple[ChannelResampling, ...]
    options: Mapping[str, Cell]
    findings: tuple[Finding, ...] = ()

    @property
    def only(self) -> UniformSpan:
        """The one span.

        Raises
        ------
        DataError
            There are several.
        """
        if len(self.spans) != 1:
            raise DataError(
                "the data fall into several spans",
                found=len(self.spans),
                needed="one",
                action="take the spans one by one, or choose a time window without a gap",
            )
        return self.spans[0]

    def summary(self) -> Table:
        """Table of the channels with their own rate, jitter, faults and method."""
        columns = (
            Column("channel"),
            Column("source rate", "Hz"),
            Column("jitter", "%"),
            Column("disordered"),
            Column("missing"),
            Column("gaps"),
            Column("method"),
        )
        rows = tuple(
            (
                c.name,
                1 / c.source_sample_time_s,
                100 * c.jitter,
                c.n_disordered,
                c.n_missing,
                c.n_gaps,
                c.done,
            )
            for c in self.channels
        )
        return Table(repr(self), columns, rows, tuple(map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        return {
            "spans": [
                [float(span.time_s[0]), float(span.time_s[-1]), span.time_s.size]
                for span in self.spans
            ],
        }

    def __repr__(self) -> str:
        """Spans, samples, rate and channels on one line."""
        total = sum(span.time_s.size for span in self.spans)
        names = ", ".join(channel.name for channel in self.channels)
        return (
            f"UniformBase({len(self.spans)} spans, {total} samples, "
            f"{1 / self.sample_time_s:.6g} Hz, channels [{names}])"
        )


def doubts(
    account: tuple[ChannelResampling, ...], gap_policy: str, n_short: int
) -> tuple[Finding, ...]:
    """Findings on channels with dropped or missing samples, gaps or jitter, and lost spans."""
    found = []
    for channel in account:
        if channel.n_disordered:
            found.append(
                Finding(
                    "stamps-disordered",
                    Light.AMBER,
                    f"{channel.n_disordered} samples of {channel.name} had repeated or backward "
                    "stamps",
                    "check the logger; a clock reset needs two records",
                )
            )
        if channel.n_missing:
            found.append(
                Finding(
                    "samples-missing",
                    Light.AMBER,
                    f"{channel.n_missing} samples of {channel.name} were not finite",
                    "check the sensor; the hole was treated as a gap",
                )
            )
        if channel.n_gaps:
            found.append(
                Finding(
                    "gaps",
                    Light.AMBER,
                    f"{channel.name} has {channel.n_gaps} gaps (policy: {gap_policy})",
                    "look at the logger's load; write fewer messages",
                )
            )
        if channel.jitter > 0.1:
            found.append(
                Finding(
                    "jitter",
                    Light.AMBER,
                    f"stamps of {channel.name} jitter by {100 * channel.jitter:.3g} % of a sample",
                    "stamp samples when they are taken, not when they are written",
                )
            )
    if n_short:
        found.append(
            Finding(
                "spans-dropped", Light.AMBER, f"{n_short} spans between gaps were too short to keep"
            )
        )
    return tuple(found)
