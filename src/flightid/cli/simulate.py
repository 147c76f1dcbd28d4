"""``flightid simulate``: fly a model, or a simulated vehicle that writes its log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.figures import QuotientRange
from flightid.cli.option_fields import OptionsCommand, flags_of, parted
from flightid.cli.output import WRITTEN, emit, json_option, note, of_a_page
from flightid.cli.records import FILES, FilesArgument, read_files, reading, write_out
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.models import Model
    from flightid.options import Options
    from flightid.record import Record


@click.group()
def command() -> None:
    """Fly a model, or a simulated vehicle that writes its log."""


@command.command()
@click.option(
    "--write",
    "target",
    required=True,
    type=WRITTEN,
    help="DataFlash log to write, for example flight.BIN.",
)
@click.option(
    "--scenario",
    type=click.Choice(["advised", "published", "sticks"]),
    default="advised",
    show_default=True,
    help="Sweep settings, flightid's or those of the published rig study; or sticks alone, as an "
    "ordinary flight has them.",
)
@click.option(
    "--stick-deg",
    type=QuotientRange(min=0.0, min_open=True),
    help="Of the scenario sticks: most that roll or pitch is asked to move at once, deg; default: "
    "11.5.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of noise.")
@click.option(
    "--gains",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Gains to fly: a file of `flightid tune --write`.",
)
@json_option
def quadrotor(
    target: Path,
    scenario: str,
    stick_deg: float | None,
    seed: int,
    gains: Path | None,
    as_json: bool,
) -> None:
    """Fly a 450 mm quadrotor on a gyroscopic rig; print the truth an identification should find.

    The log is ArduCopter's: mixer sweeps of roll, pitch and yaw, then doublets for verification;
    or a minute of quick moves of each stick, which tell what gains do and carry no model.
    """
    from math import radians

    from flightid.control.autopilots import read_parameters
    from flightid.progress import progress
    from flightid.vehicles import Autopilot
    from flightid.vehicles.ardupilot_log import write_ardupilot_log
    from flightid.vehicles.scenario import fly_scenario

    flown = {} if gains is None else read_parameters(gains)
    autopilot = vars(Autopilot().with_parameters(flown))
    with progress(2, "Flying") as advance:
        largest = None if stick_deg is None else radians(stick_deg)
        flight = fly_scenario(scenario, seed=seed, stick_rad=largest, autopilot=autopilot)
        advance()
        write_ardupilot_log(flight, target)
        advance()
    note(f"Wrote {target}")
    emit(flight, as_json=as_json)


def _fields() -> dict[str, type[Options]]:
    from flightid import Noise
    from flightid.simulation.options import SimulationOptions
    from flightid.vehicles.pilot_inputs import StickOptions

    return {"shapes": StickOptions, "the run": SimulationOptions, "noise": Noise, **reading()}


@command.command(cls=OptionsCommand, fields_of=_fields)
@model_argument
@click.argument("records", nargs=-1, type=FILES, cls=FilesArgument)
@model_options
@click.option("--write", "target", type=WRITTEN, help="Write .csv, .parquet or .nc.")
@click.option("--html", type=WRITTEN, callback=of_a_page, help="Write a page with time histories.")
@json_option
def model(
    model: str,
    records: tuple[Path, ...],
    axis: str | None,
    values: tuple[str, ...],
    target: Path | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Fly MODEL on RECORDS, a log, or shapes of its inputs.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. Linear models are departures from their trim; nonlinear ones take inputs whole,
    and shapes are added to their trim.
    """
    from flightid import Noise, simulate
    from flightid.progress import progress

    chosen = load_source(model, axis, values)
    shapes, of_run, noise, *of_files = parted(options, _fields())
    if set(noise) == {"seed"}:
        raise click.UsageError("--seed is of noise: give --sensor, --process or --gust too")
    driven = _driving(chosen, records, shapes, of_files)
    made = []
    with progress(len(driven), "Simulating") as advance:
        for record in driven:
            added = Noise(**noise) if noise else None
            made.append(simulate(chosen, record, units=chosen.units, noise=added, **of_run))
            advance()
    if target is not None:
        note(f"Wrote {write_out(made, target)}")
    if html is not None:
        note(f"Wrote {_page(html, model, made, driven)}")
    for flown in made:
        emit(flown, as_json=as_json)


def _driving(
    model: Model, files: tuple[Path, ...], shapes: dict[str, Any], of_files: list[dict[str, Any]]
) -> list[Record]:
    """Records of the files, or one of shapes."""
    from dataclasses import asdict

    from flightid.vehicles.pilot_inputs import StickOptions, stick_record

    inputs = tuple(model.inputs)
    if files:
        for name in shapes:
            flag = flags_of(name)[-1]
            raise click.UsageError(f"{flag} is of shapes, which make a record: give it or RECORDS")
        return read_files(files, *of_files, inputs=inputs, units=model.units)
    own = getattr(model, "sample_time_s", None)
    rate = {"sample_rate_hz": 1.0 / own} if own else {}
    stick = asdict(StickOptions(**(rate | shapes)))
    units = {name: model.units.get(name, "1") for name in inputs}
    is_whole = not getattr(model, "is_linear", True)
    trim = {n: v for n, v in getattr(model, "trim", {}).items() if n in inputs}
    return [stick_record(units, stick.pop("inputs"), **stick, trim=trim if is_whole else {})]


def _page(path: Path, name: str, made: list[Record], driven: list[Record]) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.simulation import simulated_history
    from flightid.report.content import Document, Section, TableBlock
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html

    sections = tuple(
        Section(
            record.name or f"Record {k}",
            (
                TableBlock(record.summary()),
                figure_block(
                    simulated_history(record, beside),
                    "What drove the model, and what it did; measured channels beside it.",
                ),
            ),
        )
        for k, (record, beside) in enumerate(zip(made, driven, strict=True), start=1)
    )
    title = f"{name}: {len(made)} simulated record{'' if len(made) == 1 else 's'}"
    return write_atomically(path, to_html(Document("Simulation", title, sections)))
