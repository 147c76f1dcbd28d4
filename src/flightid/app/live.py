"""The socket: questions of a hand that drags, of which only the newest is worth an answer."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from flightid.app import work
from flightid.app.jobs import Workers
from flightid.app.schemas import (
    Job,
    JobNews,
    ResponseAnswer,
    ResponsePart,
    ResponseQuestion,
)
from flightid.app.studies import Studies, text_of
from flightid.app.study_edits import KeyEdit
from flightid.errors import FlightidError

MOST_WORDS = 1 << 16


def add_socket(app: FastAPI, studies: Studies, workers: Workers) -> None:
    """Answer questions and tell news of jobs on ``/api/live``."""

    @app.websocket("/api/live")
    async def live(socket: WebSocket) -> None:
        await socket.accept()
        news: asyncio.Queue[Job] = asyncio.Queue()
        newest = NewestQuestion()
        leave = workers.listen(news.put_nowait)
        sides = [
            asyncio.create_task(_tell(socket, news)),
            asyncio.create_task(_answer(socket, newest, studies, workers)),
        ]
        try:
            while True:
                words = await socket.receive_text()
                if len(words) > MOST_WORDS:
                    await socket.close(1009)
                    return
                newest.put(ResponseQuestion.model_validate_json(words))
        except ValidationError:
            await socket.close(1007)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            leave()
            for side in sides:
                side.cancel()
                with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                    await side


class NewestQuestion:
    """Room for one question: a newer one takes the place of an older that waits."""

    def __init__(self) -> None:
        self._question: ResponseQuestion | None = None
        self._there = asyncio.Event()

    def put(self, question: ResponseQuestion) -> None:
        """Ask; what was asked before and not begun is dropped."""
        self._question = question
        self._there.set()

    async def get(self) -> ResponseQuestion:
        """The newest question, when there is one."""
        await self._there.wait()
        self._there.clear()
        assert self._question is not None
        return self._question


async def _tell(socket: WebSocket, news: asyncio.Queue[Job]) -> None:
    while True:
        await socket.send_text(JobNews(job=await news.get()).model_dump_json())


async def _answer(
    socket: WebSocket, newest: NewestQuestion, studies: Studies, workers: Workers
) -> None:
    while True:
        question = await newest.get()
        answer = await _answered(question, studies, workers)
        await socket.send_text(answer.model_dump_json())


async def _answered(
    question: ResponseQuestion, studies: Studies, workers: Workers
) -> ResponseAnswer:
    path = None
    with suppress(Exception):
        path = studies.path(question.log)
    if path is None:
        return ResponseAnswer(request=question.request, error="This log has no study.")
    try:
        text = text_of(path)
    except FlightidError as error:
        return ResponseAnswer(request=question.request, error=str(error))
    edits = [KeyEdit(tuple(each.path), each.value) for each in question.edits]
    inputs = (path, text, question.model, edits, question.around, question.intervals)
    made, refusal, seconds = await workers.live(work.make_responses, *inputs)
    if refusal:
        return ResponseAnswer(request=question.request, error=refusal, seconds=seconds)
    shown = ResponsePart(**made)
    return ResponseAnswer(request=question.request, response=shown, seconds=seconds)
