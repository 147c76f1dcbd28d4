"""``flightid design``: an input for a target band, judged on a guess of the vehicle."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.excitation import Plan
    from flightid.logs import Log
    from flightid.options import Options

MIXER_ROLL = 10
MIXER_AXES = {MIXER_ROLL: "roll", 11: "pitch", 12: "yaw"}
"""SID_AXIS that inject at the mixer, behind the controllers."""
DEFAULT_LOOP_HZ = 400.0
FILE = click.Path(dir_okay=False, path_type=Path)


def _fields() -> dict[str, type[Options]]:
    from flightid.excitation import Limits, RateAxis
    from flightid.excitation.options import DesignOptions

    return {"the design": DesignOptions, "the guess": RateAxis, "the limits": Limits}


class Kinds(click.Choice[str]):
    """Kinds of design, read when they are asked for: the list of all commands costs nothing."""

    def __init__(self) -> None:
        self.case_sensitive = True

    @cached_property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]  # click sets it at once
        """Names that `flightid.excitation.plan` takes."""
        from flightid.excitation.design import KINDS

        return tuple(KINDS)


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument("kind", type=Kinds())
@click.option("--csv", "csv_file", type=FILE, help="Write the samples to this file.")
@click.option("--param", type=FILE, help="Write ArduPilot parameters (kind ardupilot_chirp).")
@click.option("--params", type=FILE, help="Write PX4 parameters: logging, and what it can inject.")
@click.option(
    "--log",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Flight whose autopilot keeps its loops on meanwhile; with --param alone: its defaults. "
    "With --param: also the file that takes every change back.",
)
@click.option("--fixed-wing", is_flag=True, help="With --params: a fixed wing sweeps the band.")
@click.option("--html", type=FILE, help="Write a page with pictures to this file.")
@json_option
def command(
    kind: str,
    csv_file: Path | None,
    param: Path | None,
    params: Path | None,
    log: Path | None,
    fixed_wing: bool,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Design an input and say whether to fly it.

    Prints what the flight would give and a go/no-go list; the exit code is 1 for no-go.
    """
    from flightid import excitation

    if param is not None and kind != "ardupilot_chirp":
        raise click.UsageError("--param needs the kind ardupilot_chirp")
    of_design, guess, limits = parted(options, _fields())
    flown = None if log is None else _flown(log, kind, params is not None, fixed_wing)
    if flown is not None or param is not None:
        guess = _with_loops(guess, of_design.get("axis", MIXER_ROLL), flown)
    plan = excitation.plan(
        kind, excitation.RateAxis(**guess), limits=excitation.Limits(**limits), **of_design
    )
    emit(plan, as_json=as_json)
    if csv_file is not None:
        note(f"Wrote {excitation.write_csv(plan.excitation, csv_file)}")
    if param is not None:
        _write_ardupilot(plan, param, flown)
    if params is not None:
        note(f"Wrote {_write_px4(plan, params, fixed_wing)}")
    if html is not None:
        note(f"Wrote {_write_page(plan, html)}")
    leave_by_verdict(plan.findings)


def _flown(path: Path, kind: str, for_px4: bool, fixed_wing: bool) -> Log:
    """The log, if its autopilot can fly what is designed.

    Raises
    ------
    OptionError
        Another autopilot's log, or another vehicle's, than the settings are for.
    """
    from flightid import read_log
    from flightid.errors import OptionError

    flown = read_log(path)
    wanted = [("ardupilot", "copter")] if kind == "ardupilot_chirp" else []
    wanted += [("px4", "plane" if fixed_wing else "copter")] if for_px4 else []
    for autopilot, vehicle in wanted:
        if flown.kind != autopilot or flown.vehicle not in (vehicle, None):
            raise OptionError(
                "the log comes from an autopilot that cannot fly this design",
                found=f"{path.name}: {flown.firmware or flown.kind}, {flown.vehicle or 'vehicle'}",
                needed=f"a log of {autopilot}, {vehicle}",
                action="give a flight of the vehicle that is to fly it; for PX4 --params, for a "
                "fixed wing --fixed-wing",
            )
    return flown


def _write_ardupilot(plan: Plan, path: Path, flown: Log | None) -> None:
    """The settings, and before them the file that takes them back where a log gives the values.

    Raises
    ------
    OptionError
        Another way back is there already: it may be the only record of what the vehicle flew.
    """
    from flightid.control.autopilots.parameter_files import ROLLBACK
    from flightid.errors import OptionError
    from flightid.excitation import ardupilot_parameters

    current = None if flown is None else flown.parameters
    made = ardupilot_parameters(plan.excitation, current=current)
    if current is not None:
        undo = made.rollback(current)
        back = path.with_name(path.stem + ROLLBACK + path.suffix)
        if back.exists() and back.read_text(encoding="utf-8") != undo.to_text():
            raise OptionError(
                "the file that takes the settings back is there with other values",
                found=back,
                needed="none, or the same values",
                action="keep it, and name another --param file",
            )
        note(f"Wrote {undo.write(back)}")
    note(f"Wrote {made.write(path)}")
    if current is None:
        note("No file takes it back: give --log FLIGHT, whose values are restored")


def _with_loops(guess: dict[str, Any], sid_axis: int, flown: Log | None) -> dict[str, Any]:
    """The guess under the loops that the autopilot keeps on while the mixer is swept.

    They work against what is injected: without them amplitudes come out many times too small.
    """
    from flightid import axis_loop
    from flightid.control.autopilots import axis_loop_of

    axis = MIXER_AXES.get(sid_axis)
    if axis is None or {"rate_feedback", "attitude_feedback_per_s"} & guess.keys():
        return guess
    own = None if flown is None else axis_loop_of(flown, axis)
    loop = own or axis_loop("arducopter", axis, loop_rate_hz=DEFAULT_LOOP_HZ)
    p, angle = loop.values["p"], loop.angle_gain_1_s
    whose = "as flown" if own else "by default; --log FLIGHT takes what flew"
    note(f"Loops kept on: {loop.autopilot} {axis}, P {p:.4g}, angle gain {angle:.4g} 1/s, {whose}")
    sign = 1.0 if guess["gain"] > 0.0 else -1.0
    return guess | {"rate_feedback": sign * p, "attitude_feedback_per_s": angle}


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
    from flightid.plot.inputs import input_figure
    from flightid.record import Record
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
        figure_block(
            input_figure(Record.from_excitation(plan.excitation)),
            "Spectrum of each input, and how often it has each size.",
        ),
    )
    sections = (
        Section("Go or no-go", result_blocks(plan)),
        Section("Input", result_blocks(plan.excitation)),
        Section("Pictures", pictures),
    )
    return write_atomically(path, to_html(Document("Excitation design", repr(plan), sections)))
