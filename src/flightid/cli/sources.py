"""The model that a command takes: library name, model file, JSON of a fit, folder of a study."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from flightid.cli.output import Function
from flightid.cli.pairs import numbers

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from flightid.models import Model

AXES = click.Choice(["roll", "pitch", "yaw"])


def known_models(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Library models, model files and folders that begin so."""
    del ctx, param
    from glob import escape, iglob
    from os.path import isdir

    from click.shell_completion import CompletionItem

    from flightid import library_names

    names = [name for name in library_names() if name.startswith(incomplete)]
    files = [
        path
        for path in sorted(iglob(f"{escape(incomplete)}*"))
        if isdir(path) or path.endswith((".toml", ".json"))
    ]
    return [CompletionItem(name) for name in (*files, *names)]


def known_methods(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Methods that begin so: of the ``--kind`` that was given, else of models with equations."""
    del param
    from click.shell_completion import CompletionItem

    from flightid.cli.black_boxes import POLYNOMIALS, SUBSPACE
    from flightid.cli.equations import methods
    from flightid.models import SubspaceStructure
    from flightid.models.polynomial.structure import PolynomialStructure
    from flightid.options import options_of

    kind = ctx.params.get("kind")
    of_kind = {SUBSPACE: SubspaceStructure, **dict.fromkeys(POLYNOMIALS, PolynomialStructure)}
    names: Iterable[object] = methods() if kind is None else ()
    if kind in of_kind:
        known = {each.name: each for each in options_of(of_kind[kind])}
        names = known["method"].choices
    return [CompletionItem(str(name)) for name in names if str(name).startswith(incomplete)]


def model_argument(function: Function) -> Function:
    """Add the argument ``MODEL`` to a command, its names completed by the shell."""
    return click.argument("model", shell_complete=known_models)(function)


def model_options(function: Function) -> Function:
    """Add ``--axis`` and ``--value`` to a command that takes a model."""
    for decorate in (
        click.option(
            "--value", "values", multiple=True, help="NAME=NUMBER: another parameter value."
        ),
        click.option("--axis", type=AXES, help="Of a library model."),
    ):
        function = decorate(function)
    return function


def load_source(name: str, axis: str | None = None, values: Iterable[str] = ()) -> Model:
    """The model that was named, with other values where they were given.

    Parameters
    ----------
    name : str
        As `flightid.load_model` takes it.
    axis : str, optional
        Of a library model.
    values : iterable of str
        NAME=NUMBER; what was known of the fitted numbers is then dropped.

    Raises
    ------
    FlightidError
        There is no such model or no such parameter.
    """
    from flightid import load_model

    changed = numbers("--value", values)
    model = load_model(name, axis=axis)
    return model.with_values(changed) if changed else model
