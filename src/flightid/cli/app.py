"""``flightid app``: the local page in the browser."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import note


@click.command("app", short_help="Open the local page: drop a log, look, identify.")
@click.argument(
    "folder",
    default=".",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Of the address http://127.0.0.1:PORT. Default, and 0: that of before, else a free one.",
)
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
def command(folder: Path, port: int, no_browser: bool) -> None:
    """Open the local page on FOLDER, whose logs it lists; Ctrl-C ends it.

    What is dropped there is kept in the folder, by its hash, beside the study files of which every
    click changes a key. The server answers to this machine alone. Needs the extra flightid[app].
    """
    from flightid.extras import extra_module

    for name in ("fastapi", "pebble", "tomlkit", "uvicorn", "websockets"):
        extra_module(name, "the page")
    from flightid.app.serving import serve

    serve(folder, port, say=note, opens=not no_browser)
