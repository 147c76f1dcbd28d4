"""``flightid run``: a study file from end to end."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict, note


@click.command()
@click.argument("study", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder to write; default: <study>-output beside the study file.",
)
@click.option(
    "--log",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Log to read instead of the one that the study names.",
)
@json_option
def command(study: Path, output: Path | None, log: Path | None, as_json: bool) -> None:
    """Run a study: log, records, responses, models, verification, report.

    Writes report.html, report.txt and results.json to the output folder, all or nothing;
    of an earlier run's output only what that run wrote goes.
    docs/study.md describes the study file.
    """
    from flightid.report.text import to_text
    from flightid.study import run_study

    result = run_study(study, output=output, log=log)
    if as_json:
        emit_values(result.to_dict())
    else:
        click.echo(to_text(result.document), nl=False)
    note(f"Wrote {result.output / 'report.html'}")
    leave_by_verdict(result.findings)
