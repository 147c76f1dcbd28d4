"""The socket: questions of a hand that drags, of each kind only the newest worth an answer."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import suppress

from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from flightid.app.backstage import Backstage
from flightid.app.gain_answers import answer_gains
from flightid.app.gain_schemas import GainsQuestion
from flightid.app.model_routes import answer_prediction
from flightid.app.model_schemas import PredictionQuestion
from flightid.app.response_answers import answer_response
from flightid.app.schemas import Job, JobNews, Question, Reply, ResponseQuestion
from flightid.frozen import dataclass

MOST_WORDS = 1 << 16


@dataclass(frozen=True)
class Answerer:
    """What questions of a kind look like, and who answers them."""

    question: type[Question]
    answer: Callable[[Question, Backstage], Awaitable[Reply]]


ANSWERERS: dict[str, Answerer] = {
    "response": Answerer(ResponseQuestion, answer_response),
    "gains": Answerer(GainsQuestion, answer_gains),
    "prediction": Answerer(PredictionQuestion, answer_prediction),
}
"""By kind; a screen that asks while a hand drags adds its own."""


def add_socket(app: FastAPI, backstage: Backstage) -> None:
    """Reply questions and tell news of jobs on ``/api/live``."""

    @app.websocket("/api/live")
    async def live(socket: WebSocket) -> None:
        await socket.accept()
        news: asyncio.Queue[Job] = asyncio.Queue()
        newest = {kind: NewestQuestion() for kind in ANSWERERS}
        leave = backstage.workers.listen(news.put_nowait)
        sides = [asyncio.create_task(_tell(socket, news))]
        sides += [
            asyncio.create_task(_answer(socket, waiting, ANSWERERS[kind], backstage))
            for kind, waiting in newest.items()
        ]
        try:
            while True:
                words = await socket.receive_text()
                if len(words) > MOST_WORDS:
                    await socket.close(1009)
                    return
                question = read_question(words)
                newest[question.kind].put(question)
        except ValueError:
            await socket.close(1007)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            leave()
            for side in sides:
                side.cancel()
                with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                    await side


def read_question(words: str) -> Question:
    """A question of a known kind.

    Raises
    ------
    ValueError
        It is none.
    """
    try:
        kind = str(json.loads(words).get("kind", "response"))
        return ANSWERERS[kind].question.model_validate_json(words)
    except (ValidationError, AttributeError, KeyError, RecursionError) as error:
        raise ValueError(str(error)) from error


class NewestQuestion:
    """Room for one question: a newer one takes the place of an older that waits."""

    def __init__(self) -> None:
        self._question: Question | None = None
        self._there = asyncio.Event()

    def put(self, question: Question) -> None:
        """Ask; what was asked before and not begun is dropped."""
        self._question = question
        self._there.set()

    async def get(self) -> Question:
        """The newest question, when there is one."""
        await self._there.wait()
        self._there.clear()
        assert self._question is not None
        return self._question


async def _tell(socket: WebSocket, news: asyncio.Queue[Job]) -> None:
    while True:
        await socket.send_text(JobNews(job=await news.get()).model_dump_json())


async def _answer(
    socket: WebSocket, newest: NewestQuestion, answerer: Answerer, backstage: Backstage
) -> None:
    while True:
        answer = await answerer.answer(await newest.get(), backstage)
        await socket.send_text(answer.model_dump_json())
