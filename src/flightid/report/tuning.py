"""What a report shows of tuned gains: verdicts, tables, and the pictures behind them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from flightid.control.tuning.result import untouched_finding
from flightid.plot.margins import loop_bode
from flightid.plot.tuning import gain_map, nichols, time_responses
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Lights, Section, TableBlock
from flightid.report.figures import figure_block

if TYPE_CHECKING:
    from flightid.control.tuning.pid_design import PidDesign
    from flightid.control.tuning.result import Tuning
    from flightid.vehicles import GainFlight


def design_blocks(design: PidDesign) -> tuple[Block, ...]:
    """Blocks of a section about one axis.

    Parameters
    ----------
    design : PidDesign

    Returns
    -------
    tuple of Block
    """
    return (
        *result_blocks(design),
        *((TableBlock(design.plain.form_table()),) if design.plain and design.exists else ()),
        TableBlock(design.worst_case_table(), folded=design.exists),
        *(_pictures(design) if design.exists else ()),
        *((TableBlock(design.stage_table()),) if len(design.stages) > 1 else ()),
    )


def tuning_section(tuning: Tuning, title: str = "Gains") -> Section:
    """Section about several axes: what they do together, then each.

    Parameters
    ----------
    tuning : Tuning
    title : str
    """
    blocks: list[Block] = []
    if tuning.refused:
        blocks.append(Lights(tuple(each.finding for each in tuning.refused)))
    if tuning.untouched:
        blocks.append(Lights((untouched_finding(tuning.untouched),)))
    verdicts = [finding for each in tuning.together for finding in each.findings()]
    if tuning.together:
        blocks += [Lights(tuple(verdicts)), TableBlock(tuning.together_table())]
    if any(each.closed for each in tuning.together):
        blocks.append(TableBlock(tuning.closed_table()))
    if tuning.filters is not None:
        blocks += [Lights(tuning.filters.findings()), TableBlock(tuning.filters.table())]
    parts = tuple(
        Section(f"{design.axis.capitalize()} gains", design_blocks(design))
        for design in tuning.designs
    )
    return Section(title, tuple(blocks), parts)


def gain_flight_blocks(flown: GainFlight) -> tuple[Block, ...]:
    """Blocks of a section about gains that were flown again.

    Parameters
    ----------
    flown : GainFlight

    Returns
    -------
    tuple of Block
    """
    pictures = (
        figure_block(
            loop_bode(found),
            f"{name}: the broken loop as flown with the new gains, with its 95 % band.",
        )
        for name, found in flown.loops.items()
    )
    return (*result_blocks(flown), *pictures)


def _pictures(design: PidDesign) -> Iterator[Block]:
    yield figure_block(
        time_responses(design),
        "Steps of the set-points and of a disturbance (one unit of output): the estimate, the "
        "extremes of all plants shaded, and the flown gains.",
    )
    yield figure_block(
        nichols(design),
        "Loops in the Nichols plane; thin lines: other plants that the data allow; grey: where "
        "the sensitivity would be too high.",
    )
    if {"P", "D"} <= set(design.problem.kinds):
        yield figure_block(
            gain_map(design),
            "Inside the green line every requirement is met, all other gains in proportion; "
            "shading: the objective against its best.",
        )
