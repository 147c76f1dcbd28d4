"""The noun of the stage: what a log holds and whether it can support identification."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from flightid.conventions import Light
from flightid.findings import Finding, worst, worst_last
from flightid.frozen import dataclass
from flightid.inspection.axes import axes_of
from flightid.inspection.carried import carried_axes, carried_sentence
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.log_clock import logged_words
from flightid.inspection.log_end import is_aside
from flightid.inspection.rates import StreamRate
from flightid.inspection.saturation import Saturation
from flightid.inspection.skew import StreamSkew
from flightid.inspection.usable_band import NARROW, AxisBand
from flightid.inspection.verdict_lines import WIDTH, verdict_lines
from flightid.result import Result
from flightid.table import Column, Table
from flightid.wrapping import wrapped

WORDS = {
    Light.GREEN: "can support identification",
    Light.AMBER: "can support identification with reservations",
    Light.RED: "cannot support identification",
    Light.UNKNOWN: "could not be judged",
}


@dataclass(frozen=True)
class Inspection(Result, schema="flightid.inspection/1"):
    """What a log holds, and whether it can support identification.

    Attributes
    ----------
    name, kind, firmware : str
        File name, who wrote it (as `Log.kind`), firmware as logged.
    vehicle : str or None
        Kind of vehicle.
    duration_s : float
        First to last stamp, s.
    rates : tuple of StreamRate
        Rate, jitter and gaps of every message, fastest first.
    phases : FlightPhases
        Airborne spans.
    excitations : tuple of FoundExcitation
        What excited the vehicle.
    saturations : tuple of Saturation
        What was at a limit in the air, most first.
    skews : tuple of StreamSkew
        Streams that show the same motion at different times.
    bands : tuple of AxisBand
        What each axis supports.
    findings : tuple of Finding
        Verdicts with what to do.
    start_s : float
        First stamp on the autopilot's clock, of which all times here are, s.

    Example
    -------
    >>> import flightid as fid
    >>> inspection = fid.inspect_log("flight.bin")                   # doctest: +SKIP
    >>> inspection.usable_band_rad_s["roll"]                         # doctest: +SKIP
    (3.1, 62.8)
    """

    name: str
    kind: str
    firmware: str
    vehicle: str | None
    duration_s: float
    rates: tuple[StreamRate, ...]
    phases: FlightPhases
    excitations: tuple[FoundExcitation, ...]
    saturations: tuple[Saturation, ...]
    skews: tuple[StreamSkew, ...]
    bands: tuple[AxisBand, ...]
    findings: tuple[Finding, ...] = ()
    start_s: float = 0.0

    @property
    def logged_words(self) -> str:
        """How long the log is, and where it begins on the autopilot's clock."""
        return logged_words(self.start_s, self.duration_s)

    @property
    def verdict(self) -> Light:
        """Worst light of all findings but those that leave the rest of the log as it is."""
        return worst([f for f in self.findings if not is_aside(f)])

    @property
    def usable_band_rad_s(self) -> dict[str, tuple[float, float] | None]:
        """Usable band by axis, rad/s; None where there is none."""
        return {band.axis: band.band_rad_s for band in self.bands}

    @property
    def messages_used(self) -> tuple[str, ...]:
        """Messages from which commands and rates would be taken."""
        labels = [label for band in self.bands for label in (band.input, band.output) if label]
        return tuple(dict.fromkeys(label.split(".")[0] for label in labels))

    def findings_on(self, channels: Iterable[str]) -> tuple[Finding, ...]:
        """Findings on the whole log and on the axes that hold any of some channels.

        Parameters
        ----------
        channels : iterable of str
            Canonical names, for example ``"q"``; none of any axis: all findings count.
        """
        # Who fits a model all the same is judged by its evidence, not by what `run` would try.
        kept = tuple(f for f in self.findings if f.code != "no-model" and not is_aside(f))
        wanted = set(channels)
        names = axes_of(self.vehicle)
        others = {axis for axis, own in names.items() if not wanted & set(own)}
        if len(others) == len(names):
            return kept
        return tuple(f for f in kept if f.code.rsplit("-", 1)[-1] not in others)

    def with_findings(self, findings: tuple[Finding, ...]) -> Inspection:
        """Copy with other findings."""
        return replace(self, findings=findings)

    def tables(self) -> tuple[Table, ...]:
        """Verdicts, axes, rates, excitation, saturation and skew, those that have rows."""
        made = (
            self.summary(),
            self._axes(),
            self._excitations(),
            self._saturations(),
            self._skews(),
            self._rates(),
        )
        return tuple(table for table in made if table.rows)

    def summary(self) -> Table:
        """Table of the verdicts, the worst first."""
        rows = tuple(
            (str(finding.light), finding.code, finding.message, action or None)
            for finding, action in self._advised()
        )
        columns = (Column("light"), Column("code"), Column("found"), Column("do"))
        return Table(f"{self.name}: {self._words()}", columns, rows)

    def to_text(self) -> str:
        """All tables for a terminal, verdicts last, the worst of them and the answer at the end."""
        return self._ended_by_verdict(self.tables()[1:])

    def on_screen(self) -> str:
        """The same with the rates of what a model would be made of alone, and no clock skews."""
        tables = (self._excitations(), self._saturations(), self._used_rates(), self._axes())
        return self._ended_by_verdict(t for t in tables if t.rows)

    def _ended_by_verdict(self, tables: Iterable[Table]) -> str:
        """What the log is, tables, verdicts, and what it can carry where eyes are."""
        head = wrapped(f"{self.name}: {self.firmware or self.kind}, {self.logged_words}", WIDTH)
        answer = (*wrapped(carried_sentence(self), WIDTH), *self._next())
        judged = verdict_lines(worst_last(self.findings))
        parts = ("\n".join(head), *(t.to_text() for t in tables), judged, "\n".join(answer))
        return "\n\n".join(part for part in parts if part)

    def _next(self) -> Iterator[str]:
        """The command that goes on from a log that carries a model."""
        if self.verdict in (Light.GREEN, Light.AMBER) and carried_axes(self):
            yield f"Next: flightid tune {self.name} (models, then gains), or run (models alone)."

    def _used_rates(self) -> Table:
        """Rates of what a model would be made of; the others are counted."""
        used = tuple(r for r in self.rates if r.label in self.messages_used)
        rest = len(self.rates) - len(used)
        made = replace(self, rates=used)._rates()
        more = f"{rest} more messages: --all" if rest else ""
        return replace(made, notes=(*made.notes, more)) if more else made

    def _words(self) -> str:
        """What the light means, where an axis carries a model at all."""
        able = self.verdict in (Light.RED, Light.UNKNOWN) or carried_axes(self)
        return WORDS[self.verdict] if able else WORDS[Light.RED]

    def in_short(self) -> str:
        """The flight in a line, what each axis supports, what moved it, what was at a limit."""
        head = (
            f"{self.name}: {self.firmware or self.kind}, {self.logged_words}, "
            f"airborne {self.phases.airborne_words}"
        )
        tables = (self._axes(), self._excitations(), self._saturations())
        said = "\n".join(wrapped(head, WIDTH))
        return "\n\n".join([said, *(each.to_text() for each in tables if each.rows)])

    def _advised(self) -> Iterator[tuple[Finding, str]]:
        """Findings with what to do; an advice that several share is given once."""
        given: set[str] = set()
        for finding in self.findings:
            yield finding, "" if finding.action in given else finding.action
            given.add(finding.action)

    def _axes(self) -> Table:
        columns = (
            Column("axis"),
            Column("command"),
            Column("body rate"),
            Column("logged", "Hz"),
            Column("lowest", "rad/s"),
            Column("highest", "rad/s"),
            Column("coherence"),
            Column("reason"),
        )
        rows = tuple(
            (
                band.axis,
                band.input or None,
                band.output or None,
                band.rate_hz or None,
                *(band.told_rad_s or (None, None)),
                band.coherence,
                band.reason or (None if band.is_usable or not band.told_rad_s else NARROW),
            )
            for band in self.bands
        )
        return Table("Usable band by axis", columns, rows)

    def _excitations(self) -> Table:
        columns = (
            Column("kind"),
            Column("axis"),
            Column("start", "s"),
            Column("stop", "s"),
            Column("detail"),
        )
        rows = tuple((e.words, e.axis, e.start_s, e.stop_s, e.detail) for e in self.excitations)
        return Table("Excitation found", columns, rows)

    def _saturations(self) -> Table:
        columns = (Column("what"), Column("limit"), Column("share", "%", 3))
        rows = tuple((s.what, s.limit, 100.0 * s.share) for s in self.saturations)
        return Table("At a limit in the air", columns, rows)

    def _skews(self) -> Table:
        columns = (
            Column("motion"),
            Column("first"),
            Column("second"),
            Column("second is later by", "ms", 3),
            Column("±", "ms", 2),
            Column("resolution", "ms", 2),
            Column("correlation", "", 3),
        )
        rows = tuple(
            (
                s.quantity,
                s.first,
                s.second,
                1e3 * s.lag_s if s.is_told else None,
                1e3 * s.half_width_s,
                1e3 * s.resolution_s,
                s.correlation,
            )
            for s in self.skews
        )
        untold = any(not s.is_told for s in self.skews)
        note = "–: none can be told, it is below the resolution or its 95 % interval (±) holds zero"
        return Table("Clock skew between streams", columns, rows, (note,) if untold else ())

    def _rates(self) -> Table:
        columns = (
            Column("message"),
            Column("rows"),
            Column("rate", "Hz"),
            Column("mean rate", "Hz"),
            Column("jitter", "%", 2),
            Column("gaps"),
            Column("longest gap", "s", 3),
            Column("stamps out of order"),
        )
        rows = tuple(
            (
                r.label,
                r.rows,
                *(
                    (None, None, None, None, None)
                    if r.is_burst
                    else (r.rate_hz, r.mean_hz, 100 * r.jitter, r.n_gaps, r.longest_gap_s or None)
                ),
                r.n_disordered,
            )
            for r in sorted(self.rates, key=lambda rate: rate.is_burst)
        )
        burst = any(r.is_burst for r in self.rates)
        note = "no rate: rows come in bursts, whose spacing is that of the writing"
        return Table("Rates", columns, rows, (note,) if burst else ())

    def _tables(self) -> tuple[Table, ...]:
        return self.tables()

    def _computed(self) -> dict[str, object]:
        return {
            "verdict": self.verdict,
            "usable_band_rad_s": self.usable_band_rad_s,
            "airborne_s": self.phases.airborne_s,
        }

    def __repr__(self) -> str:
        """Log, duration, time in the air and verdict on one line."""
        return (
            f"Inspection({self.name!r}, {self.duration_s:.4g} s, "
            f"{self.phases.airborne_words} airborne, {self.verdict})"
        )
