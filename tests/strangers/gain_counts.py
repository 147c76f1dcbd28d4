"""Counts of flown gains: outcomes that last in a file, and their table."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

MADE = ("green", "amber")
HEADING = (
    f"{'':44s} {'n':>4s} {'ref':>4s} {'none':>4s} {'red':>4s} {'amb':>4s} {'grn':>4s} "
    f"{'broken':>6s} {'by green':>8s} {'good':>5s} {'refused':>7s}"
)


@dataclass(frozen=True)
class Outcome:
    """What became of a tuning.

    Attributes
    ----------
    verdict : str
        refused, none, red, amber, green or fault: of the gains as they would be written.
    why : str
    broken : str
        In which way the promise did not hold; empty: it held, or there was none.
    wasted : bool
        Refused, red or none, right in structure, and good gains were there to be had.
    """

    seed: int
    truth: str
    structure: str
    method: str
    right: bool
    verdict: str
    why: str
    broken: str
    seconds: float
    wasted: bool = False

    @property
    def is_made(self) -> bool:
        """Whether gains were handed over."""
        return self.verdict in MADE

    def row(self) -> str:
        """One tuning on one line."""
        return (
            f"{self.seed:5d} {self.verdict:8s} {self.truth:26s} {self.structure:26s} "
            f"{self.method:17s} {'right' if self.right else 'wrong'} "
            f"{'good, lost' if self.wasted else '':10s} {self.seconds:5.1f} s  "
            f"{self.broken} | {self.why[:170]}"
        )


def read(path: Path | None) -> dict[int, Outcome]:
    """Outcomes of a file by seed; a last line that was cut off is left out."""
    found = {}
    for line in path.read_text().splitlines() if path is not None and path.exists() else ():
        try:
            item = Outcome(**json.loads(line))
        except (json.JSONDecodeError, TypeError):
            continue
        found[item.seed] = item
    return found


def collected(
    seeds: Iterable[int],
    tried: Callable[[int], Outcome],
    path: Path | None,
    show: Callable[[Outcome], None],
) -> list[Outcome]:
    """Outcomes of those seeds, tried where the file has them not, and all that it had besides."""
    known = read(path)
    for seed in seeds:
        if seed in known:
            continue
        known[seed] = found = tried(seed)
        if path is not None:
            with path.open("a") as file:
                file.write(json.dumps(asdict(found)) + "\n")
        show(found)
    return [known[seed] for seed in sorted(known)]


def table(outcomes: list[Outcome]) -> str:
    """Counts of the whole, and by method, structure, truth and structure × method."""
    lines, groups = [HEADING], {"all": outcomes}
    for kind in ("method", "structure", "truth"):
        for name in sorted({getattr(o, kind) for o in outcomes}):
            groups[f"{kind} {name}"] = [o for o in outcomes if getattr(o, kind) == name]
    for o in sorted(outcomes, key=lambda o: (o.structure, o.method)):
        groups.setdefault(f"{o.structure} × {o.method}", []).append(o)
    for name, chosen in groups.items():
        kinds = Counter(o.verdict for o in chosen)
        made = [o for o in chosen if o.is_made]
        held = [o for o in made if o.right and not o.broken]
        wasted = sum(o.wasted for o in chosen)
        lines.append(
            f"{name:44s} {len(chosen):4d} "
            + " ".join(f"{kinds[k]:4d}" for k in ("refused", "none", "red", "amber", "green"))
            + f" {sum(bool(o.broken) for o in made):6d}"
            + f" {sum(bool(o.broken) for o in made if o.verdict == 'green'):8d}"
            + f" {len(held) + wasted:5d} {wasted:7d}"
        )
    return "\n".join(lines)
