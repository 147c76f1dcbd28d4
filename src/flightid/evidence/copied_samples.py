"""Records that hold the same samples, or the same noise: what was measured once counts twice.

Asked of second differences, which keep nothing of what an estimate takes out of a record (its mean,
its line), by stretches that move: a vehicle at rest gives the same samples again. Copies that were
rounded, thinned or moved hold no sample twice; noise tells them (`shared_noise.py`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light, Role
from flightid.evidence.feedback import KEPT
from flightid.evidence.shared_noise import RecordSeries, SharedNoise, shared_noise
from flightid.findings import Finding
from flightid.record import Record
from flightid.responses import FrequencyResponse

Array = NDArray[np.float64]
Words = NDArray[np.uint64]
COPIED = "records-copied"
"""Code of samples that several records hold."""
STRETCH = 32
"""Samples one after another that have to be the same, half of which move."""
SAME = 1e-6
"""Of the root mean square of second differences, within which they are the same."""
_MIX, _BASE = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xD1342543DE82EF95)
"""Odd numbers without pattern, that make words of samples and of stretches (Knuth, 3, 6.4)."""


def judge_copies(
    data: Sequence[Record | FrequencyResponse], channels: Collection[str]
) -> list[Finding]:
    """A red verdict where records, or those behind responses, hold the same samples.

    Parameters
    ----------
    data : sequence of Record and FrequencyResponse
    channels : collection of str
        Of which outputs are compared, all together, beside its inputs.

    Example
    -------
    >>> noise = np.random.default_rng(0).standard_normal(200)
    >>> record = Record.from_arrays(np.arange(200) * 0.1, outputs={"p": noise})
    >>> (said,) = judge_copies([record, record.segment(2.0, 12.0)], ["p"])
    >>> said.message
    'records 1 and 2 hold the same 100 samples of p: they were measured once and count twice'
    """
    return list(_judged(tuple(data), frozenset(channels)))


@lru_cache(maxsize=KEPT)
def _judged(
    data: tuple[Record | FrequencyResponse, ...], channels: frozenset[str]
) -> tuple[Finding, ...]:
    series = [part for each in data for part in _series(each, channels)]
    if len(series) < 2:
        return ()
    common = [name for name in series[0].names if all(name in each.names for each in series[1:])]
    if not common:
        return ()
    series = [each.of(common) for each in series]
    met = _first_met([each.outputs for each in series])
    if met is not None:
        (first, second), count = met
        return (
            _copied(
                f"records {first + 1} and {second + 1} hold the same {count} samples of "
                f"{', '.join(common)}: they were measured once and count twice"
            ),
        )
    shared = shared_noise(series)
    return () if shared is None else (_copied(_in_words(shared, common)),)


def _copied(what: str) -> Finding:
    return Finding(COPIED, Light.RED, what, "give each flight once, and cuts that do not overlap")


def _in_words(shared: SharedNoise, names: Sequence[str]) -> str:
    by = f"a shift of {shared.shift} samples"
    if shared.step_s is not None:
        by += f" of {shared.step_s:.4g} s"
    factors = list(dict.fromkeys(f"{each:.4g}" for each in shared.factors))
    scaled = "" if set(factors) <= {"1"} else f", scaled by {' and '.join(factors)}"
    return (
        f"records {shared.first + 1} and {shared.second + 1} share their noise in "
        f"{', '.join(names)}{scaled} "
        f"(r = {shared.correlation:.3f} at {by}, over {shared.count} samples), "
        "as copies of one flight do: they count twice"
    )


def _series(each: Record | FrequencyResponse, channels: Collection[str]) -> list[RecordSeries]:
    if isinstance(each, Record):
        known = each.channels
        names, inputs = (
            tuple(n for n in rows if n in channels and known[n].role is role)
            for rows, role in ((each.outputs, Role.OUTPUT), (each.inputs, Role.INPUT))
        )
        if not names:
            return []
        none = np.zeros((0, each.n_samples))
        driven = each.matrix(inputs) if inputs else none
        return [RecordSeries(names, each.matrix(names), driven, each.sample_time_s)]
    linear = each.linear
    if linear is None:
        return []
    kept = [place for place, name in enumerate(each.outputs) if name in channels]
    names = tuple(each.outputs[place] for place in kept)
    return [
        RecordSeries(names, rows[kept], driven, linear.sample_time_s)
        for rows, driven in zip(linear.output_records, linear.input_records, strict=True)
    ]


def _first_met(rows: Sequence[Array]) -> tuple[tuple[int, int], int] | None:
    """The two records that share most, and how many samples; None where none do."""
    words, moves = zip(*(_stretches(bent) for bent in _bends(rows)), strict=True)
    owner = np.repeat(np.arange(len(rows)), [each.size for each in words])
    every, moving = np.concatenate(words), np.concatenate(moves)
    every, owner = every[moving], owner[moving]
    order = np.argsort(every, kind="stable")
    every, owner = every[order], owner[order]
    twice = np.flatnonzero((every[1:] == every[:-1]) & (owner[1:] != owner[:-1]))
    if not twice.size:
        return None
    pairs, counts = np.unique(
        np.stack([owner[twice], owner[twice + 1]]), axis=1, return_counts=True
    )
    most = int(np.argmax(counts))
    first, second = sorted(map(int, pairs[:, most]))
    # Each stretch begins with one sample more, and a difference takes two.
    return (first, second), int(counts[most]) + STRETCH + 1


def _bends(rows: Sequence[Array]) -> list[NDArray[np.int64]]:
    """Second differences in steps of what is the same."""
    bends = [np.diff(each, n=2, axis=1) for each in rows]
    count = sum(each.shape[1] for each in bends)
    power = sum(np.sum(np.square(each), axis=1) for each in bends)
    unit = SAME * np.sqrt(np.maximum(power / max(count, 1), np.finfo(float).tiny))[:, None]
    # None is more units than the root of their count over `SAME`: they are whole numbers.
    return [np.rint(each / unit).astype(np.int64) for each in bends]


def _stretches(bends: NDArray[np.int64]) -> tuple[Words, NDArray[np.bool_]]:
    """A word for each stretch of `STRETCH` samples, and whether half of it moves."""
    single = np.zeros(bends.shape[1], dtype=np.uint64)
    for row in bends:
        single = (single ^ row.view(np.uint64)) * _MIX
        single ^= single >> np.uint64(29)
    count = max(single.size - STRETCH + 1, 0)
    words = np.zeros(count, dtype=np.uint64)
    for place in range(STRETCH):
        words = words * _BASE + single[place : place + count]
    changes = np.concatenate([[0], np.cumsum(single[1:] != single[:-1])])
    moved = changes[STRETCH - 1 :][:count] - changes[:count]
    return words, moved >= STRETCH // 2
