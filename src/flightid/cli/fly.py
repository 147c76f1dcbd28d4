"""``flightid fly``: a pilot on a model, in real time."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.option_fields import flags_of
from flightid.cli.output import emit, json_option, note
from flightid.cli.pairs import pairs
from flightid.cli.sources import load_source, model_options


@click.command()
@click.argument("model")
@model_options
@click.option(
    *flags_of("sample_rate_hz"),
    "rate",
    type=click.FloatRange(0.0, min_open=True),
    default=100.0,
    show_default=True,
    help="Frames a second.",
)
@click.option(
    *flags_of("duration_s"),
    "duration",
    type=click.FloatRange(0.0, min_open=True),
    default=60.0,
    show_default=True,
    help="s.",
)
@click.option("--feedback", multiple=True, help="INPUT=OUTPUT:GAIN: stability augmentation.")
@click.option("--listen", type=click.IntRange(0, 65535), help="UDP port of the pilot's inputs.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option("--send", help="HOST:PORT of a cockpit.")
@click.option("--style", type=click.Choice(["json", "flightgear"]), default="json")
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the flight: .parquet or .nc.",
)
@json_option
def command(
    model: str,
    axis: str | None,
    values: tuple[str, ...],
    rate: float,
    duration: float,
    feedback: tuple[str, ...],
    listen: int | None,
    host: str,
    send: str | None,
    style: str,
    output: Path | None,
    as_json: bool,
) -> None:
    """Fly MODEL beside the clock; Ctrl-C ends the flight and keeps it.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. Inputs come as JSON datagrams such as {"lat": 0.1}, outputs go to a cockpit
    each frame.
    """
    from flightid import write_records
    from flightid.simulation.realtime import UdpLink, fly_in_real_time
    from flightid.simulation.stepper import Stepper

    stepper = Stepper(load_source(model, axis, values), 1.0 / rate, feedback=_feedback(feedback))
    target = None if send is None else _address(send)
    heard = None if listen is None else (host, listen)
    with UdpLink(stepper.inputs, listen=heard, send=target, style=style) as link:
        if listen is not None:
            note(f"Listening at {host}:{link.port} for {', '.join(stepper.inputs)}")
        session = fly_in_real_time(stepper, link.pilot, duration_s=duration, show=link.show)
        if link.rejected:
            note(f"{link.rejected} datagrams were damaged or not delivered.")
    if output is not None:
        note(f"Wrote {write_records(session.record, output)}")
    emit(session, as_json=as_json)


def _feedback(given: tuple[str, ...]) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    for text in given:
        for name, rest in pairs("--feedback", [text]).items():
            output, _, gain = rest.partition(":")
            try:
                found.setdefault(name, {})[output] = float(gain)
            except ValueError as error:
                raise click.UsageError(f"--feedback {text!r} is not INPUT=OUTPUT:GAIN") from error
    return found


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise click.UsageError(f"--send {text!r} is not HOST:PORT")
    return host, int(port)
