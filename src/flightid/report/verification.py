"""Verifications as report blocks: verdicts and numbers, then each record as it was predicted."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.plot.verification import (
    comparison,
    mismatch_comparison,
    mismatch_envelopes,
    prediction,
    residuals,
)
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Figure, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.validation import Comparison, Mismatch, Verification

SHOWN = 1
"""Records, and pairs of envelopes, whose pictures are open; those of others open on demand."""


def verification_blocks(result: Verification | Comparison) -> tuple[Block, ...]:
    """Numbers and verdicts of one model or of several side by side, then a picture by record.

    Parameters
    ----------
    result : Verification or Comparison
        What `flightid.verify` made.

    Returns
    -------
    tuple of Block
    """
    title = "Errors of the predictions" if isinstance(result, Comparison) else "Errors"
    pictures = [
        prediction_picture(result, record) for record in range(len(_first(result).predictions))
    ]
    return (*result_blocks(result, title=title), *pictures, *_errors(result), *_envelopes(result))


def verification_sections(result: Verification | Comparison) -> tuple[Section, ...]:
    """The same as a page: verdicts first, then a section for each record with its residuals.

    Parameters
    ----------
    result : Verification or Comparison
        What `flightid.verify` made.

    Returns
    -------
    tuple of Section
    """
    first = _first(result)
    parts = [Section("Verdicts", (*result_blocks(result), *_envelopes(result)))]
    for record, item in enumerate(first.predictions):
        errors = figure_block(residuals(item), "Measured minus predicted.")
        parts.append(Section(item.measured.name, (prediction_picture(result, record), errors)))
    return tuple(parts)


def _first(result: Verification | Comparison) -> Verification:
    return result.first if isinstance(result, Comparison) else result


def prediction_picture(result: Verification | Comparison, record: int) -> Figure:
    """One record as it was measured, and as it is predicted."""
    name = _first(result).predictions[record].measured.name
    if isinstance(result, Comparison):
        shown = f"{name}: measured, and predicted by each model{_from(result.first)}."
        return figure_block(comparison(result, record), shown, folded=record >= SHOWN)
    shown = f"{name}: measured, and predicted{_from(result)}."
    return figure_block(prediction(result.predictions[record]), shown, folded=record >= SHOWN)


def _errors(result: Verification | Comparison) -> tuple[Block, ...]:
    """Measured minus predicted, of the records whose pictures are open."""
    shown = _first(result).predictions[:SHOWN]
    return tuple(
        figure_block(residuals(each), f"{each.measured.name}: measured minus predicted.")
        for each in shown
    )


def _from(verification: Verification) -> str:
    """What the predictions know."""
    steps = verification.horizon
    if not isinstance(steps, int):
        return " from the inputs alone"
    return f" {steps} sample{'' if steps == 1 else 's'} ahead from the measured past"


def _envelopes(result: Verification | Comparison) -> tuple[Block, ...]:
    """Frequency-domain part, where a measured response was given."""
    if not isinstance(result, Comparison):
        if result.mismatch is None:
            return ()
        shown = "Model over flight inside the envelopes of maximum unnoticed added dynamics."
        table = TableBlock(result.mismatch.summary(), folded=True)
        return (figure_block(mismatch_envelopes(result.mismatch), shown), table)
    items = {
        name: each.mismatch
        for name, each in result.verifications.items()
        if each.mismatch is not None
    }
    return tuple(
        figure_block(
            mismatch_comparison(items, pair),
            f"{pair}: models over flight inside the envelopes of maximum unnoticed added dynamics.",
            folded=place >= SHOWN,
        )
        for place, pair in enumerate(_shared_pairs(items.values()))
    )


def _shared_pairs(items: Iterable[Mismatch]) -> tuple[str, ...]:
    shown: dict[str, int] = {}
    several = list(items)
    for pair in (name for each in several for name in each.names):
        shown[pair] = shown.get(pair, 0) + 1
    return tuple(pair for pair, count in shown.items() if count == len(several))
