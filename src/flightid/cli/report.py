"""``flightid report``: the report of an earlier run, again, as text, HTML or JSON."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import WRITTEN, emit_values, json_option, leave_by_verdict, note, of_a_page


@click.command()
@click.argument("results", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--html",
    type=WRITTEN,
    callback=of_a_page,
    help="Write the page to this file instead of printing text.",
)
@click.option(
    "--unpacked",
    is_flag=True,
    help="With --html: do not compress the plotting library, for browsers before 2023.",
)
@json_option
def command(results: Path, html: Path | None, unpacked: bool, as_json: bool) -> None:
    """Show the report of a study again.

    RESULTS is the output folder of `flightid run`, or its results.json.
    """
    from flightid.files import write_atomically
    from flightid.report.html import to_html
    from flightid.report.json import to_dict
    from flightid.report.text import to_text
    from flightid.study.output import read_report

    document = read_report(results)
    if html is not None:
        write_atomically(html, to_html(document, packed=not unpacked))
        note(f"Wrote {html}")
    elif as_json:
        emit_values(to_dict(document))
    else:
        click.echo(to_text(document), nl=False)
    leave_by_verdict(document.findings)
