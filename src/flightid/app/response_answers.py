"""Answers on the socket: the responses of a model under edits that are not written yet."""

from __future__ import annotations

from flightid.app import work
from flightid.app.backstage import Backstage
from flightid.app.schemas import Question, ResponseAnswer, ResponsePart, ResponseQuestion
from flightid.app.study_edits import KeyEdit
from flightid.errors import FlightidError


async def answer_response(question: Question, backstage: Backstage) -> ResponseAnswer:
    """Responses as the study would give them with these edits."""
    assert isinstance(question, ResponseQuestion)
    try:
        path, text = backstage.studies.opened(question.log)
    except FlightidError as error:
        return ResponseAnswer(request=question.request, error=str(error))
    edits = [KeyEdit(tuple(each.path), each.value) for each in question.edits]
    inputs = (path, text, question.model, edits, question.around, question.intervals)
    made, refusal, seconds = await backstage.workers.live(work.make_responses, *inputs)
    if refusal:
        return ResponseAnswer(request=question.request, error=refusal, seconds=seconds)
    shown = ResponsePart(**made)
    return ResponseAnswer(request=question.request, response=shown, seconds=seconds)
