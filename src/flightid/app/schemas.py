"""What the page and the server tell each other; the page's types are made from these.

A subject of its own goes into a file ``<subject>_schemas.py`` beside this one.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Light = Literal["green", "amber", "red", "unknown"]


class Message(BaseModel):
    """Base: unknown keys are an error, and numbers are finite."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class ShownFinding(Message):
    """A finding, with the spans of the flight that it speaks of."""

    code: str
    light: Light
    message: str
    action: str
    spans_s: list[tuple[float, float]]
    first: bool = False
    """Whether it comes before all other advice, whatever its light: a fall."""
    rank: int = 0
    """Of verdicts of a flight: the lower, the earlier, whoever tells them (`findings.urgency`)."""


class AxisCard(Message):
    """The best that a log gives of one axis."""

    axis: str
    kind: Literal["model", "step", "nothing"]
    light: Light
    headline: str
    detail: str
    action: str
    model: str | None = None
    band_rad_s: tuple[float, float] | None = None
    coherence: float | None = None
    first: bool = False
    """Whether its action comes before everything else that the card says: the vehicle fell."""


class StepCurve(Message):
    """The closed rate loop of an axis from ordinary flying."""

    axis: str
    loop: str
    time_s: list[float]
    step: list[float]
    low: list[float]
    high: list[float]
    readings: list[tuple[str, str]]


class StripLine(Message):
    """A channel over the whole flight: extremes by column, None where silent."""

    name: str
    label: str
    unit: str
    low: list[float | None]
    high: list[float | None]


class StripBlock(Message):
    """Something that lasted."""

    kind: str
    axis: str
    text: str
    start_s: float
    stop_s: float


class StripEvent(Message):
    """An instant with words."""

    time_s: float
    kind: str
    text: str


class Overview(Message):
    """What an inspection finds, laid out for the page."""

    name: str
    vehicle: str
    firmware: str
    flown: str
    """When the log began, by its own clock of satellites, UTC; empty where it has none."""
    duration_s: float
    airborne: str
    light: Light
    sentence: str
    verdicts: list[ShownFinding]
    cards: list[AxisCard]
    span_s: tuple[float, float]
    lines: list[StripLine]
    blocks: list[StripBlock]
    events: list[StripEvent]
    has_study: bool


class ReviewPart(Message):
    """What the review of the flight adds: steps of its loops, and its verdicts."""

    light: Light
    steps: list[StepCurve]
    verdicts: list[ShownFinding]
    untold: dict[str, tuple[str, str]]


class Job(Message):
    """Long work: its state, and where it can be asked for again."""

    id: str
    kind: Literal["overview", "review", "run", "fleet", "gains", "proposal"]
    log: str
    state: Literal["waiting", "done", "failed", "cancelled", "interrupted"]
    reason: str = ""
    of: str = ""
    """Version of what it works on, where a kind has a result for each."""
    begun_s: float = 0.0
    """When, s since 1970."""
    label: str = ""
    """What it does now."""
    share: float | None = None
    """How much of that is done; None where nobody knows."""


class LogItem(Message):
    """A log of the workspace; what an overview tells is there once it was made."""

    id: str
    name: str
    path: str
    size: int
    changed: str
    """When the file was changed last; empty where nobody knows that of one that was dropped."""
    flown: str | None = None
    vehicle: str | None = None
    firmware: str | None = None
    duration_s: float | None = None
    sweeps: int | None = None
    light: Light | None = None


class LeftOut(Message):
    """A file or folder of the workspace that is not listed, and why."""

    path: str
    reason: str


class Listing(Message):
    """The workspace."""

    folder: str
    version: str
    logs: list[LogItem]
    left_out: list[LeftOut] = []


class RemovedItem(Message):
    """A log or records that a hand has taken off the list; the files are where they were."""

    id: str
    kind: Literal["log", "records"]
    name: str
    path: str


class RemovalRequest(Message):
    """Take a log or records off the list, or put them back."""

    id: str = Field(max_length=16)
    removed: bool


class FlightScreen(Message):
    """Everything known of a log; parts that are being made are None."""

    id: str
    name: str
    path: str
    overview: Overview | None
    review: ReviewPart | None
    jobs: list[Job]


class FieldGroup(Message):
    """Fields of a message with their units."""

    message: str
    instances: list[int]
    rate_hz: float | None
    fields: dict[str, str]


class StudyParts(Message):
    """What parts of a study are known by: a change of one leaves what rests on others as it is."""

    models: str
    """All but the others, which no model rests on."""
    gains: str
    """``[tune]``."""
    views: str = ""
    """``[filters]`` and ``[[plot]]``; empty where there are none."""


class StudyText(Message):
    """A study file, its tag, and what the page reads off it."""

    text: str
    etag: str
    parts: StudyParts
    settings: dict[str, Any]
    python: str
    outside: list[str] = []
    """Files that it names outside the folder of the page, which opens none of them."""
    undoable: int = 0
    """How many versions can be gone back."""
    redoable: int = 0
    of_records: bool = False
    state: Literal["readable", "unreadable", "no text", "lost"] = "readable"
    """A study is read where `flightid run` would read it. Unreadable: `text` stands, and is none.
    No text: bytes stand that are none, and nothing may take their place. Lost: nothing stands, and
    `text` stood last. `etag` is the tag by which another text takes the place."""
    lack: str = ""
    """Why it is not readable; empty: it is."""


class StudyStep(Message):
    """To the version before, or to the next again."""

    back: bool


class Edit(Message):
    """One key and its value; None takes it out."""

    path: list[str | int] = Field(min_length=1, max_length=8)
    value: Any


class Edits(Message):
    """Edits that are made together."""

    edits: list[Edit] = Field(min_length=1, max_length=256)


class WholeText(Message):
    """A study file to put in place of another."""

    text: str


class TwoStudies(Message):
    """A study as it was begun from, as it was meant here, and as it stands in the file now."""

    base: str
    mine: str
    theirs: str
    edits: list[Edit] = Field(default=[], max_length=256)
    """Keys that were to change in `mine` besides."""


class MergeLine(Message):
    """A line of two versions: of both, of one of them, or a mark for equal lines left out."""

    side: Literal["same", "theirs", "mine", "gap"]
    text: str


class MergedStudy(Message):
    """Two versions of a study side by side, and both together where they allow it."""

    mine: str
    """With its edits made."""
    merged: str | None
    why: str
    """Why they cannot be taken together."""
    lines: list[MergeLine]


class ResponseCurve(Message):
    """One response of one estimator."""

    estimator: str
    output: str
    input: str
    unit: str
    omega_rad_s: list[float]
    gain: list[float]
    phase_rad: list[float]
    coherence: list[float]
    random_error: list[float]
    gain_low: list[float] | None = None
    gain_high: list[float] | None = None
    phase_low_rad: list[float] | None = None
    phase_high_rad: list[float] | None = None
    reason: str = ""


class ResponsePart(Message):
    """Responses of one model, as its study says."""

    model: str
    band_rad_s: tuple[float, float] | None
    minimum_coherence: float
    estimators: list[str]
    curves: list[ResponseCurve]
    around: list[ResponseCurve]
    findings: list[ShownFinding]


class Question(Message):
    """A request on the socket: what the page shows under edits that are not written yet."""

    request: int
    kind: str
    log: str
    edits: list[Edit] = Field(default_factory=list, max_length=32)


class Reply(Message):
    """The answer to a question of that number, or why there is none."""

    request: int
    error: str | None = None
    seconds: float = 0.0


class ResponseQuestion(Question):
    """Responses of a model."""

    kind: Literal["response"] = "response"
    model: str
    around: bool = False
    intervals: bool = False


class ResponseAnswer(Reply):
    """Its answer."""

    response: ResponsePart | None = None


class JobNews(Message):
    """A job has changed."""

    job: Job
