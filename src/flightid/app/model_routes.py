"""Answers of the screen Model: the library, a model of a study, how it is put there."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from fastapi import FastAPI, HTTPException

from flightid.app import model_prediction, model_work
from flightid.app.backstage import Backstage, LogName, made
from flightid.app.model_schemas import (
    ModelAnswer,
    ModelRequest,
    ModelUse,
    OwnModel,
    OwnModelAnswer,
    PredictionAnswer,
    PredictionQuestion,
    ShownModel,
    UseEdits,
)
from flightid.app.own_folders import own_folder
from flightid.app.schemas import Question
from flightid.app.studies import text_of
from flightid.app.study_edits import KeyEdit
from flightid.errors import FlightidError
from flightid.files import write_atomically

MODELS = "models"
"""Folder of the workspace with the models of its own."""


async def answer_prediction(question: Question, backstage: Backstage) -> PredictionAnswer:
    """Measured against predicted with the values of sliders."""
    assert isinstance(question, PredictionQuestion)
    try:
        path, text = backstage.studies.opened(question.log)
    except FlightidError as error:
        return PredictionAnswer(request=question.request, error=str(error))
    edits = [KeyEdit(tuple(each.path), each.value) for each in question.edits]
    work = (model_prediction.predict_model, path, text, edits, question.model, question.values)
    told, refusal, seconds = await backstage.workers.live(*work)
    given = {"error": refusal} if refusal else told
    return PredictionAnswer(request=question.request, seconds=seconds, **given)


def add_model_routes(app: FastAPI, backstage: Backstage) -> None:
    """Answer what the screen Model asks."""
    workers = backstage.workers
    library: list[ShownModel] = []

    def study_of(log: str) -> tuple[Path, str]:
        path = backstage.studies.path(log)
        if path is None:
            raise HTTPException(404, "There is no study.")
        return path, text_of(path)

    @app.get("/api/library")
    async def listing() -> list[ShownModel]:
        if not library:
            told = await made(workers.live(model_work.make_library))
            library[:] = [ShownModel(**each) for each in told]
        return library

    @app.post("/api/models/{log}")
    async def model(log: LogName, asked: ModelRequest) -> ModelAnswer:
        edits = [KeyEdit(tuple(each.path), each.value) for each in asked.edits]
        work = (model_work.make_model, *study_of(log), edits, asked.model)
        told, refusal, _ = await workers.live(*work)
        return ModelAnswer(model=told, error=refusal)

    @app.post("/api/models/{log}/use")
    async def use(log: LogName, asked: ModelUse) -> UseEdits:
        work = (model_work.make_use, *study_of(log), asked.model_dump())
        told, refusal, _ = await workers.live(*work)
        return UseEdits(error=refusal) if refusal else UseEdits(**told)

    @app.post("/api/models/{log}/own")
    async def own(log: LogName, asked: OwnModel) -> OwnModelAnswer:
        study_of(log)
        judged: OwnModelAnswer = await made(workers.live(model_work.judge_own, asked.text))
        if judged.model is None or not asked.keep:
            return judged
        # Named by its content: another text is another key of the study, and undo works.
        digest = hashlib.sha256(asked.text.encode()).hexdigest()[:8]
        name = f"{log}-{_plain(asked.name)}-{digest}.toml"
        folder = own_folder(backstage.workspace.folder, MODELS)
        write_atomically(folder / name, asked.text)
        return judged.model_copy(update={"template": f"../{MODELS}/{name}"})

    @app.get("/api/models/{log}/own/{name}")
    async def own_text(log: LogName, name: str) -> OwnModel:
        study_of(log)
        path = own_folder(backstage.workspace.folder, MODELS) / f"{log}-{_plain(name)}.toml"
        if not path.is_file():
            raise HTTPException(404, "There is no such model file.")
        return OwnModel(name=_plain(name), text=text_of(path))


def _plain(name: str) -> str:
    """A name of letters, digits and hyphens: no other folder can be reached by it."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60] or "model"
