"""The sections of a page that review a flight."""

from __future__ import annotations

from flightid.plot.glance import flight_glance, has_glance
from flightid.report.content import Block, Document, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.review import AutotuneReview, FlightReview

FOLDED = {"Modes", "Flown gains", "Filters as flown"}
CAPTION = (
    "Steps of the closed loops with their bands, from ordinary flying: what follows when a "
    "set-point jumps by 1"
)
GLANCE = "The flight: throttle, flight modes, and shaded what was in the air"
NOISE = "Spectrum of the gyroscope in the air with its band"
BY_THROTTLE = "; below it the same by throttle"


def flight_blocks(
    review: FlightReview, *, repeats: bool = False, glance: bool = True
) -> tuple[Block, ...]:
    """Verdicts, picture and tables of a flight.

    Parameters
    ----------
    review : FlightReview
    repeats : bool
        The verdicts are not counted among those of the page: it is about something else.
    glance : bool
        Begin the pictures with throttle and modes.
    """
    # What a reader came for is the picture: verdicts go on for a screen.
    told = any(loop.is_told for loop in review.loops)
    blocks: list[Block] = [figure_block(review.plot(), CAPTION)] if told else []
    if worst_first := tuple(reversed(review.findings)):
        blocks.append(Lights(worst_first, repeats=repeats))
    if glance and has_glance(review):
        blocks.append(figure_block(flight_glance(review), GLANCE))
    if review.noise.is_told:
        blocks.append(
            figure_block(
                review.noise.plot(), NOISE + BY_THROTTLE * (review.noise.throttle.size > 1)
            )
        )
    blocks += [TableBlock(table, table.title in FOLDED) for table in review.tables()]
    return tuple(blocks)


def flight_document(review: FlightReview) -> Document:
    """A page of its own for a flight."""
    opening = (Paragraph(review.answer),)
    return Document(
        f"Flight {review.name}",
        review.in_short,
        (Section("What this flight tells", (*opening, *flight_blocks(review))),),
    )


def autotune_document(review: AutotuneReview) -> Document:
    """A page for an autotune: verdicts, the loops in pictures, tables."""
    blocks: list[Block] = [Lights(tuple(reversed(review.findings)))] if review.findings else []
    for opinion in review.opinions:
        if opinion.tuned is not None:
            caption = (
                f"Rate loop of {opinion.axis} with autotune's gains, by the model of its tests"
            )
            blocks.append(figure_block(opinion.tuned.plot(), caption))
    blocks += [TableBlock(table) for table in review.tables()]
    end = "finished" if review.run.finished else "did not finish"
    short = f"{review.firmware}, autotune {end}"
    return Document(f"Autotune {review.name}", short, (Section("Second opinion", tuple(blocks)),))
