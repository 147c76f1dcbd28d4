"""``flightid design``: an input for a target band, judged on a guess of the vehicle."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import WRITTEN, emit, json_option, leave_by_verdict, note
from flightid.cli.pages import html_option

if TYPE_CHECKING:
    from flightid.excitation import Plan
    from flightid.options import Options


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
@click.option("--write", "target", type=WRITTEN, help="Write the samples to this file (*.csv).")
@html_option
@json_option
def command(
    kind: str,
    target: Path | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Design an input and say whether to fly it.

    For rigs, and to try inputs on a guess. Sweeps that an autopilot flies, with its loops closed:
    `flightid plan`. Prints what the flight would give and a go/no-go list; exit code 1 is no-go.
    """
    from flightid import excitation

    of_design, guess, limits = parted(options, _fields())
    plan = excitation.plan(
        kind, excitation.RateAxis(**guess), limits=excitation.Limits(**limits), **of_design
    )
    emit(plan, as_json=as_json)
    if target is not None:
        note(f"Wrote {excitation.write_csv(plan.excitation, target)}")
    if html is not None:
        note(f"Wrote {_write_page(plan, html)}")
    leave_by_verdict(plan.findings)


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
