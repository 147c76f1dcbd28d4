"""``flightid run``: a log, records or a study file from end to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import json_option, leave_by_verdict, level_option
from flightid.cli.proposals import of_data, show_study, taken_study
from flightid.cli.records import FILES, FilesArgument


@click.command(
    cls=OptionsCommand,
    fields_of=of_data,
    short_help="From a log, records or a study file to models and a report.",
)
@click.argument(
    "files",
    nargs=-1,
    required=True,
    metavar="LOG | RECORDS... | STUDY",
    type=FILES,
    cls=FilesArgument,
)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder to write; default: <study>-output beside the study file.",
)
@click.option(
    "--log",
    type=FILES,
    help="Log to read instead of the one that the study names.",
)
@click.option("--all", "whole", is_flag=True, help="Print the whole report, not one screen of it.")
@level_option
@json_option
def command(
    files: tuple[Path, ...],
    output: Path | None,
    log: Path | None,
    whole: bool,
    level: float | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Identify models from LOG or RECORDS, or carry out STUDY: verification and report with them.

    Without a study file axes, sweeps, bands, template, estimator and verification come from the
    log, inputs, outputs and structure from the records. The study that was used is written beside
    the results, <log>-study.toml; to run that gives the same numbers.

    Writes report.html, report.txt and results.json to the output folder, all or nothing;
    of an earlier run's output only what that run wrote goes.
    docs/study.md describes the study file.
    """
    from flightid.study import run_study

    (asked,) = parted(options, of_data())
    cache: dict[str, Any] = {}
    study, folder, missed = taken_study(files, output, log, asked, cache=cache)
    result = run_study(study, output=folder, log=log, level=level, cache=cache)
    show_study(result, whole=whole, as_json=as_json)
    # An axis that was swept in vain was told in red; the report is of the models that there are.
    leave_by_verdict((*missed, *result.findings))
