"""The noun: an autotune and what its own flight says of its gains."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.control.margins.margins import Margins
from flightid.conventions import Light
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.inspection.verdict_lines import verdict_lines
from flightid.result import Result
from flightid.review.autotune.run import AutotuneRun
from flightid.review.autotune.second_opinion import SecondOpinion
from flightid.review.tables import cell
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import interval_words, showing, shown

MOTION = 2.0 * np.pi


@dataclass(frozen=True, eq=False, repr=False)
class AutotuneReview(Result, schema="flightid.autotune_review/1"):
    """What an autotune did, and a second opinion on its gains.

    Attributes
    ----------
    name, firmware : str
        File name, firmware as logged.
    run : AutotuneRun
        Tests, gains, how it ended.
    before : mapping of str to mapping of str to float
        Gains before, by axis and name.
    opinions : tuple of SecondOpinion
        A model of each axis from the autotune's own excitation, and margins.
    findings : tuple of Finding

    Example
    -------
    >>> fid.review_autotune("autotune.bin").opinions[0].tuned         # doctest: +SKIP
    Margins(p / tau_phi: phase 51 (47 to 55) deg, gain 11 (10 to 12) dB)
    """

    name: str
    firmware: str
    run: AutotuneRun
    before: Mapping[str, Mapping[str, float]]
    opinions: tuple[SecondOpinion, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> Light:
        """Worst light of all findings."""
        return worst(self.findings)

    def step_table(self) -> Table:
        """Tests of ArduPilot in order."""
        columns = (
            Column("axis"),
            Column("step"),
            Column("tests"),
            Column("target", "deg/s or deg", 3),
            Column("last reached", digits=3),
            Column("last bounced to", digits=3),
        )
        rows = tuple(
            (s.axis, s.step, s.tests, s.target, s.reached, s.bounced) for s in self.run.steps
        )
        return Table("What autotune did", columns, rows)

    def gain_table(self) -> Table:
        """Gains before and after."""
        columns = (
            Column("axis"),
            Column("parameter"),
            Column("before", digits=4),
            Column("autotune", digits=4),
            Column("ratio", digits=3),
        )
        rows: list[tuple[Cell, ...]] = []
        for axis, gains in self.run.gains.items():
            for name, new in gains.items():
                old = self.before.get(axis, {}).get(name)
                rows.append((axis, name, old, new, new / old if old else None))
        return Table("Gains", columns, tuple(rows))

    def margin_table(self, *, level: float | None = None) -> Table:
        """Margins of the rate loops with both sets of gains, by the model of the flight.

        Parameters
        ----------
        level : float, optional
            Of the intervals; default: that of the page, else 0.95.
        """
        level = shown(level)
        columns = (
            Column("axis"),
            Column("gains"),
            Column("crossover", "Hz"),
            Column("phase margin", "deg"),
            Column("gain margin", "dB"),
            Column("sensitivity peak"),
        )
        rows: list[tuple[Cell, ...]] = []
        with showing(level):
            for opinion in self.opinions:
                for word, found in (("before", opinion.flown), ("autotune", opinion.tuned)):
                    if found is not None:
                        rows.append((opinion.axis, word, *_margin_cells(found)))
        told = any("(" in str(each) for row in rows for each in row[2:])
        notes = (
            *[
                f"In brackets: {interval_words(level)} intervals, from the covariance of the model "
                "that was fitted to autotune's own excitation."
            ][: int(told)],
            "Rate loops alone, with the autopilot's filters.",
            *dict.fromkeys(filter(None, (opinion.doubt for opinion in self.opinions))),
        )
        return Table("Second opinion: margins", columns, tuple(rows), notes)

    def summary(self) -> Table:
        """Margins; gains where no model was to be had."""
        margins = self.margin_table()
        return margins if margins.rows else self.gain_table()

    def tables(self) -> tuple[Table, ...]:
        """All tables that have rows."""
        made = (self.step_table(), self.gain_table(), self.margin_table())
        return tuple(table.without_empty_columns() for table in made if table.rows)

    def to_text(self) -> str:
        """Tables, then the verdicts, the worst last."""
        return "\n\n".join(
            [*(table.to_text() for table in self.tables()), verdict_lines(self.findings)]
        )

    def _tables(self) -> tuple[Table, ...]:
        return self.tables()

    def _computed(self) -> dict[str, object]:
        return {"verdict": self.verdict}

    def __repr__(self) -> str:
        """Log, axes, end and verdict on one line."""
        told = ", ".join(o.axis for o in self.opinions if o.tuned is not None) or "none"
        end = "finished" if self.run.finished else "not finished"
        return f"AutotuneReview({self.name!r}, {end}, margins of {told}, {self.verdict})"


def _margin_cells(found: Margins) -> tuple[Cell, ...]:
    if not found.is_stable:
        return ("unstable", None, None, None)
    return (
        cell(found.crossover, 1.0 / MOTION),
        cell(found.phase_margin),
        cell(found.gain_margin),
        cell(found.sensitivity_peak),
    )
