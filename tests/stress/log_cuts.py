"""Every log of a folder whole and cut at many places: what `inspect` and `flight` say of each.

`python -m tests.stress.log_cuts FOLDER --places 50` prints each distinct sentence once, numbers
as #, with how often it came and its first numbers, for somebody to read; then axes that were lost.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import flightid as fid
from flightid.errors import FlightidError

LOST = "no span holds"
"""Of an axis whose channels and flight are there and still share no span."""


@dataclass
class Sentences:
    """Distinct sentences, by log: how often, and the first with its numbers."""

    counts: dict[tuple[str, str], int] = field(default_factory=dict)
    first: dict[tuple[str, str], str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    untyped: list[str] = field(default_factory=list)
    inspected: int = 0

    def say(self, log: str, place: int, sentence: str) -> None:
        """Take one sentence."""
        key = log, re.sub(r"\d+(\.\d+)?", "#", sentence)
        self.counts[key] = self.counts.get(key, 0) + 1
        self.first.setdefault(key, f"{place}: {sentence}")


def cuts(folder: Path, places: int) -> Iterator[tuple[Path, int, bytes]]:
    """Each log of a folder, cut after each of so many equal parts; the last is whole."""
    for path in sorted(folder.iterdir()):
        content = path.read_bytes()
        for place in range(1, places + 1):
            yield path, place, content[: len(content) * place // places]


def said_of(folder: Path, places: int) -> Sentences:
    """Inspect every cut of every log."""
    found = Sentences()
    with tempfile.TemporaryDirectory() as name:
        for path, place, content in cuts(folder, places):
            copy = Path(name) / f"cut{path.suffix}"
            copy.write_bytes(content)
            try:
                _inspect(copy, path.name, place, found)
            except FlightidError as error:
                found.say(path.name, place, f"refused: {error}")
            except Exception as error:
                found.untyped.append(f"{path.name}, {place}: {type(error).__name__}: {error}")
    return found


def _inspect(copy: Path, log: str, place: int, found: Sentences) -> None:
    inspection = fid.inspect_log(copy)
    found.inspected += 1
    for finding in inspection.findings:
        found.say(log, place, str(finding))
    for band in inspection.bands:
        found.say(log, place, f"{band.axis}: {band.reason or 'a band'}")
        if LOST in band.reason:
            found.lost.append(f"{log}, {place}: {band.axis}: {band.reason}")
    for finding in fid.review_flight(copy).findings:
        found.say(log, place, f"flight: {finding}")
    flew = bool(inspection.phases.airborne)
    codes = {finding.code for finding in inspection.findings}
    # What one sentence says another may not deny.
    denied = (
        (flew and "not-airborne" in codes, "airborne, and never airborne"),
        (not flew and "airborne" in codes, "not airborne, and airborne"),
        (
            any(band.band_rad_s for band in inspection.bands)
            and "none could be measured" in " ".join(map(str, inspection.findings)),
            "a band, and none that could be measured",
        ),
    )
    found.contradictions += [f"{log}, {place}: {what}" for wrong, what in denied if wrong]


def main() -> None:
    """Print all sentences, then what is lost, contradicted or untyped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--places", type=int, default=50)
    asked = parser.parse_args()
    found = said_of(asked.folder, asked.places)
    for key in sorted(found.counts):
        print(f"{found.counts[key]:4d} {key[0]} {found.first[key]}")
    for name in ("lost", "contradictions", "untyped"):
        listed = getattr(found, name)
        print(f"{name}: {len(listed)} of {found.inspected} inspections", *listed, sep="\n  ")


if __name__ == "__main__":
    main()
