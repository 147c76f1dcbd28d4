"""``flightid new``: a study file for data that have none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import WRITTEN, note
from flightid.cli.proposals import end_without_model, note_of, of_data, propose, study_path
from flightid.cli.records import FILES, FilesArgument


@click.command(
    cls=OptionsCommand,
    fields_of=of_data,
    short_help="Write the study file that a log or records ask for.",
)
@click.argument(
    "files", nargs=-1, required=True, metavar="LOG | RECORDS...", type=FILES, cls=FilesArgument
)
@click.option("--tune", is_flag=True, help="Let it end in gains of the autopilot that flew.")
@click.option(
    "--write",
    "target",
    type=WRITTEN,
    help="Study file to write; default: <log>-study.toml beside the log.",
)
def command(
    files: tuple[Path, ...],
    tune: bool,
    target: Path | None,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Write the study that LOG or RECORDS ask for, and run nothing.

    Axes, sweeps, bands, template, estimator and verification come from what `flightid inspect`
    finds; of records inputs, outputs and structure. It is a file to read and to change;
    `flightid run` carries it out.
    """
    target = target or study_path(files)
    (asked,) = parted(options, of_data())
    made = propose(files, target, **asked, tune=tune)
    end_without_model(made)
    note_of(made)
    note(f"Wrote {made.write(target)}: {', '.join(made.models)}")
