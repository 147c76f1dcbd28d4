"""The page that any command with a picture writes: numbers, picture, lights."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.output import (
    WRITTEN,
    Function,
    emit,
    emit_values,
    leave_by_verdict,
    note,
    of_a_page,
)

if TYPE_CHECKING:
    from flightid.report.content import Document
    from flightid.result import Result
    from flightid.review import AutotuneReview, FlightReview


def html_option(function: Function) -> Function:
    """Add ``--html`` to a command whose result has a picture; its argument is ``html``."""
    decorate = click.option(
        "--html",
        type=WRITTEN,
        callback=of_a_page,
        help="Write a page with numbers and pictures to this file.",
    )
    return decorate(function)


def model_file_option(function: Function) -> Function:
    """Add ``--write`` to a command that fits a model; its argument is ``written``."""
    decorate = click.option(
        "--write",
        "written",
        type=WRITTEN,
        help="Model file (.toml) to write: estimates with covariance and evidence.",
    )
    return decorate(function)


def show(
    result: Result,
    title: str,
    *beside: Result,
    as_json: bool,
    html: Path | None = None,
    level: float | None = None,
) -> None:
    """Print a result, write its page where one was asked for, and leave by its verdict.

    Parameters
    ----------
    result : Result
    title : str
        Of the page.
    *beside : Result
        What belongs to it; in JSON under ``beside``.
    as_json : bool
    html : Path, optional
    level : float, optional
        Of the intervals.
    """
    from flightid.uncertainty.quantiles import showing

    if as_json and beside:
        emit_values({**result.to_dict(), "beside": [one.to_dict() for one in beside]})
    else:
        for place, one in enumerate((result, *beside)):
            click.echo("", nl=place > 0)
            emit(one, as_json=as_json, level=level)
    if html is not None:
        with showing(level):
            note(f"Wrote {write_page(result, title, html, *beside)}")
    leave_by_verdict([finding for one in (result, *beside) for finding in one.findings])


def show_review(
    review: FlightReview | AutotuneReview,
    document: Callable[[Any], Document],
    *,
    as_json: bool,
    html: Path | None,
) -> None:
    """Print the review of a log, and write its page where one was asked for."""
    if as_json:
        emit_values(review.to_dict())
    else:
        click.echo(review.to_text())
    if html is not None:
        from flightid.files import write_atomically
        from flightid.report.html import to_html

        note(f"Wrote {write_atomically(html, to_html(document(review)))}")


def write_page(result: Result, title: str, path: Path, *beside: Result) -> Path:
    """Write the tables and the picture of a result, and of others beside it, as one page."""
    from flightid.errors import DataError, OptionError
    from flightid.files import write_atomically
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Block, Document, Section, TableBlock
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html

    sections, missing = [], []
    for one in (result, *beside):
        blocks: list[Block] = [*result_blocks(one)]
        blocks += [TableBlock(each) for each in one.settings_tables()]
        try:
            blocks.append(figure_block(one.plot(), one.summary().title))
        except (OptionError, DataError) as reason:
            missing.append(reason.reason)
        sections.append(Section(one.summary().title, tuple(blocks)))
    if len(missing) == len(sections):
        note(f"No picture: {'; '.join(missing)}")
    return write_atomically(
        path, to_html(Document(title, getattr(result, "in_short", ""), tuple(sections)))
    )
