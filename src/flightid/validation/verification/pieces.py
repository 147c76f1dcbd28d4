"""Records over which a mode of the model grows: they are predicted piece by piece."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction.continuous import TOLD_BY_ALL
from flightid.identification.prediction.result import Prediction
from flightid.record import Record
from flightid.validation.verification.foretold_error import unless_gusts
from flightid.validation.verification.judgement import THEIL_GUIDE, light_of, overall_theil
from flightid.validation.verification.refuted_parameters import QuestionedRuns

GROWTH = "verification-growth"
MANY = 10
"""Pieces of a record that tell enough: of many more, a part at equal distances is run."""


def growth_findings(
    predictions: Sequence[Prediction],
    run: Callable[[tuple[Record, ...]], Sequence[Prediction]],
    asked: QuestionedRuns | None = None,
) -> tuple[Finding, ...]:
    """Judge what a solved start explains over a whole record by runs through pieces of it.

    Gusts make poor runs of a right model here too: none is red whose error no input foretells.

    Parameters
    ----------
    predictions : sequence of Prediction
        Over whole records.
    run : callable
        Predicts further records with the same model in the same way.
    asked : QuestionedRuns, optional
        Where inputs ask other parameters, gusts are no excuse.
    """
    grown = [
        each
        for each in predictions
        if each.shifts.e_folds >= TOLD_BY_ALL and np.any(each.shifts.initial_state)
    ]
    if not grown:
        return ()
    longest = max(each.shifts.e_folds for each in grown)
    pieces = tuple(piece for each in grown for piece in _pieces(each))
    made = run(pieces)
    theil = overall_theil(made, made[0].outputs)
    light = light_of(theil, THEIL_GUIDE)
    found = Finding(
        GROWTH,
        light,
        f"a mode grows by exp({longest:.3g}) over a record, so the free run is set by all of "
        f"it: explained rather than predicted; {len(made)} pieces of "
        f"{pieces[0].duration_s:.3g} s, each from its own start, are predicted with a Theil "
        f"coefficient of {theil:.3f}",
        "" if light is Light.GREEN else "look where the prediction parts from the record",
    )
    if asked is not None and asked.is_refuted:
        return (found,)
    innovations = () if asked is None else asked.innovations
    return (unless_gusts({None: found}, predictions if innovations else made, innovations)[None],)


def _pieces(whole: Prediction) -> list[Record]:
    """Parts of a record of equal length, short enough for a run from a start of their own."""
    record = whole.measured
    count = math.floor(whole.shifts.e_folds / TOLD_BY_ALL) + 1
    length = record.n_samples // count
    half = 0.5 * record.sample_time_s
    time_s, names = record.time_s, f"{record.name}, piece"
    return [
        record.segment(
            time_s[place * length] - half,
            time_s[(place + 1) * length - 1] + half,
            name=f"{names} {place + 1}",
        )
        for place in range(0, count, max(count // MANY, 1))
    ]
