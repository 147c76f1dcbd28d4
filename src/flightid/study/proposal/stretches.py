"""Manoeuvres of records, and what a study makes of each: fit, choice of orders, verification."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.models.save import toml_value
from flightid.record import Record
from flightid.record.time_question import time_column
from flightid.study.proposal.cut import cut_that_keeps

FITTED, CHOSEN, ALONE = 0.6, 1.0, (0.5, 0.75)
"""Part of a record that is fitted, the rest ranks structures; and where it also has to verify."""
RICHER = 2.0
"""Ratio of powers of an input's steps, of halves of a record, that is no chance."""
FEWEST_IN_PART = 10
"""Samples of the part that chooses orders, and of the unseen one, at the least."""
SWEEP = 0.5
"""Part of the longest manoeuvre's samples from which one that was injected is fitted."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A manoeuvre, and where a study finds it: `manoeuvre` where its file holds several."""

    record: Record
    path: Path
    manoeuvre: str | None = None

    @property
    def name(self) -> str:
        """Of the manoeuvre, or of its file."""
        return self.manoeuvre or self.path.stem

    def lines(self, name: str, span: tuple[float, float] | None, folder: Path) -> Iterator[str]:
        """Its table of the study, under a name."""
        yield from ("", "[[record]]", f"name = {toml_value(name)}")
        yield f"path = {toml_value(Path(os.path.relpath(self.path, folder)).as_posix())}"
        if self.manoeuvre is not None:
            yield f"manoeuvre = {toml_value(self.manoeuvre)}"
        if span is not None:
            yield f"span_s = {toml_value(list(span))}"

    def time_key(self) -> list[str]:
        """The column that was taken for the time, so that the study keeps it."""
        name = time_column(self.record)
        return [f"time_column = {toml_value(name)}"] if name else []


@dataclass(frozen=True, eq=False)
class Group:
    """Records in which the same inputs moved: the longest is fitted, the others verify."""

    inputs: tuple[str, ...]
    parts: tuple[Stretch, ...]


@dataclass(frozen=True)
class Segments:
    """Names of what is fitted, what ranks structures and what verifies; all with file and span.

    `together` holds several records that are fitted whole.
    """

    all: tuple[tuple[str, Stretch, tuple[float, float] | None], ...]
    fitted: str
    choice: str
    unseen: tuple[str, ...]
    spans: tuple[tuple[float, float], tuple[float, float]]
    together: tuple[str, ...] = ()


def segments_of(group: Group) -> Segments:
    """The longest record in parts; the others verify."""
    first, record = group.parts[0], group.parts[0].record
    start, stop = float(record.time_s[0]), float(record.time_s[-1])
    alone = len(group.parts) == 1
    cuts: Sequence[float] = ALONE if alone else (FITTED, CHOSEN)
    turned = alone and _ends_richer(record, group.inputs)
    if turned:
        cuts = [1.0 - cut for cut in reversed(cuts)]
    edges = [start, *(rounded(start + cut * (stop - start)) for cut in cuts), stop]
    spans = list(pairwise(edges))
    if turned:
        spans.reverse()
    name = first.name
    parts = [(f"{name}, fitted", first, spans[0]), (f"{name}, choice", first, spans[1])]
    rest = [(part.name, part, None) for part in group.parts[1:]]
    unseen = [(f"{name}, unseen", first, spans[2])] if alone else rest
    return Segments(
        (*parts, *unseen), parts[0][0], parts[1][0],
        tuple(each[0] for each in unseen), (parts[0][2], parts[1][2]),
    )  # fmt: skip


def segments_of_equations(group: Group, injected: tuple[str, ...]) -> Segments:
    """The longest record and what verifies: equations are given, so no part chooses between them.

    A record that is alone is fitted but for a quarter: the first of a rising sweep, whose band then
    lies in what is fitted, else the last. Where that would leave an input without its sweep, the
    cut lies where it does not; where there is none, all is fitted and nothing is left to verify.
    `injected` are channels that tell, else the inputs.
    """
    first, record = group.parts[0], group.parts[0].record
    start, stop = float(record.time_s[0]), float(record.time_s[-1])
    name, rest = first.name, [(part.name, part, None) for part in group.parts[1:]]
    fitted = (start, stop)
    unseen: list[tuple[str, Stretch, tuple[float, float] | None]] = [*rest]
    if not rest:
        moved = tuple(each for each in injected or group.inputs if np.ptp(record[each]) > 0.0)
        rises = bool(moved) and _ends_richer(record, moved)
        spans = cut_that_keeps(record, moved, rises=rises)
        if spans is not None:
            fitted = spans[0]
            unseen = [(f"{name}, unseen", first, spans[1])]
    part = (f"{name}, fitted", first, fitted)
    names = tuple(each[0] for each in unseen)
    return Segments((part, *unseen), part[0], part[0], names, (fitted, fitted))


def too_short(group: Group, segments: Segments) -> Finding | None:
    """Why a record is too short for a structure to be chosen on a part of it; None: it is not."""
    record = group.parts[0].record
    shares = [
        int(np.count_nonzero((record.time_s >= start) & (record.time_s <= stop)))
        for start, stop in segments.spans
    ]
    if min(shares) >= FEWEST_IN_PART:
        return None
    least = math.ceil(record.n_samples * FEWEST_IN_PART / max(min(shares), 1))
    said = (
        f"{group.parts[0].name}: no model, the record is too short: {record.n_samples} samples, "
        f"{min(shares)} of them to choose orders by; about {least} are needed at the least, some "
        "hundreds for a model"
    )
    return Finding("no-model", Light.RED, said, "record longer, or hand in several records")


def one_experiment(
    read: Sequence[Stretch], inputs: tuple[str, ...], injected: tuple[str, ...]
) -> tuple[Group, Segments] | None:
    """Sweeps of one input each, fitted together; the short manoeuvres beside them verify.

    None where nothing was injected, where the first sweep holds all that was, or where nothing is
    left to verify: then each manoeuvre stands for itself.
    """
    longest = max(part.record.n_samples for part in read)
    moved = {
        part: [n for n in injected if n in part.record and np.ptp(part.record[n]) > 0.0]
        for part in read
        if part.record.n_samples >= SWEEP * longest
    }
    swept = [part for part, names in moved.items() if names]
    if len(swept) in (0, len(read)) or len(moved[swept[0]]) == len(injected):
        return None
    parts = (*swept, *(part for part in read if part not in swept))
    names = [part.name for part in parts]
    taken = [
        name if names.count(name) == 1 else f"{part.path.stem}: {name}"
        for name, part in zip(names, parts, strict=True)
    ]
    fitted, time_s = tuple(taken[: len(swept)]), swept[0].record.time_s
    span = (float(time_s[0]), float(time_s[-1]))
    return Group(inputs, parts), Segments(
        tuple((name, part, None) for name, part in zip(taken, parts, strict=True)),
        fitted[0], fitted[0], tuple(taken[len(swept) :]), (span, span), fitted,
    )  # fmt: skip


def _ends_richer(record: Record, inputs: tuple[str, ...]) -> bool:
    """Whether inputs move much faster in the second half, as those of a rising sweep do.

    What is slow is foretold by what was fitted to the fast, not the other way round.
    """
    steps = np.diff(record.matrix(inputs), axis=1) / np.std(record.matrix(inputs), axis=1)[:, None]
    early, late = (float(np.sum(part**2)) for part in np.array_split(steps, 2, axis=1))
    return late > RICHER * early


def rounded(value: float) -> float:
    """To four digits, as a study file has it."""
    return float(f"{value:.4g}")
