"""Every log of a folder whole and cut at many places: what `inspect` and `flight` say of each.

`python -m tests.stress.log_cuts FOLDER --places 50 [--keep FILE]` prints each distinct sentence
once, numbers as #, with how often it came and its first numbers, for somebody to read; then axes
that were lost, by themselves or beside the next shorter and longer cut. With `--keep` each cut is
a line of that file, and only those that it has not are inspected.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import flightid as fid
from flightid.errors import FlightidError

NONE = {"nan", "inf", "None"}
LOST = "no span holds"
"""Of an axis whose channels and flight are there and still share no span."""


@dataclass
class Cut:
    """One cut of one log, and what was said of it.

    Attributes
    ----------
    sentences : list of str
    axes : dict
        By axis of `inspect`, why it has no band; empty where it has one.
    lost, contradictions : list of str
    untyped : str
        An error that is none of flightid's.
    """

    log: str
    place: int
    sentences: list[str] = field(default_factory=list)
    axes: dict[str, str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    untyped: str = ""
    inspected: bool = False


@dataclass
class Sentences:
    """Distinct sentences, by log: how often, and the first with its numbers."""

    counts: dict[tuple[str, str], int] = field(default_factory=dict)
    first: dict[tuple[str, str], str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    untyped: list[str] = field(default_factory=list)
    inspected: int = 0

    def take(self, cut: Cut) -> None:
        """Take what was said of one cut."""
        where = f"{cut.log}, {cut.place}"
        self.inspected += cut.inspected
        self.lost += [f"{where}: {each}" for each in cut.lost]
        self.contradictions += [f"{where}: {each}" for each in cut.contradictions]
        self.untyped += [f"{where}: {cut.untyped}"] if cut.untyped else []
        for sentence in cut.sentences:
            key = cut.log, re.sub(r"\d+(\.\d+)?", "#", sentence)
            self.counts[key] = self.counts.get(key, 0) + 1
            self.first.setdefault(key, f"{cut.place}: {sentence}")


def cuts(folder: Path, places: int) -> Iterator[tuple[Path, int, bytes]]:
    """Each log of a folder, cut after each of so many equal parts; the last is whole."""
    for path in sorted(folder.iterdir()):
        content = path.read_bytes()
        for place in range(1, places + 1):
            yield path, place, content[: len(content) * place // places]


def inspected(folder: Path, places: int, keep: Path | None = None) -> list[Cut]:
    """Inspect every cut of every log that the file has not."""
    known = {(cut.log, cut.place): cut for cut in _kept(keep)}
    with tempfile.TemporaryDirectory() as name:
        for path, place, content in cuts(folder, places):
            if (path.name, place) in known:
                continue
            copy = Path(name) / f"cut{path.suffix}"
            copy.write_bytes(content)
            known[path.name, place] = cut = Cut(path.name, place)
            try:
                _inspect(copy, cut)
            except FlightidError as error:
                cut.sentences.append(f"refused: {error}")
            except Exception as error:
                cut.untyped = f"{type(error).__name__}: {error}"
            if keep is not None:
                with keep.open("a") as file:
                    file.write(json.dumps(asdict(cut)) + "\n")
    return [known[key] for key in sorted(known)]


def said_of(folder: Path, places: int, keep: Path | None = None) -> Sentences:
    """All sentences of all cuts, and what was lost, denied or untyped."""
    found, all_cuts = Sentences(), inspected(folder, places, keep)
    for cut in all_cuts:
        found.take(cut)
    found.lost += lost_between(all_cuts)
    return found


def lost_between(all_cuts: list[Cut]) -> list[str]:
    """Axes that a shorter cut and a longer one have, and bands lost for no want of coherence."""
    lost = []
    for log in sorted({cut.log for cut in all_cuts}):
        own = [cut for cut in all_cuts if cut.log == log]
        for axis in sorted({axis for cut in own for axis in cut.axes}):
            seen = [k for k, cut in enumerate(own) if cut.axes.get(axis) == ""]
            for cut in own[min(seen) : max(seen)] if seen else ():
                why = cut.axes.get(axis, "not listed")
                if why and "coherence reaches" not in why and "coherence stays" not in why:
                    lost.append(f"{log}, {cut.place}: {axis}: {why}, between cuts with a band")
    return lost


def _kept(path: Path | None) -> Iterable[Cut]:
    """Cuts of a file; a last line that was cut off is left out."""
    for line in path.read_text().splitlines() if path is not None and path.exists() else ():
        try:
            yield Cut(**json.loads(line))
        except (json.JSONDecodeError, TypeError):
            continue


def _inspect(copy: Path, cut: Cut) -> None:
    inspection = fid.inspect_log(copy)
    cut.inspected = True
    findings = " ".join(map(str, inspection.findings))
    cut.sentences += [str(finding) for finding in inspection.findings]
    for band in inspection.bands:
        cut.axes[band.axis] = "" if band.band_rad_s else band.reason
        cut.sentences.append(f"{band.axis}: {band.reason or 'a band'}")
        if LOST in band.reason:
            cut.lost.append(f"{band.axis}: {band.reason}")
    reviewed = [f"flight: {finding}" for finding in fid.review_flight(copy).findings]
    cut.sentences += reviewed
    review = " ".join(reviewed)
    flew = bool(inspection.phases.airborne)
    codes = {finding.code for finding in inspection.findings}
    # What one sentence says another may not deny.
    denied = (
        (flew and "not-airborne" in codes, "airborne, and never airborne"),
        (not flew and "airborne" in codes, "not airborne, and airborne"),
        (
            "" in cut.axes.values() and "none could be measured" in findings,
            "a band, and none that could be measured",
        ),
        ("coherence 0.00" in findings + review, "a coherence of 0.00, which none has"),
        (not NONE.isdisjoint(re.findall(r"\w+", findings + review)), "a number that is none"),
    )
    cut.contradictions += [what for wrong, what in denied if wrong]


def main() -> None:
    """Print all sentences, then what is lost, contradicted or untyped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--places", type=int, default=50)
    parser.add_argument("--keep", type=Path, help="file that cuts are added to, and read from")
    asked = parser.parse_args()
    found = said_of(asked.folder, asked.places, asked.keep)
    for key in sorted(found.counts):
        print(f"{found.counts[key]:4d} {key[0]} {found.first[key]}")
    for name in ("lost", "contradictions", "untyped"):
        listed = getattr(found, name)
        print(f"{name}: {len(listed)} of {found.inspected} inspections", *listed, sep="\n  ")


if __name__ == "__main__":
    main()
