"""An autotune as a log holds it: tests, gains that it found, how it ended."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.inspection.signals import Span


@dataclass(frozen=True)
class TuneStep:
    """Tests of one kind on one axis.

    Attributes
    ----------
    axis, step : str
        What was tuned: ``"rate D up"``, …
    tests : int
    target, reached, bounced : float
        Of the last test: what was asked, the most and the least that was measured, deg/s or deg.
    """

    axis: str
    step: str
    tests: int
    target: float
    reached: float
    bounced: float


@dataclass(frozen=True)
class AutotuneRun:
    """What an autopilot's autotune did.

    Attributes
    ----------
    autopilot : str
    steps : tuple of TuneStep
        ArduPilot's tests in order; PX4 has none.
    spans : mapping of str to tuple of tuple of float
        When each axis was excited, s on the autopilot's clock.
    gains : mapping of str to mapping of str to float
        What it found, by axis and the autopilot's names.
    finished : bool
        Whether the autopilot called it a success.
    findings : tuple of Finding
        Why it failed, or what is odd.
    """

    autopilot: str
    steps: tuple[TuneStep, ...]
    spans: Mapping[str, tuple[Span, ...]]
    gains: Mapping[str, Mapping[str, float]]
    finished: bool
    findings: tuple[Finding, ...] = ()
