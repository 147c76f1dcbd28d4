"""``flightid simulate``: fly a simulated vehicle and write its log."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit, json_option, note


@click.group()
def command() -> None:
    """Fly a simulated vehicle and write its log."""


@command.command()
@click.option(
    "--output",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="DataFlash log to write, for example flight.BIN.",
)
@click.option(
    "--scenario",
    type=click.Choice(["advised", "published"]),
    default="advised",
    show_default=True,
    help="Sweep settings: flightid's, or those of the published rig study.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of noise.")
@json_option
def quadrotor(output: Path, scenario: str, seed: int, as_json: bool) -> None:
    """Sweep a 450 mm quadrotor on a gyroscopic rig; print the truth an identification should find.

    The log is ArduCopter's: mixer sweeps of roll, pitch and yaw, then doublets for verification.
    """
    from flightid.progress import progress
    from flightid.simulation.ardupilot_log import write_ardupilot_log
    from flightid.simulation.scenario import fly_scenario

    with progress(2, "Flying") as advance:
        flight = fly_scenario(scenario, seed=seed)
        advance()
        write_ardupilot_log(flight, output)
        advance()
    note(f"Wrote {output}")
    emit(flight, as_json=as_json)
