"""``flightid design``: an input for a target band, judged on a guess of the vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.excitation import Plan

KINDS = (
    "sweep",
    "ardupilot_chirp",
    "doublet",
    "3211",
    "modified_3211",
    "prbs",
    "noise",
    "multisine",
)
FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("kind", type=click.Choice(KINDS))
@click.option("--band", type=float, nargs=2, required=True, help="Lowest and highest rad/s.")
@click.option("--amplitude", type=float, help="Peak of the input; default: 80 % of the limits.")
@click.option("--duration", type=float, help="Seconds; default: five slowest cycles or more.")
@click.option("--rate", type=float, default=400.0, show_default=True, help="Samples per second.")
@click.option("--input", "inputs", multiple=True, default=("u",), help="Input; may be repeated.")
@click.option("--unit", default="1", show_default=True, help="Unit of the inputs.")
@click.option("--records", type=int, default=2, show_default=True, help="Times it is flown.")
@click.option("--gain", type=float, required=True, help="Guess: rad/s of rate for a unit of input.")
@click.option("--time-constant", type=float, required=True, help="Guess: lag of the rate, s.")
@click.option("--delay", type=float, default=0.02, show_default=True, help="Guess: delay, s.")
@click.option("--noise", type=float, default=0.02, show_default=True, help="Rate noise, rad/s.")
@click.option("--rate-feedback", type=float, default=0.0, help="Loop kept on: input per rad/s.")
@click.option("--attitude-feedback", type=float, default=0.0, help="Loop kept on: 1/s.")
@click.option("--control-limit", type=float, default=1.0, show_default=True)
@click.option("--control-rate-limit", type=float, help="Unit per second.")
@click.option("--rate-limit", type=float, default=3.49, show_default=True, help="rad/s.")
@click.option("--attitude-limit", type=float, default=0.52, show_default=True, help="rad.")
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--csv", "csv_file", type=FILE, help="Write the samples to this file.")
@click.option("--param", type=FILE, help="Write ArduPilot parameters (kind ardupilot_chirp).")
@click.option("--params", type=FILE, help="Write PX4 parameters: logging, and what it can inject.")
@click.option("--fixed-wing", is_flag=True, help="With --params: a fixed wing sweeps the band.")
@click.option("--axis", type=click.IntRange(1, 19), default=10, show_default=True, help="SID_AXIS.")
@click.option("--html", type=FILE, help="Write a page with pictures to this file.")
@json_option
def command(
    kind: str,
    band: tuple[float, float],
    amplitude: float | None,
    duration: float | None,
    rate: float,
    inputs: tuple[str, ...],
    unit: str,
    records: int,
    gain: float,
    time_constant: float,
    delay: float,
    noise: float,
    rate_feedback: float,
    attitude_feedback: float,
    control_limit: float,
    control_rate_limit: float | None,
    rate_limit: float,
    attitude_limit: float,
    seed: int,
    csv_file: Path | None,
    param: Path | None,
    params: Path | None,
    fixed_wing: bool,
    axis: int,
    html: Path | None,
    as_json: bool,
) -> None:
    """Design an input and say whether to fly it.

    Prints what the flight would give and a go/no-go list; the exit code is 1 for no-go.
    """
    from flightid import excitation

    if param is not None and kind != "ardupilot_chirp":
        raise click.UsageError("--param needs the kind ardupilot_chirp")
    plan = excitation.plan(
        kind,
        excitation.RateAxis(
            gain=gain,
            time_constant_s=time_constant,
            delay_s=delay,
            noise_rad_s=noise,
            rate_feedback=rate_feedback,
            attitude_feedback_per_s=attitude_feedback,
        ),
        band_rad_s=band,
        amplitude=amplitude,
        duration_s=duration,
        sample_rate_hz=rate,
        names=inputs,
        unit=unit,
        limits=excitation.Limits(
            control=control_limit,
            control_rate_per_s=control_rate_limit,
            rate_rad_s=rate_limit,
            attitude_rad=attitude_limit,
        ),
        n_records=records,
        seed=seed,
        axis=axis,
    )
    emit(plan, as_json=as_json)
    if csv_file is not None:
        note(f"Wrote {excitation.write_csv(plan.excitation, csv_file)}")
    if param is not None:
        made = excitation.ardupilot_parameters(plan.excitation)
        note(f"Wrote {made.write(param)}")
    if params is not None:
        note(f"Wrote {_write_px4(plan, params, fixed_wing)}")
    if html is not None:
        note(f"Wrote {_write_page(plan, html)}")
    leave_by_verdict(plan.findings)


def _write_px4(plan: Plan, path: Path, fixed_wing: bool) -> Path:
    from math import tau

    from flightid.excitation import px4_parameters

    if not fixed_wing:
        return px4_parameters(vehicle="multicopter").write(path)
    low, high = plan.band_rad_s
    made = px4_parameters(
        vehicle="fixed_wing",
        start_hz=low / tau,
        stop_hz=high / tau,
        duration_s=plan.excitation.duration_s,
    )
    return made.write(path)


def _write_page(plan: Plan, path: Path) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.excitation import excitation_history, plan_spectrum
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Document, Section
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html

    pictures = (
        figure_block(excitation_history(plan.excitation), "The input as it would be flown."),
        figure_block(
            plan_spectrum(plan),
            "Power of the input over the target band (shaded), and the coherence and error of a "
            "response that the guess lets expect.",
        ),
    )
    sections = (
        Section("Go or no-go", result_blocks(plan)),
        Section("Input", result_blocks(plan.excitation)),
        Section("Pictures", pictures),
    )
    return write_atomically(path, to_html(Document("Excitation design", repr(plan), sections)))
