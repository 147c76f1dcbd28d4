"""The page of counts: what intervals of each condition held, from a file of kept flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.strangers.cases import families
from tests.strangers.counting import NOMINAL, Reading, Tally, Trial, Z

LEAST, MOST = 0.93, 0.97
"""Shares between which a 95 % interval is as good as it says."""
ENOUGH = (20, 500)
"""Flights of a condition that show a gross fault, and that show a share to a point."""
HEAD = ("condition", "flights", "intervals", "shown %", "held %", "± %", "green, amber, red %",
        "green and a miss %", "allowed %", "refused %")  # fmt: skip
INTRODUCTION = """# Coverage, counted

What became of 95 % intervals on flights of simulators that are not flightid's own (NumPy, SciPy,
JSBSim), condition by condition, all options at their defaults. This page is made, not written:

```
python -m tests.strangers --runs 3 20 500 --keep FILE
python -m tests.strangers --runs 0 --keep FILE --page docs/coverage.md
```

{counted}

- **held**: of the intervals that were shown, those that hold the truth. **±**: twice the standard
  error over flights, for intervals of one flight share its noise; none where none missed.
- **shown**: of the numbers that were asked for, those that got an interval. The others say why not;
  what they would have held is in no column. What holds and is seldom shown is not good.
- **green and a miss**: flights with a green light and an interval or more that miss; **allowed** is
  what chance makes of sound intervals: 1 - 0.95ᵏ of k of them, and {z} deviations over flights.
- **!** beside a share: outside {least:.0f} to {most:.0f} % by more than chance ({z} deviations, by
  flights or by intervals, the larger), or above what is allowed. Of {rows} sound conditions chance
  marks {expected:.1f}.
- Inputs that were told wrongly have bars of the word. There an interval counts, too, that holds the
  truth once the amount is added which the fit, in amber, says of the true hold.

Doubts that stay: conditions are those that broke something or that somebody thought of, and rules
were made while looking at other seeds of them; most simulators are linear with Gaussian noise; a
condition of few flights can look good by chance, which ± tells.
"""


@dataclass(frozen=True)
class Counted:
    """A condition as the page tells it."""

    tally: Tally
    true_hold: str = ""

    @property
    def held(self) -> tuple[float, int]:
        """Share that holds, and of how many."""
        return self.tally.coverage(true_hold=self.true_hold)

    @property
    def error(self) -> float:
        """Standard error of that share, over flights."""
        share, n = self.held
        missing = [
            sum(bool(self._holds(r)) - share for r in t.readings if r.holds is not None)
            for t in self.tally.trials
        ]
        return float(np.sqrt(np.sum(np.square(missing)))) / n if n else float("nan")

    @property
    def is_off(self) -> bool:
        """Outside the range by more than chance."""
        share, n = self.held
        if not n or LEAST <= share <= MOST:
            return False
        chance = max(self.error, float(np.sqrt(NOMINAL * (1.0 - NOMINAL) / n)))
        return abs(share - NOMINAL) > Z * chance

    @property
    def is_green_too_often(self) -> bool:
        """More flights green beside a miss than chance allows."""
        return self.tally.green_and_missed() > self.tally.ceiling()

    @property
    def shown(self) -> float:
        """Share of the numbers asked for that have an interval."""
        asked = [r.holds is not None for t in self.tally.trials for r in t.readings]
        return float(np.mean(asked)) if asked else float("nan")

    def _holds(self, reading: Reading) -> bool | None:
        return reading.holds_as(self.true_hold) if self.true_hold else reading.holds

    def cells(self) -> list[str]:
        """The row."""
        tally, (share, n) = self.tally, self.held
        lights = [100.0 * tally.share(each) for each in ("green", "amber", "red")]
        lit = any(trial.light for trial in tally.trials)
        missed, most = 100.0 * tally.green_and_missed(), 100.0 * min(tally.ceiling(), 1.0)
        return [
            tally.name,
            str(len(tally.trials)),
            str(n) if n else "–",
            _percent(self.shown, 0),
            _percent(share, 1) + (" **!**" if self.is_off else ""),
            _percent(2.0 * self.error, 1) if self.error > 0.0 else "–",
            ", ".join(f"{each:.0f}" for each in lights) if lit else "–",
            f"{missed:.1f}" + (" **!**" if self.is_green_too_often else "") if lit else "–",
            f"{most:.1f}" if lit else "–",
            _percent(tally.refusals(), 0),
        ]


def page(
    kept: Mapping[str, Mapping[int, Trial]],
    before: Mapping[str, Mapping[int, Trial]] | None = None,
    note: str = "",
) -> str:
    """Markdown of all conditions that the kept flights hold, family by family.

    Parameters
    ----------
    kept : mapping
        Trials by case and seed.
    before : mapping, optional
        The same of an earlier tree: its shares stand beside today's.
    note : str
        Where the flights come from, below their number.
    """
    parts, all_rows = [], []
    for title, cases in families():
        rows = [
            Counted(Tally(case.name, _in_order(kept[case.name])), case.true_hold)
            for case in cases
            if kept.get(case.name)
        ]
        if rows:
            all_rows += rows
            parts.append(f"## {title}\n\n{_table(rows, before)}")
    flights = sum(len(each.tally.trials) for each in all_rows)
    read = [each for each in all_rows if each.held[1]]
    off = sum(each.is_off for each in all_rows)
    green = sum(each.is_green_too_often for each in all_rows)
    sizes = [len(each.tally.trials) for each in all_rows]
    enough = [sum(size >= least for size in sizes) for least in ENOUGH]
    counted = (
        f"{flights:,} flights of {len(all_rows)} conditions, {min(sizes, default=0)} or more of "
        f"each, {ENOUGH[0]} or more of {enough[0]}, {ENOUGH[1]} or more of {enough[1]};\n"
        f"{sum(each.held[1] for each in all_rows):,} intervals in {len(read)} conditions.\n"
        f"Outside the range by more than chance: {off}. "
        f"Green beside a miss more often than allowed: {green}."
    )
    counted += f"\n\n{note}" if note else ""
    top = INTRODUCTION.format(
        counted=counted, z=Z, least=100 * LEAST, most=100 * MOST, rows=len(read),
        expected=1e-3 * len(read),
    )  # fmt: skip
    return "\n\n".join([top.rstrip(), *parts]) + "\n"


def write(
    path: Path,
    kept: Mapping[str, Mapping[int, Trial]],
    before: Mapping[str, Mapping[int, Trial]] | None = None,
    note: str = "",
) -> None:
    """The page as a file."""
    path.write_text(page(kept, before, note), encoding="utf-8")


def _in_order(trials: Mapping[int, Trial]) -> tuple[Trial, ...]:
    return tuple(trials[seed] for seed in sorted(trials))


def _table(rows: Sequence[Counted], before: Mapping[str, Mapping[int, Trial]] | None) -> str:
    head = [*HEAD, "held before %"] if before is not None else list(HEAD)
    lines = [head, ["---"] + ["---:"] * (len(head) - 1)]
    for row in rows:
        cells = row.cells()
        if before is not None:
            earlier = Tally(row.tally.name, _in_order(before.get(row.tally.name, {})))
            cells.append(_percent(earlier.coverage(true_hold=row.true_hold)[0], 1))
        lines.append(cells)
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _percent(share: float, digits: int) -> str:
    return f"{100.0 * share:.{digits}f}" if np.isfinite(share) else "–"
