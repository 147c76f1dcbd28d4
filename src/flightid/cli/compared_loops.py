"""Loops that ``flightid compare`` closes around models, before and after, and their names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.gain_files import rate_of
from flightid.cli.model_commands import gains_of
from flightid.cli.sources import load_source

if TYPE_CHECKING:
    from flightid.review import MarginComparison


def compared_loops(
    files: Sequence[str],
    axis: str | None,
    gains: Sequence[Path],
    feedback: tuple[str, ...],
    loop_rate_hz: float | None,
) -> list[MarginComparison]:
    """Margins of two models, or of one under two files of gains; none where nothing closes loops.

    Raises
    ------
    click.UsageError
        Not two sides.
    """
    from flightid.control.stepped.controller_files import CONTROLLER

    own = [Path(file) / CONTROLLER for file in files]
    if not gains and not feedback and all(each.is_file() for each in own):
        gains = own
    if not gains and not feedback:
        return []
    if gains and feedback:
        raise click.UsageError("--gains and --feedback move the same inputs: give one of them")
    if max(len(files), len(gains)) != 2 or len(gains) > 2:
        raise click.UsageError(
            "margins have two sides: two models, or one model and two files of --gains"
        )
    by_gains = len(files) == 1 or len(set(files)) == 1
    names = short_names([str(each) for each in gains] if by_gains else files)
    laws = [*gains, *gains][:2] if gains else None
    return list(_compared(files, axis, laws, feedback, loop_rate_hz, (names[0], names[1])))


def _compared(
    files: Sequence[str],
    axis: str | None,
    laws: Sequence[Path] | None,
    feedback: tuple[str, ...],
    loop_rate_hz: float | None,
    names: tuple[str, str],
) -> Iterator[MarginComparison]:
    from flightid import compare_margins
    from flightid.control.stepped.controller_files import controller_of

    for sources in _sources(files, axis):
        if laws is None:
            told: list[Any] = [gains_of(feedback)] * 2
        else:
            pairs = zip(laws, sources, strict=True)
            told = [controller_of(f, m, rate_of(f, m, loop_rate_hz)) for f, m in pairs]
        yield compare_margins((sources[0], told[0]), (sources[1], told[1]), names=names)


def _sources(files: Sequence[str], axis: str | None) -> Iterator[tuple[Any, Any]]:
    """Models of both sides: one pair, or those of two studies."""
    from flightid.study.paired_models import paired_models

    if all(Path(file).is_dir() for file in files):
        pairs = [(each[0], each[-1]) for each in paired_models(files).values()]
    else:
        loaded = [load_source(name, axis) for name in files]
        pairs = [(loaded[0], loaded[-1])]
    yield from pairs


def short_names(paths: Sequence[str]) -> list[str]:
    """Stems of files, or, of files with one stem, what tells their paths apart.

    Example
    -------
    >>> short_names(["/log/monday/models/roll.toml", "/log/tuesday/models/roll.toml"])
    ['monday', 'tuesday']
    """
    whole = [Path(path).parts for path in paths]
    bare = [(*Path(path).parts[:-1], Path(path).stem) for path in paths]
    for parts in ([row[-1:] for row in bare], _without_common(bare), _after_common(bare)):
        if all(parts) and len(set(parts)) == len(parts):
            return [str(Path(*row)) for row in parts]
    return [str(Path(*row)) for row in _after_common(whole)]


def _after_common(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Parts of paths after the folders that all share."""
    same = _shared([row[:-1] for row in rows])
    return [row[same:] for row in rows]


def _without_common(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Parts of paths between what all share before and behind."""
    same = _shared([row[::-1] for row in rows])
    cut = [row[: len(row) - same] for row in rows]
    return _after_common(cut)


def _shared(rows: Sequence[tuple[str, ...]]) -> int:
    """How many parts all begin with."""
    alike = (len(set(column)) == 1 for column in zip(*rows, strict=False))
    return sum(1 for _ in takewhile(bool, alike))
