"""``flightid fly``: a pilot on a model, in real time."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import WRITTEN, emit, json_option, note
from flightid.cli.pages import html_option, write_page
from flightid.cli.records import FILES
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from flightid.control.stepped.block_controller import BlockController
    from flightid.control.stepped.gain_controller import GainController
    from flightid.models import Model
    from flightid.options import Options
    from flightid.simulation.realtime import FlownSession
    from flightid.study.pilot_settings import PilotSettings


def _fields() -> dict[str, type[Options]]:
    from flightid import Noise
    from flightid.simulation.fly_options import FlyOptions

    return {"a flight": FlyOptions, "noise": Noise}


@click.command(cls=OptionsCommand, fields_of=_fields)
@model_argument
@model_options
@click.option(
    "--gains",
    type=FILES,
    help="Fly these gains: a parameter file of an autopilot, or the TOML of a PID, as tune writes "
    "them; what it leaves out has the autopilot's default. The pilot commands phi_command, or "
    "p_command where the model has no angle.",
)
@click.option(
    "--blocks",
    type=FILES,
    help="Fly this law: a TOML file of [[block]] tables, as [[loop.block]] in a study.",
)
@click.option(
    "--augmentation",
    "law",
    metavar="NAME|FILE",
    help="Fly this law: dase, or a TOML file of [[axis]] tables of limited authority.",
)
@click.option(
    "--write",
    "target",
    type=WRITTEN,
    help="Write the flight: .parquet or .nc.",
)
@html_option
@json_option
def command(
    model: str,
    axis: str | None,
    values: tuple[str, ...],
    gains: Path | None,
    blocks: Path | None,
    law: str | None,
    target: Path | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Fly MODEL beside the clock, alone or under a controller; Ctrl-C ends and keeps the flight.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model; or a study with a table [pilot] of vehicle, law, gusts, delays and stick. Inputs
    come as JSON datagrams such as {"lat": 0.1}, outputs go to a cockpit each frame.
    """
    from flightid import Noise
    from flightid.app.fly_study import fly_study
    from flightid.simulation.fly_options import FlyOptions
    from flightid.simulation.realtime import fly_model

    if target is not None and not target.parent.is_dir():
        raise click.UsageError(f"--write: there is no folder {target.parent}; make it first")
    if target is not None and target.suffix not in (".parquet", ".nc"):
        raise click.UsageError(f"--write: {target.name} ends in neither .parquet nor .nc")
    of_flight, of_noise = parted(options, _fields())
    if set(of_noise) == {"seed"}:
        raise click.UsageError("--seed is of noise: give --sensor, --process or --gust too")
    asked = FlyOptions(**of_flight)
    noise = Noise(**of_noise) if of_noise else None
    if sum(each is not None for each in (gains, blocks, law)) > 1:
        raise click.UsageError(
            "--gains, --blocks and --augmentation move the same inputs: give one of them"
        )
    said = _piloted(model)
    if said is not None:
        if any((axis, values, gains, blocks, law, noise)):
            raise click.UsageError(f"{model} says what is flown, under [pilot]: change it there")
        _fly(lambda: fly_study(said, asked, say=note), target, html, as_json=as_json)
        return
    source = load_source(model, axis, values)
    around: GainController | BlockController | None = None
    if gains is not None:
        around = _gains(gains, source, 1.0 / asked.step_s(source))
    elif blocks is not None:
        around = _blocks(blocks, source, asked.step_s(source))
    elif law is not None:
        from flightid.study.loop_blocks import law_controller

        around = law_controller(law, source, asked.step_s(source))
    if around is not None and around.commands:
        note(f"The pilot commands {', '.join(around.commands)} too")
    _fly(
        lambda: fly_model(source, asked, controller=around, noise=noise, say=note),
        target,
        html,
        as_json=as_json,
    )


def _piloted(model: str) -> PilotSettings | None:
    """What a study says of a pilot's flight; None of a model."""
    from flightid.study.pilot_settings import pilot_of

    return pilot_of(model) if model.endswith(".toml") and Path(model).is_file() else None


def _fly(
    flown: Callable[[], FlownSession], target: Path | None, html: Path | None, *, as_json: bool
) -> None:
    """Fly; who ends the flight by a signal keeps it, as Ctrl-C does."""
    from flightid import write_records

    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        session = flown()
    finally:
        signal.signal(signal.SIGTERM, before)
    if target is not None:
        note(f"Wrote {write_records(session.record, target)}")
    if html is not None:
        note(f"Wrote {write_page(session, 'Flight', html)}")
    emit(session, as_json=as_json)


def _gains(file: Path, model: Model, rate_hz: float) -> GainController:
    from flightid.control.stepped.controller_files import controller_of

    note(f"Controllers run at {rate_hz:g} Hz; --rate takes another")
    made = controller_of(file, model, rate_hz)
    if file.suffix != ".toml":
        for loop in made.loops.values():
            note(repr(loop))
    return made


def _blocks(file: Path, model: Model, step_s: float) -> BlockController:
    from flightid.control.stepped.block_controller import BlockController
    from flightid.reading import read_toml
    from flightid.study.loop_blocks import made_block

    tables = read_toml(file, "a controller").get("block", [])
    blocks = [made_block(each, f"{file.name}, [[block]]") for each in tables]
    return BlockController(blocks, model, step_s)
