"""``flightid tune``: gains of an autopilot from the models of a study."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict, note


@click.command()
@click.argument("study", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--log",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Log to read instead of the one that the study names.",
)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of the study's results; default: <study>-output beside the study file.",
)
@click.option(
    "--write",
    "target",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Parameter file to write, for example gains.param; every step with its way back.",
)
@click.option("--overwrite", is_flag=True, help="Replace parameter files that exist.")
@json_option
def command(
    study: Path,
    log: Path | None,
    output: Path | None,
    target: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Run STUDY and tune the autopilot that its log was flown with.

    The table [tune] of the study holds the requirements; without one the usual ones apply. Gains
    keep their margins for every plant that the data allow. The exit code is 1 where a verdict on
    the gains is red.
    """
    from flightid.study import run_study

    result = run_study(study, output=output, log=log, tune=True)
    tuning = result.tuning
    if tuning is None:
        raise click.ClickException("the study has no model of a rate that can be tuned")
    if as_json:
        emit_values(tuning.to_dict())
    else:
        click.echo(str(tuning.summary()))
        for design in tuning.designs:
            click.echo(f"\n{design.promise_table()}")
        if tuning.together:
            click.echo(f"\n{tuning.together_table()}")
    note(f"Wrote {result.output / 'report.html'}")
    if target is not None and tuning.exists:
        for path in tuning.write(target, overwrite=overwrite):
            note(f"Wrote {path}")
    leave_by_verdict(tuning.findings)
