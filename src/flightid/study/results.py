"""What the stages of a study made, before anything is said of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path

from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.control.tuning.result import Tuning
from flightid.dynamics.handling_qualities.handling_qualities import HandlingQualities
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.inspection import Inspection
from flightid.logs.field_plot import FieldPlot
from flightid.planning import SweepPlan
from flightid.record import Record
from flightid.result import Result
from flightid.review import FlightReview
from flightid.review.tried_filters import TriedFilters
from flightid.study.identified import ModelResults
from flightid.study.output import SCHEMA
from flightid.study.settings import Settings
from flightid.study.truth import Truth
from flightid.study.uses import Uses
from flightid.vehicles import GainFlight


@dataclass(frozen=True, eq=False)
class StudyResults(
    Result,
    schema=SCHEMA,
    untold={
        "settings": "what was asked",
        "records": "time histories",
        "output": "a folder",
        "identified": "told as models",
        "qualities": "told as handling_qualities",
        "carried_out": "of this run",
        "from_cache": "of this run",
        "source": "of this run",
        "gains_file": "of this run",
    },
):
    """Results of every stage of a study.

    Attributes
    ----------
    settings : Settings
        The study file, checked.
    output : Path
        Folder with ``report.html``, ``report.txt`` and ``results.json``.
    inspection : Inspection or None
        What the log can support; None where records come from files.
    records : mapping of str to Record
        By segment.
    identified : tuple of ModelResults
        Every stage of each model.
    truth : Truth or None
        What should have been found, where the flight was simulated.
    files : mapping of str to str
        SHA-256 of what was read, by file name.
    tuning : Tuning or None
        Gains, where the study asks for them.
    gain_flight : GainFlight or None
        These gains flown again in the simulated vehicle.
    qualities : mapping of str to HandlingQualities
        By model, where the study asks for them.
    uses : Uses
        Model files, and what else was made with the models.
    faults : tuple of Finding
        What was asked for after the fits and could not be made.
    consistency : mapping of str to KinematicConsistency
        Data compatibility of records, where the conditioning asks for it.
    carried_out, from_cache : tuple of str
        Stages that this run carried out, and those whose results the cache held.
    source : Path or None
        Study file as this run was given it.
    review : FlightReview or None
        What the log's flight tells besides; None where records come from files.
    tried : TriedFilters or None
        Filters that the study tries on the noise of the flight.
    plots : tuple of FieldPlot
        Fields of the log that the study shows.
    plan : SweepPlan or None
        Of the next flight, where the study asks for one.
    gains_file : str
        File of gains that this run was asked for, as the reader wrote it; empty: the usual name.
    """

    settings: Settings
    output: Path
    inspection: Inspection | None
    records: Mapping[str, Record]
    identified: tuple[ModelResults, ...]
    truth: Truth | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    tuning: Tuning | None = None
    gain_flight: GainFlight | None = None
    qualities: Mapping[str, HandlingQualities] = field(default_factory=dict)
    uses: Uses = field(default_factory=Uses)
    faults: tuple[Finding, ...] = ()
    consistency: Mapping[str, KinematicConsistency] = field(default_factory=dict)
    carried_out: tuple[str, ...] = ()
    from_cache: tuple[str, ...] = ()
    source: Path | None = None
    review: FlightReview | None = None
    tried: TriedFilters | None = None
    plots: tuple[FieldPlot, ...] = ()
    plan: SweepPlan | None = None
    gains_file: str = ""

    @property
    def has_equations(self) -> bool:
        """Whether any model has equations, and so parameters with a meaning."""
        return any(item.settings.structure is None for item in self.identified)
