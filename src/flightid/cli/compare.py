"""``flightid compare``: models of several flights side by side, and what really changed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import click

from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import show
from flightid.cli.sources import AXES, known_models, load_source


@click.command(short_help="Put models of several flights or conditions side by side.")
@click.argument(
    "models", nargs=-1, required=True, metavar="MODEL MODEL...", shell_complete=known_models
)
@click.option("--axis", type=AXES, help="Of a library model.")
@level_option
@all_option
@json_option
def command(models: tuple[str, ...], axis: str | None, level: float | None, as_json: bool) -> None:
    """Parameters and modes of MODELs with their ratios, and what is more than chance.

    The first is the base. Each is a .toml file, the folder of a study with one model, the JSON of a
    fit, or the name of a library model. To see which predicts better: `flightid verify MODEL
    RECORDS --against MODEL`.
    """
    from flightid import compare_conditions

    if len(set(models)) < len(models):
        raise click.UsageError("a model is named twice")
    sources = {
        n: load_source(model, axis) for n, model in zip(short_names(models), models, strict=True)
    }
    show(compare_conditions(sources), "Comparison", as_json=as_json, level=level)


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
