"""``flightid library``: models from books, by the names that ``--model`` takes."""

from __future__ import annotations

import click

from flightid.cli.output import emit_values, json_option


@click.command(short_help="Names of library models, or one of them.")
@click.argument("name", required=False)
@json_option
def command(name: str | None, as_json: bool) -> None:
    """Names of the library's models; of NAME its equations, parameters and source."""
    from flightid import library_names, load_model
    from flightid.models import StateSpaceModel

    if name is not None:
        model = load_model(name)
        shown = model.summary() if isinstance(model, StateSpaceModel) else model
        emit_values(model.to_dict()) if as_json else click.echo(str(shown))
    elif as_json:
        emit_values(library_names())
    else:
        click.echo("\n".join(library_names()))
