"""The noun of the room: what one flight tells of its vehicle, whatever was flown."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.errors import UnknownNameError
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.log_clock import logged_words
from flightid.inspection.signals import Signal
from flightid.inspection.verdict_lines import WIDTH, verdict_lines
from flightid.result import Result
from flightid.review import tables
from flightid.review.closing import closing_lines
from flightid.review.filters import FilterReview
from flightid.review.flown_range import FlownRange, range_table
from flightid.review.gyro_noise import GyroNoise
from flightid.review.identity import FlightIdentity
from flightid.review.loop_response import LoopResponse
from flightid.review.motors import MotorUse
from flightid.review.vibration import Vibration
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.wrapping import wrapped

KINDS = {"mavlink": "telemetry of a"}
"""What a reader calls a kind of log."""


@dataclass(frozen=True, repr=False)
class FlightReview(
    Result, schema="flightid.flight_review/1", untold={"throttle": "a time history"}
):
    """What one flight tells of its vehicle: loops, motors, vibration, who flew.

    Attributes
    ----------
    name, kind, firmware : str
        File name, who wrote it (as `Log.kind`), firmware as logged.
    vehicle : str or None
        Kind of vehicle.
    start_s, duration_s : float
        First stamp on the autopilot's clock, of which all times here are; from it to the last.
    phases : FlightPhases
        Airborne spans.
    identity : FlightIdentity
        Frame, modes, battery, gains.
    loops : tuple of LoopResponse
        Rate and attitude loops of each axis.
    motors : tuple of MotorUse
        Time at limits and balance.
    yaw_trim : Estimate or None
        How much harder motors work that turn one way than those that turn the other.
    vibrations : tuple of Vibration
        Levels against published limits.
    noise : GyroNoise
        Spectrum of the gyroscope, its peaks by name.
    filters : FilterReview
        Filters with the phase that they cost, the noise in the outputs, and better ones.
    findings : tuple of Finding
        Verdicts with what to do.
    throttle : Signal or None
        Thrust that was asked for, share of the most; None where it is not logged.
    swept : bool
        Whether the autopilot flew sweeps.
    carried : tuple of str
        Axes whose sweeps carry a model, which weighs gains as no step does.
    ranges : tuple of FlownRange
        What the flown gains promise over all typical vehicles that would fly so.

    Example
    -------
    >>> import flightid as fid
    >>> review = fid.review_flight("flight.bin")                     # doctest: +SKIP
    >>> review["roll rate"]["rise time"]                             # doctest: +SKIP
    Estimate(rise time = 0.084 (0.071 to 0.098) s)
    """

    name: str
    kind: str
    firmware: str
    vehicle: str | None
    start_s: float
    duration_s: float
    phases: FlightPhases
    identity: FlightIdentity
    loops: tuple[LoopResponse, ...]
    motors: tuple[MotorUse, ...]
    yaw_trim: Estimate | None
    vibrations: tuple[Vibration, ...]
    noise: GyroNoise
    filters: FilterReview
    findings: tuple[Finding, ...] = ()
    throttle: Signal | None = None
    swept: bool = False
    carried: tuple[str, ...] = ()
    ranges: tuple[FlownRange, ...] = ()

    @property
    def verdict(self) -> Light:
        """Worst light of all findings."""
        return worst(self.findings)

    def __getitem__(self, name: str) -> LoopResponse:
        """A loop by axis and kind, for example ``"roll rate"``.

        Raises
        ------
        UnknownNameError
            The log holds no such loop.
        """
        for loop in self.loops:
            if loop.name == name:
                return loop
        raise UnknownNameError(
            "the log holds no such loop",
            found=name,
            needed="one of " + ", ".join(loop.name for loop in self.loops),
        )

    def summary(self) -> Table:
        """Steps of the loops that the flight tells; what it is, where it tells none."""
        steps = tables.steps(self.loops)
        return steps if steps.rows else self.flight()

    def flight(self) -> Table:
        """Vehicle, firmware, frame, time in the air, battery."""
        flown = self.phases.is_known and bool(self.phases.airborne)
        rows: list[tuple[Cell, ...]] = [
            ("vehicle", " ".join(filter(None, (KINDS.get(self.kind, self.kind), self.vehicle)))),
            ("firmware", self.firmware or None),
            ("frame", self.identity.frame or None),
            ("logged", logged_words(self.start_s, self.duration_s)),
            ("in the air", self.phases.airborne_words),
            *tables.battery(self.identity.battery, flown=flown),
        ]
        told = tuple(row for row in rows if row[1] is not None)
        return Table(f"Flight {self.name}", (Column("what"), Column("value")), told)

    def tables(self) -> tuple[Table, ...]:
        """All tables that have rows."""
        made = (
            self.flight(),
            tables.steps(self.loops),
            tables.frequencies(self.loops),
            range_table(self.ranges),
            tables.motors(self.motors),
            tables.vibrations(self.vibrations),
            self.noise.summary(),
            self.filters.table(),
            self.filters.noise_table(),
            *(() if self.phases.fall else (self.filters.choice_table(),)),
            tables.modes(self.identity.modes),
            tables.gains(self.identity),
        )
        return tuple(table.without_empty_columns() for table in made if table.rows)

    def to_text(self) -> str:
        """Tables, the verdicts, the worst last, and where eyes are what it comes to."""
        said = (table.to_text() for table in self.tables())
        end = (line for each in closing_lines(self) for line in wrapped(each, WIDTH))
        return "\n\n".join([*said, verdict_lines(self.findings), "\n".join(end)])

    def _tables(self) -> tuple[Table, ...]:
        return self.tables()

    def _computed(self) -> dict[str, object]:
        known = self.phases.is_known
        return {
            "verdict": self.verdict,
            "answer": self.answer,
            "airborne_s": self.phases.airborne_s if known else None,
        }

    @property
    def answer(self) -> str:
        """What the flight tells and what is next, in sentences."""
        return " ".join(closing_lines(self))

    @property
    def in_short(self) -> str:
        """Firmware, time in the air, and how many loops the flight tells, in words."""
        told = sum(loop.is_told for loop in self.loops)
        loops = f"steps of {told} of {len(self.loops)} loops" if self.loops else "no loops logged"
        return f"{self.firmware or self.kind}, in the air {self.phases.airborne_words}, {loops}"

    def __repr__(self) -> str:
        """Log, time in the air, loops told and verdict on one line."""
        told = sum(loop.is_told for loop in self.loops)
        return (
            f"FlightReview({self.name!r}, {self.phases.airborne_words} airborne, "
            f"{told} of {len(self.loops)} loops told, {self.verdict})"
        )
