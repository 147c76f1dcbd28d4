"""What the page and the server tell each other of gains."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from flightid.app.schemas import Job, Light, Message, Question, Reply, ShownFinding


class GainSlider(Message):
    """A gain with its range; `found` is what the search took, where it searched."""

    name: str
    unit: str
    flown: float | None
    found: float | None
    value: float
    low: float
    high: float


class MarginRow(Message):
    """A number of a loop over all plants, beside that of the flown gains."""

    loop: str
    name: str
    unit: str
    required: str
    met: bool
    digits: int
    """How many its numbers are shown with: as many as tell them from what is required."""
    nominal: float | None
    low: float | None
    high: float | None
    worst: float | None
    flown: float | None
    flown_worst: float | None
    untold: str
    """Why nothing is promised of it; empty where something is."""
    missed: float | None
    """Of the plant that is furthest from what is required, where one misses it."""
    n_missed: int
    n_plants: int


class TimeCurve(Message):
    """A time response of the estimate, with the extremes of some plants."""

    name: str
    unit: str
    time_s: list[float]
    estimate: list[float]
    low: list[float]
    high: list[float]
    flown: list[float] | None


class NicholsCurve(Message):
    """A loop broken at the output, for the chart of Nichols."""

    name: str
    phase_deg: list[float]
    gain_db: list[float]


class GainStep(Message):
    """A step on the way to the new gains."""

    gains: dict[str, float]
    stable: bool
    phase_margin_deg: float | None
    gain_margin_db: float | None


class ControllerForm(Message):
    """A way to write a PID of its own, with its gains."""

    name: str
    law: str
    gains: str


class RigController(Message):
    """A controller around a loop of a rig."""

    forms: list[ControllerForm]
    remarks: list[str]
    sampled: bool
    """Whether it has a rate, so that there is code of it."""
    measured: str
    """Unit of set-point and measurement, and of the output; empty where nobody knows it."""
    moved: str


class AxisGains(Message):
    """Gains of an axis and what they promise."""

    axis: str
    by_hand: bool
    light: Light
    sentence: str
    is_stable: bool = True
    """Whether the estimate is: an unstable loop has no margins."""
    sliders: list[GainSlider]
    margins: list[MarginRow]
    curves: list[TimeCurve]
    loops: list[NicholsCurve]
    steps: list[GainStep]
    filters: list[str]
    findings: list[ShownFinding]
    controller: RigController | None = None
    """Of a rig: what stands in place of an autopilot's own loops."""


class RefusedGains(Message):
    """An axis that its data do not allow."""

    axis: str
    finding: ShownFinding


class GainFile(Message):
    """A parameter file."""

    name: str
    text: str


class GainsPart(Message):
    """Gains of a study."""

    axes: list[AxisGains]
    refused: list[RefusedGains]
    findings: list[ShownFinding]
    n_steps: int
    left_out: dict[str, str]
    refusal: str
    files: list[GainFile]
    """Of ``flightid tune --write``: steps with their ways back; of a rig numbers and code."""
    loops: list[str]
    """Of a rig: every loop that its models have, as output/input."""
    ranges: dict[str, tuple[float, float]]
    """Of a rig: what each input went through in the records that were fitted."""
    preset: str
    """Of the study that these gains are of, as is the form of a rig's controller."""
    form: str


class GainsScreen(Message):
    """Gains of a study as it stands, where they are known, and the work on them."""

    etag: str
    gains: GainsPart | None
    jobs: list[Job]


class GainsQuestion(Question):
    """One axis with other gains, judged at once as a slider moves."""

    kind: Literal["gains"] = "gains"
    axis: str
    values: dict[str, float] = Field(max_length=16)
    responses: bool = True
    """Also time responses, which a hand that moves a slider does not wait for."""


class GainsAnswer(Reply):
    """Its answer: the axis that moved."""

    moved: AxisGains | None = None
