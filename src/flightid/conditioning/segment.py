"""Segments: records cut at instants, at changes of a mode, or around spans to drop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.record import Record


def split(record: Record, at_s: Iterable[float] | Mapping[str, float]) -> list[Record]:
    """Cut a record at instants.

    Parameters
    ----------
    record : Record
        Data.
    at_s : iterable of float, or mapping of str to float
        Instants, s; with names (events), each segment bears the name of the event it begins with.

    Returns
    -------
    list of Record
        In order of time; pieces of fewer than two samples are left out.

    Raises
    ------
    OptionError
        An instant outside the record.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, chapter 2 (manoeuvres as time slices).

    Example
    -------
    >>> record = Record.from_arrays([0.0, 1.0, 2.0, 3.0], outputs={"p": [0.0, 1.0, 2.0, 3.0]})
    >>> [part["p"].tolist() for part in split(record, [2.0])]
    [[0.0, 1.0], [2.0, 3.0]]
    """
    names = {value: key for key, value in at_s.items()} if isinstance(at_s, Mapping) else {}
    instants = sorted(at_s.values() if isinstance(at_s, Mapping) else at_s)
    start, stop = float(record.time_s[0]), float(record.time_s[-1]) + record.sample_time_s
    outside = [instant for instant in instants if not start <= instant <= stop]
    if outside:
        raise OptionError(
            "an instant lies outside the record",
            found=f"{outside[0]} s",
            needed=f"{start:.6g} s to {stop:.6g} s",
        )
    edges = [start, *instants, stop]
    parts: list[Record] = []
    for index, (low, high) in enumerate(pairwise(edges)):
        name = names.get(low, f"{record.name}[{index}]")
        parts += _part(record, low, high, name)
    return parts


def split_by_mode(record: Record, channel: str, *, shortest_s: float = 0.0) -> list[Record]:
    """Cut a record wherever a channel (flight mode, flap setting) changes its value.

    Parameters
    ----------
    record : Record
        Data.
    channel : str
        Channel that holds the mode.
    shortest_s : float
        Segments shorter than this are left out, s.

    Returns
    -------
    list of Record
        Named ``"<record>, <channel> = <value>"``, in order of time.

    Raises
    ------
    UnknownNameError
        There is no such channel.

    Reference
    ---------
    Jategaonkar, Flight Vehicle System Identification, chapter 2.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 1.0, 2.0, 3.0], others={"mode": [5.0, 5.0, 25.0, 25.0]})
    >>> [part.name for part in split_by_mode(record, "mode")]
    ['record, mode = 5', 'record, mode = 25']
    """
    values = record[channel]
    changes = np.flatnonzero(np.diff(values)) + 1
    edges = [0, *changes.tolist(), record.n_samples]
    parts: list[Record] = []
    for low, high in pairwise(edges):
        start = float(record.time_s[low])
        stop = start + (high - low) * record.sample_time_s
        if stop - start >= shortest_s:
            parts += _part(record, start, stop, f"{record.name}, {channel} = {values[low]:g}")
    return parts


def drop(record: Record, spans_s: Iterable[tuple[float, float]]) -> list[Record]:
    """Leave out spans of time; what remains on each side becomes a record of its own.

    Records are never joined across a dropped span: a joint would be a step that nobody flew.

    Parameters
    ----------
    record : Record
        Data.
    spans_s : iterable of (float, float)
        Spans to drop, s: ``start <= time < stop``.

    Returns
    -------
    list of Record
        In order of time; pieces of fewer than two samples are left out.

    Raises
    ------
    OptionError
        A span that does not end after it begins.
    DataError
        Nothing remains.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification (2nd ed.), chapter 7
    (records concatenated window by window, never sample by sample).

    Example
    -------
    >>> record = Record.from_arrays([0.0, 1.0, 2.0, 3.0, 4.0], outputs={"p": range(5)})
    >>> [part["p"].tolist() for part in drop(record, [(2.0, 3.0)])]
    [[0.0, 1.0], [3.0, 4.0]]
    """
    begin, stop = float(record.time_s[0]), float(record.time_s[-1]) + record.sample_time_s
    parts: list[Record] = []
    for low, high in sorted(spans_s):
        if high <= low:
            raise OptionError(
                "a span does not end after it begins", found=f"{low} s to {high} s", needed="a < b"
            )
        parts += _part(record, begin, low, f"{record.name}[{len(parts)}]")
        begin = max(begin, high)
    parts += _part(record, begin, stop, f"{record.name}[{len(parts)}]")
    if not parts:
        raise DataError("nothing remains of the record", needed="at least two samples in a row")
    return parts


def _part(record: Record, low: float, high: float, name: str) -> list[Record]:
    slack = 1e-3 * record.sample_time_s
    inside = (record.time_s >= low - slack) & (record.time_s < high - slack)
    if np.count_nonzero(inside) < 2:
        return []
    return [record.segment(low, high, name=name)]
