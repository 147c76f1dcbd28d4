"""``flightid simulate``: fly a model, or a simulated vehicle that writes its log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import HOLD_HELP, emit, json_option, note
from flightid.cli.pairs import numbers, pairs

if TYPE_CHECKING:
    from flightid.models import LinearSystem, StateSpaceModel, TransferFunctionModel
    from flightid.models.linear.hold_equivalent import Hold
    from flightid.record import Record

    Flown = LinearSystem | StateSpaceModel | TransferFunctionModel

FILE = click.Path(dir_okay=False, path_type=Path)


@click.group()
def command() -> None:
    """Fly a model, or a simulated vehicle that writes its log."""


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
    from flightid.vehicles.ardupilot_log import write_ardupilot_log
    from flightid.vehicles.scenario import fly_scenario

    with progress(2, "Flying") as advance:
        flight = fly_scenario(scenario, seed=seed)
        advance()
        write_ardupilot_log(flight, output)
        advance()
    note(f"Wrote {output}")
    emit(flight, as_json=as_json)


@command.command()
@click.argument("model")
@click.argument("records", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--axis", type=click.Choice(["roll", "pitch", "yaw"]), help="Of a library model.")
@click.option("--value", "values", multiple=True, help="NAME=NUMBER: another parameter value.")
@click.option("--input", "shapes", multiple=True, help="NAME=SHAPE, for example lat=step:0.1.")
@click.option("--duration", type=float, default=10.0, show_default=True, help="Of shapes, s.")
@click.option("--rate", type=float, default=100.0, show_default=True, help="Of shapes, Hz.")
@click.option("--span", nargs=2, type=float, help="First and last instant in a log, s.")
@click.option("--hold", type=click.Choice(["first", "zero"]), help=HOLD_HELP)
@click.option("--substeps", type=click.IntRange(1), help="Runge-Kutta steps in a sample.")
@click.option("--sensor", multiple=True, help="OUTPUT=DEVIATION: white noise of a sensor.")
@click.option("--process", multiple=True, help="STATE=SIZE: white noise on its derivative, 1/√s.")
@click.option("--gust", multiple=True, help="STATE=DEVIATION:SECONDS: moving air it feels.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of noise.")
@click.option("--output", "written", type=FILE, help="Write .csv, .parquet or .nc.")
@click.option("--html", type=FILE, help="Write a page with time histories.")
@json_option
def model(
    model: str,
    records: tuple[Path, ...],
    axis: str | None,
    values: tuple[str, ...],
    shapes: tuple[str, ...],
    duration: float,
    rate: float,
    span: tuple[float, float] | None,
    hold: Hold | None,
    substeps: int | None,
    sensor: tuple[str, ...],
    process: tuple[str, ...],
    gust: tuple[str, ...],
    seed: int,
    written: Path | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Fly MODEL, a .toml file or a library name, on RECORDS, a log, or shapes of its inputs.

    Linear models are departures from their trim; nonlinear ones take inputs whole, and shapes are
    added to their trim. Shapes: step:A[:START], pulse:A:WIDTH[:START], doublet:A:WIDTH[:START],
    3211:A:WIDTH[:START], sine:A:RAD_PER_S[:START], sweep:A:LOW:HIGH.
    """
    from flightid import Noise, simulate
    from flightid.progress import progress

    chosen = _model(model, axis, numbers("--value", values))
    noise = Noise(numbers("--sensor", sensor), numbers("--process", process), _gusts(gust), seed)
    driven = _driving(chosen, records, pairs("--input", shapes), span, (duration, rate))
    made = []
    with progress(len(driven), "Simulating") as advance:
        for record in driven:
            flown = simulate(
                chosen, record, hold=hold, substeps=substeps, units=chosen.units,
                noise=noise if sensor or process or gust else None,
            )  # fmt: skip
            made.append(flown)
            advance()
    if written is not None:
        note(f"Wrote {_write(written, made)}")
    if html is not None:
        note(f"Wrote {_page(html, model, made, driven)}")
    for flown in made:
        emit(flown, as_json=as_json)


def _model(name: str, axis: str | None, values: dict[str, float]) -> Flown:
    from flightid import load_model
    from flightid.models import StateSpaceModel, TransferFunctionModel, linear_system

    found = load_model(name, axis=axis)
    if isinstance(found, StateSpaceModel | TransferFunctionModel):
        return found.with_values(values) if values else found
    if values:
        raise click.UsageError("--value needs a model with named parameters")
    return linear_system(found)


def _gusts(given: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    found = {}
    for name, text in pairs("--gust", given).items():
        size, _, time_s = text.partition(":")
        try:
            found[name] = (float(size), float(time_s))
        except ValueError as error:
            raise click.UsageError(f"--gust {name}={text!r} is not DEVIATION:SECONDS") from error
    return found


def _driving(
    model: Flown,
    files: tuple[Path, ...],
    shapes: dict[str, str],
    span: tuple[float, float] | None,
    length: tuple[float, float],
) -> list[Record]:
    """Records of the files, or one of shapes."""
    from flightid import read_log, read_records
    from flightid.logs import is_log
    from flightid.vehicles.pilot_inputs import stick_record

    inputs = tuple(model.inputs)
    if not files:
        units = {name: model.units.get(name, "1") for name in inputs}
        is_whole = not getattr(model, "is_linear", True)
        trim = {n: v for n, v in getattr(model, "trim", {}).items() if n in inputs}
        return [
            stick_record(
                units, shapes, duration_s=length[0], sample_rate_hz=length[1],
                trim=trim if is_whole else {},
            )
        ]  # fmt: skip
    if shapes:
        raise click.UsageError("--input makes records of its own: give it or RECORDS")
    found: list[Record] = []
    for file in files:
        if is_log(file):
            found.append(read_log(file).record(names=list(inputs), span_s=span))
        elif span is not None:
            raise click.UsageError("--span belongs to logs")
        else:
            found += read_records(file, inputs=inputs)
    return found


def _write(path: Path, records: list[Record]) -> Path:
    from flightid import write_records
    from flightid.record.sheet import write_sheet

    if path.suffix.lower() != ".csv":
        return write_records(records, path)
    if len(records) > 1:
        raise click.UsageError("a .csv holds one record: write .parquet or .nc")
    return write_sheet(records[0], path)


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
