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
    from flightid.excitation import Excitation, Plan
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
    Without a guess (--gain, --time-constant) the input is made and nothing is said of its flight.
    """
    from flightid import excitation

    if not _is_guessed(options):
        made = _unjudged(kind, options)
        emit(made, as_json=as_json)
        plan = None
    else:
        of_design, guess, limits = parted(options, _fields())
        plan = excitation.plan(
            kind, excitation.RateAxis(**guess), limits=excitation.Limits(**limits), **of_design
        )
        made = plan.excitation
        emit(plan, as_json=as_json)
    if target is not None:
        note(f"Wrote {excitation.write_csv(made, target)}")
    if html is not None:
        note(f"Wrote {_write_page(made, plan, html)}")
    if plan is None:
        note(
            "not judged: what this input would give, and whether it is safe; a guess of the rate "
            "that it moves tells that: --gain, --time-constant"
        )
    else:
        leave_by_verdict(plan.findings)


def _is_guessed(options: dict[str, Any]) -> bool:
    """Whether anything is said of the vehicle."""
    from flightid.excitation import RateAxis
    from flightid.options import options_of

    return any(options.get(each.name) not in (None, ()) for each in options_of(RateAxis))


def _unjudged(kind: str, options: dict[str, Any]) -> Excitation:
    """The input by itself, for a rig of which nothing is known yet."""
    from flightid.excitation.design import designed
    from flightid.excitation.options import DesignOptions

    (asked,) = parted(options, {"a design without a guess of the vehicle": DesignOptions})
    return designed(kind, DesignOptions(**asked))


def _write_page(made: Excitation, plan: Plan | None, path: Path) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.excitation import excitation_history, plan_spectrum
    from flightid.plot.inputs import input_figure
    from flightid.record import Record
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Document, Section
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html

    pictures = [figure_block(excitation_history(made), "The input as it would be flown.")]
    if plan is not None:
        expected = (
            "Power of the input over the target band (shaded), and the coherence and error of a "
            "response that the guess lets expect."
        )
        pictures.append(figure_block(plan_spectrum(plan), expected))
    shown = "Spectrum of each input, and how often it has each size."
    pictures.append(figure_block(input_figure(Record.from_excitation(made)), shown))
    judged = () if plan is None else (Section("Go or no-go", result_blocks(plan)),)
    sections = (
        *judged,
        Section("Input", result_blocks(made)),
        Section("Pictures", tuple(pictures)),
    )
    title = repr(made if plan is None else plan)
    return write_atomically(path, to_html(Document("Excitation design", title, sections)))
