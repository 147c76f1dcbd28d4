"""Gains of a study in one sentence, with what to fly next, and their tables on the first screen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from flightid.control.autopilots.angle_law import angle_law
from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.margins.rigid_vehicle import DECLARED
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.result import untouched_finding
from flightid.control.tuning.unpromised import outside_words
from flightid.conventions import Light
from flightid.findings import MOST_DIGITS, Finding, at_least, counted, worst
from flightid.table import Cell, Column, Table

if TYPE_CHECKING:
    from flightid.control.tuning.pid_design import PidDesign
    from flightid.control.tuning.result import Tuning
    from flightid.control.tuning.tuned_filters import TunedFilters
    from flightid.vehicles import GainFlight

WIDE_DEG = 20.0
"""Angles that quick sticks do not exceed at once."""
MARGINS = {"phase margin": "deg", "gain margin": "dB"}


def gains_finding(
    tuning: Tuning,
    source: str,
    written: Sequence[str] = (),
    results: str = "",
    gains_file: str = "",
) -> Finding:
    """Whether there are gains, and what they promise or what is in the way.

    `gains_file` is what the reader calls the file of gains, where it is not the usual name.
    """
    designs, findings = tuning.sound, tuning.findings
    left = _each_left(tuning.left_out)
    red = next((each for each in findings if each.light is Light.RED), None)
    if not designs:
        action = red.action if red else "relax what cannot be met, or identify better"
        return Finding("gains", Light.RED, f"no gains to fly: {left}", action)
    least = [
        each.worst
        for design in designs
        for each in design.worst_cases
        if each.name == "phase margin" and each.worst is not None
    ]
    if least:
        promise = f" keep at least {at_least(min(least))}° of phase margin"
    else:
        promise = " keep their limits in the band shown, with no phase margin promised,"
    steps = max(len(design.stages) for design in designs)
    axes = ", ".join(design.axis for design in designs)
    plain = any(isinstance(design.loop, PidLoop) for design in designs)
    if plain:
        coded = all(design.plain and design.plain.sampled for design in designs)
        files = "controller.toml and controller.c" if coded else "controller.toml"
        where = f"stand in {written[0]}" if written else f"lie beside the report as {files}"
        way = f"they {where}: close the loop with them, and log"
    else:
        file = Path(gains_file or f"gains{parameter_suffix(designs[0].flown.autopilot)}")
        stepped = file.with_name(f"{file.stem}{'-1' if steps > 1 else ''}{file.suffix}")
        first = written[0] if written else quote(str(stepped))
        step = f", step 1 of {steps}" if steps > 1 else ""
        way = ""
        if not written:
            way = f"flightid tune {source} --write {quote(str(file))} writes them; "
        way += (
            f"fly {first}{step}: {_moves(designs)}; log, then "
            f"flightid compare {results} LOG: kept or not"
        )
    what = "rig" if plain else "vehicle"
    light = worst(findings) if findings else Light.GREEN
    message = f"gains of {axes}{promise} at the worst {what} that the data allow"
    if any(each.code == DECLARED for each in findings):
        message += ", declared rigid"
    asked = designs[0].requirements.phase_margin_deg
    if least and min(least) < asked:
        share = min(design.share_met for design in designs)
        message += (
            f" ({at_least(100.0 * share, 1)} % of them or more keep {asked:g}° and all else asked)"
        )
    if left:
        message += _kept(tuning.left_out, plain=plain)
    else:
        message += _doubt(tuning, light)
    if tuning.untouched:
        message += f"; {untouched_finding(tuning.untouched).message}"
    return Finding("gains", light, message, way)


def _each_left(left: Mapping[str, str]) -> str:
    return "; ".join(f"{axis}: {why}" for axis, why in left.items())


def _kept(left: Mapping[str, str], *, plain: bool) -> str:
    """What becomes of the other axes, whose reasons speak of none of the gains that are made."""
    if plain:
        return f"; none are made of {_each_left(left)}"
    if len(left) == 1:
        ((axis, why),) = left.items()
        return f", and are to be flown; {axis} stays as flown: {why}"
    return f", and are to be flown; {', '.join(left)} stay as flown: {_each_left(left)}"


def _moves(designs: Iterable[PidDesign]) -> str:
    """What to fly of the first step, so that what is promised of it can be judged."""
    laws = [
        angle_law(
            each.flown.autopilot,
            {**each.flown.gains, **(each.stages[0].gains if each.stages else {})},
            each.axis,
        )
        for each in designs
        if each.axis != "yaw"
    ]
    ends = [law.proportional_to_rad for law in laws if law is not None]
    least = math.degrees(min(ends, default=math.inf))
    size = f", roll and pitch by no more than {least:.2g} deg at once" if least < WIDE_DEG else ""
    return f"a minute of quick moves of each stick{size}"


def _doubt(tuning: Tuning, light: Light) -> str:
    """The first reason for which gains are not green, whose it is, and how many more there are."""
    if light is Light.GREEN:
        return ""
    doubts = [each for each in tuning.findings if each.light is light]
    first, *others = doubts
    alike = sum(each.code == first.code for each in others)
    kinds = len({each.code for each in others} - {first.code})
    axis = next((f"{each.axis} " for each in tuning.designs if first in each.findings), "")
    more = [f"so for {alike} more"] if alike else []
    more += [counted(kinds, "other reason")] if kinds else []
    return f"; but {axis}{first.message}" + (f" ({', '.join(more)}: report)" if more else "")


def flown_again(flight: GainFlight) -> Finding:
    """Whether the simulated vehicle keeps what the gains promise."""
    first = next((each for each in flight.findings if each.light is Light.RED), None)
    said = f"{flight.meeting} of {len(flight.judged)} pairs of 95 % intervals meet"
    least = [
        each.measured.value
        for each in flight.margins
        if each.name == "phase margin" and each.measured.value is not None
    ]
    said += f", least phase margin {at_least(min(least))}°" if least else ""
    told = f"flown again in the simulated vehicle: {first.message if first else said}"
    return Finding("flown-again", worst(flight.findings), told, first.action if first else "")


def gain_tables(designs: tuple[PidDesign, ...], filters: TunedFilters | None) -> tuple[Table, ...]:
    """Gains and margins; where no margin is promised, the gains say so, without a table of none."""
    gains, margins = gain_table(designs, filters), margin_table(designs)
    if margins.rows:
        return gains, margins
    return (replace(gains, notes=(*gains.notes, *margins.notes)),)


def gain_table(designs: tuple[PidDesign, ...], filters: TunedFilters | None) -> Table:
    """Each gain and filter as flown, of the first step, and new.

    What is to be flown next stands beside what flew: a phone shows no more columns.
    """
    columns = (
        Column("axis"), Column("parameter"), Column("flown"), Column("first step"),
        Column("new"), Column("ratio", digits=3),
    )  # fmt: skip
    named = {each.name: each for design in designs for each in design.filters}
    rows: list[tuple[Cell, ...]] = [
        ("filter", each.name, each.old, each.value, each.value,
         each.value / each.old if each.old else None)
        for each in named.values()
    ]  # fmt: skip
    rows += [
        (
            design.axis, change.name, change.flown,
            design.stages[0].gains.get(change.name) if len(design.stages) > 1 else None,
            change.new, change.ratio,
        )
        for design in designs
        for change in design.changes
    ]  # fmt: skip
    notes = (*(() if filters is None else filters.words), *small_angles(designs))
    plain = any(isinstance(each.loop, PidLoop) for each in designs)
    title = "Gains of the controller" if plain else "Gains to fly"
    return Table(title, columns, tuple(rows), notes).without_empty_columns()


def small_angles(designs: Iterable[PidDesign]) -> Iterator[str]:
    """Up to which error angle controllers do what is promised, where parameters end it."""
    said: list[str] = []
    bounds: dict[str, None] = {}
    for design in designs:
        flown, new = (
            angle_law(each.autopilot, each.gains, design.axis)
            for each in (design.flown, design.loop)
        )
        if flown is None or new is None or not math.isfinite(new.proportional_to_rad):
            continue
        before, after = (math.degrees(each.proportional_to_rad) for each in (flown, new))
        said.append(f"{after:.2g} deg in {design.axis} ({before:.2g} as flown)")
        bounds[new.bound] = None
    if said:
        yield (
            f"Angle steps are promised for errors up to {', '.join(said)}: larger ones are "
            f"answered more slowly ({', '.join(bounds)})."
        )


def margin_table(designs: tuple[PidDesign, ...]) -> Table:
    """Least margins of each loop beside those of the flown gains."""
    columns = [Column("axis"), Column("loop")]
    for name, unit in MARGINS.items():
        columns += [Column(each, unit, MOST_DIGITS) for each in (name, f"{name} as flown")]
    rows: list[tuple[Cell, ...]] = []
    for design in designs:
        for loop in dict.fromkeys(each.loop for each in design.worst_cases):
            cells: list[Cell] = []
            for name in MARGINS:
                found = [e for e in design.worst_cases if (e.loop, e.name) == (loop, name)]
                cells += found[0].shown_worst if found else (None, None)
            if any(cell is not None for cell in cells):
                rows.append((design.axis, loop, *cells))
    asked = designs[0].requirements
    angled = any(each.loop == ANGLE for design in designs for each in design.worst_cases)
    angle = f" ({asked.angle_phase_margin_deg:g} deg of the angle loop)" if angled else ""
    note = f"Required: {asked.phase_margin_deg:g} deg{angle} and {asked.gain_margin_db:g} dB."
    notes = [note]
    beyond = any(f.code == "margin-beyond-band" for each in designs for f in each.findings)
    cases = (e for design in designs for e in design.worst_cases if e.name in MARGINS)
    if outside := outside_words(cases, above=beyond):
        shown = [[row[2 + 2 * place] for row in rows] for place in range(len(MARGINS))]
        gone = [name for name, cells in zip(MARGINS, shown, strict=True) if {*cells} <= {None}]
        dashed = any(None in cells and {*cells} != {None} for cells in shown)
        what = " and ".join(["–"] * (dashed or not gone) + gone)
        notes.append(f"{what}: not promised, for {outside}.")
    what = "rig" if any(isinstance(each.loop, PidLoop) for each in designs) else "vehicle"
    title = f"Margins of the worst {what} that the data allow"
    return Table(title, tuple(columns), tuple(rows), tuple(notes)).without_empty_columns()
