"""What the page and the server tell each other of models with equations."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from flightid.app.schemas import Edit, Message, Question, Reply


class ShownEquation(Message):
    """Two sides in the grammar of model files; a transfer function carries its delay, s."""

    left: str
    right: str
    delay: str = ""


class ShownParameter(Message):
    """A parameter under the study's overrides; `start` is what the model's own file says."""

    name: str
    value: float | None
    start: float | None
    unit: str
    low: float | None
    high: float | None
    free: bool
    tie: str | None
    note: str
    changed: bool = False


class ShownModel(Message):
    """A model with equations: what it says of itself."""

    key: str
    title: str
    kind: Literal["transfer", "state-space"]
    axes: list[str]
    inputs: dict[str, str]
    outputs: dict[str, str]
    equations: list[ShownEquation]
    definitions: list[ShownEquation]
    measured: list[ShownEquation]
    notes: list[str]
    parameters: list[ShownParameter]
    source: str
    note: str


class ModelRequest(Message):
    """A model of a study as it would be with these edits."""

    model: str
    edits: list[Edit] = Field(default_factory=list, max_length=32)


class ModelUse(Message):
    """A library model or file to put into model `place` of a study; behind the last: beside."""

    place: int = Field(ge=0, le=1000)
    template: str = Field(min_length=1, max_length=300)
    axis: str | None = None
    columns: dict[str, str] = Field(default_factory=dict, max_length=64)


class UseEdits(Message):
    """The keys of a study that put a model into it."""

    edits: list[Edit] = Field(default_factory=list)
    name: str = ""
    error: str = ""


class ModelAnswer(Message):
    """A model of a study, or why there is none; both empty where it has no equations."""

    model: ShownModel | None = None
    error: str = ""


class OwnModel(Message):
    """A model file as it is written in the editor; kept where a study shall name it."""

    name: str = Field(min_length=1, max_length=60)
    text: str = Field(max_length=200_000)
    keep: bool = False


class OwnModelAnswer(Message):
    """What a model file says, or why it is none, with the line where that stands."""

    model: ShownModel | None = None
    error: str = ""
    line: int | None = None
    template: str = ""


class PredictedCurve(Message):
    """One output on one record: extremes by column of what was measured and predicted."""

    record: str
    output: str
    unit: str
    time_s: list[float]
    measured: list[float]
    predicted: list[float]
    theil: float
    rms_error: float


class PredictedResponse(Message):
    """One response of the model at the frequencies of the measured one."""

    output: str
    input: str
    unit: str
    omega_rad_s: list[float]
    gain: list[float]
    phase_rad: list[float]
    measured_gain: list[float]
    measured_phase_rad: list[float]
    coherence: list[float]


class ModelPrediction(Message):
    """Measured against predicted with the values of sliders."""

    curves: list[PredictedCurve]
    responses: list[PredictedResponse]
    refusal: str = ""


class PredictionQuestion(Question):
    """A prediction with values of some parameters."""

    kind: Literal["prediction"] = "prediction"
    model: str
    values: dict[str, float] = Field(default_factory=dict, max_length=200)


class PredictionAnswer(Reply):
    """Its answer; `processor_s` is what the worker took for it."""

    prediction: ModelPrediction | None = None
    processor_s: float = 0.0
