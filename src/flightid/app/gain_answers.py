"""Answers about gains: on the socket while a slider moves, and the files to fly."""

from __future__ import annotations

from fastapi import FastAPI, HTTPException

from flightid.app import gain_work
from flightid.app.backstage import Backstage, LogName, made
from flightid.app.gain_schemas import AxisGains, GainFile, GainsAnswer, GainsPart, GainsQuestion
from flightid.app.schemas import Question
from flightid.app.studies import text_of
from flightid.app.study_edits import KeyEdit
from flightid.errors import FlightidError


async def answer_gains(question: Question, backstage: Backstage) -> GainsAnswer:
    """Gains as the study would give them with these edits; an axis alone where it moves."""
    assert isinstance(question, GainsQuestion)
    try:
        path, text = backstage.studies.opened(question.log)
    except FlightidError as error:
        return GainsAnswer(request=question.request, error=str(error))
    edits = [KeyEdit(tuple(each.path), each.value) for each in question.edits]
    if question.axis:
        values, refusal, seconds = await backstage.workers.tuned(
            gain_work.move_axis,
            path,
            text,
            edits,
            question.axis,
            question.values,
            question.responses,
        )
        told = None if refusal else AxisGains(**values)
        return GainsAnswer(
            request=question.request, moved=told, error=refusal or None, seconds=seconds
        )
    values, refusal, seconds = await backstage.workers.tuned(
        gain_work.make_gains, path, text, edits
    )
    whole = None if refusal else GainsPart(**values)
    return GainsAnswer(
        request=question.request, gains=whole, error=refusal or None, seconds=seconds
    )


def add_gain_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Gains asks for to download."""

    @app.get("/api/studies/{log}/gains")
    async def files(log: LogName) -> list[GainFile]:
        path = backstage.studies.path(log)
        if path is None:
            raise HTTPException(404, "This log has no study.")
        text = text_of(path)
        written: list[GainFile] = await made(
            backstage.workers.tuned(gain_work.make_files, path, text)
        )
        return written
