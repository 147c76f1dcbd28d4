"""What the page and the server tell each other of comparisons and plans."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from flightid.app.gain_schemas import GainFile
from flightid.app.schemas import Light, Message, ShownFinding, StepCurve


class ComparedSide(Message):
    """A flight, or a part of it; as the first side also the promise of its study."""

    log: str
    span_s: tuple[float, float] | None = None
    promised: bool = False


class CompareRequest(Message):
    """Both sides."""

    before: ComparedSide
    after: ComparedSide


class ChangeRow(Message):
    """A number of a loop on both sides, and their difference, in words with interval and unit."""

    loop: str
    name: str
    before: str
    after: str
    difference: str
    significant: bool
    alone: bool
    """Beyond its own 95 % interval, but not beyond chance among all rows."""


class LoopSteps(Message):
    """Steps of one loop on both sides."""

    loop: str
    before: StepCurve
    after: StepCurve


class ComparisonPart(Message):
    """A comparison."""

    names: tuple[str, str]
    promised: bool
    light: Light
    rows: list[ChangeRow]
    settings: list[tuple[str, str, str]]
    steps: list[LoopSteps]
    findings: list[ShownFinding]
    notes: list[str]
    """On loops that one side alone tells, and why."""
    following: GainFile | None
    back: GainFile | None


class StudyPairRequest(Message):
    """Two logs, or records, whose studies were run."""

    before: str
    after: str


class StudyComparison(Message):
    """What two studies found, each pair of models a section of the report's tree."""

    names: tuple[str, str]
    changed: list[str]
    """Those whose models have changed since the run that is compared."""
    light: Light
    sections: list[dict[str, Any]]


class PlanWishes(Message):
    """Options of ``flightid plan``; those that are None are as usual."""

    axes: list[str] | None = Field(None, max_length=8)
    band_rad_s: tuple[float, float] | None = None
    amplitude: float | None = None
    duration_s: float | None = None
    n_records: int | None = None
    control: float | None = None
    rate_rad_s: float | None = None
    attitude_rad: float | None = None
    loop_rate_hz: float | None = None

    def given(self) -> dict[str, Any]:
        """What was asked for."""
        asked = self.model_dump(exclude_none=True)
        return asked | ({"axes": tuple(self.axes)} if self.axes else {})


class PlanRequest(Message):
    """A plan of the next flight of the vehicle of a log."""

    log: str
    wishes: PlanWishes


class PlanRow(Message):
    """The sweep of an axis, and what the log will show of it."""

    axis: str
    amplitude: float | None
    size: str
    unit: str
    low_hz: float | None
    high_hz: float | None
    duration_s: float | None
    runs: int
    command_percent: float | None
    rate_deg_s: float | None
    attitude_deg: float | None
    coherence: float | None
    rests_on: str
    untold: str
    """Why nothing is expected of it; empty where something is."""
    settings: dict[str, float]


class PlanPart(Message):
    """A plan of the next flight."""

    title: str
    verdict: str
    light: Light
    axes: list[str]
    """All that the autopilot sweeps."""
    carried: list[str]
    """Those of which the log can carry a model already."""
    rows: list[PlanRow]
    battery: str
    logging: str
    findings: list[ShownFinding]
    why: str
    """What makes the light what it is; empty where it is green."""
    files: list[GainFile]
    refusal: str
