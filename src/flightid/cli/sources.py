"""The model that a command takes: library name, model file, JSON of a fit, folder of a study."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from flightid.cli.pairs import numbers

if TYPE_CHECKING:
    from flightid.models import Model

Function = TypeVar("Function", bound=Callable[..., Any])
AXES = click.Choice(["roll", "pitch", "yaw"])


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
