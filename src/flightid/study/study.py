"""The noun: what a study file made."""

from __future__ import annotations

from functools import cached_property

from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.report.content import Document
from flightid.report.json import to_dict
from flightid.study.answer import short_document
from flightid.study.document import parameter_table, study_document
from flightid.study.estimate_tables import model_table
from flightid.study.results import StudyResults
from flightid.table import Table
from flightid.uncertainty.quantiles import showing


@dataclass(frozen=True, eq=False, repr=False)
class Study(StudyResults):
    """What a study file made: the results of its stages, and the report on them.

    Example
    -------
    >>> import flightid as fid
    >>> fid.run_study("study.toml")                                  # doctest: +SKIP
    Study('Roll rate', 1 model, 3 green)
    """

    @cached_property
    def document(self) -> Document:
        """The report as a content tree."""
        with showing(self.settings.level):
            return study_document(self)

    @cached_property
    def short(self) -> Document:
        """One screen of it: a line a model, gains, and the answer last."""
        with showing(self.settings.level):
            return short_document(self, self.document)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Every verdict of the report."""
        return self.document.findings

    def summary(self) -> Table:
        """Table of all parameters with their intervals, or of models where none has equations."""
        with showing(self.settings.level):
            return parameter_table(self) if self.has_equations else model_table(self.identified)

    def _computed(self) -> dict[str, object]:
        return {
            "title": self.settings.title,
            "models": self.identified,
            "handling_qualities": self.qualities,
            "findings": self.findings,
            "report": to_dict(self.document),
        }

    def __repr__(self) -> str:
        """Title, number of models and verdicts on one line."""
        n = len(self.identified)
        return (
            f"Study({self.settings.title!r}, {n} model{'' if n == 1 else 's'}, "
            f"{self.document.tally})"
        )
