"""Kill commands at random moments, look for losses: `python -m tests.stress.kills --kills 200`.

A file is whole or the one before, a folder of a study too; one into which a verb writes file by
file (`plan`) has each whole. What commands read, and all else in their folders, has the same bytes.
After each kill the command is run again: it ends well, its result is whole, and what the kill left
aside is gone. Every second moment is one at which files are being written or renamed.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

from flightid.vehicles import fly
from flightid.vehicles.ardupilot_log import write_ardupilot_log
from tests.autotune_log import write_ardupilot
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis
from tests.stress.losses import contents, harm, loss, next_run, others

PROGRAM = (sys.executable, "-m", "flightid")
STUDY = Path(__file__).parents[2] / "examples" / "quadrotor_rig" / "study.toml"
LOOK_S, AFTER_S = 0.0005, 0.005
"""Between looks at files that are being written, and at most from a change to a kill, s."""
MODEL = ("rate_motor_lag", "--axis", "roll")


def commands(folder: Path) -> dict[str, tuple[list[str], Path]]:
    """Arguments and what each writes; the study is flown once for the log that others read."""
    flown, swept = folder / "flown", folder / "swept.bin"
    subprocess.run([*PROGRAM, "run", str(STUDY), "--output", str(flown)], stdout=-3, check=True)
    (flown / "flight.bin").replace(swept)
    ordinary, tuned = folder / "ordinary.bin", folder / "autotune.bin"
    hover = write_ardupilot_log(fly(duration_s=20.0), folder / "hover.bin")
    write_ordinary_log(ordinary)
    write_ardupilot(tuned, Axis(), most=12)
    words: dict[str, tuple[list[object], str]] = {
        "export": (["export", *MODEL], "model.toml"),
        "fly": (["fly", *MODEL, "--duration", 0.5, "--write"], "flown.nc"),
        "run": (["run", STUDY, "--output"], "out"),
        "tune": (["tune", swept, "--output"], "tuned"),
        "plan": (["plan", hover, "--overwrite", "--output"], "planned"),
        "autotune": (["autotune", tuned, "--html"], "autotune.html"),
        "flight": (["flight", ordinary, "--html"], "flight.html"),
    }
    return {
        verb: ([*map(str, start), str(folder / name)], folder / name)
        for verb, (start, name) in words.items()
    }


def changes(made: subprocess.Popen[bytes], path: Path, most: float) -> int:
    """Wait for so many changes beside a result or of it, or for the command's end; those seen."""

    def state() -> set[tuple[str, int]]:
        found = set()
        for each in os.scandir(path.parent):
            if path.name in each.name:
                try:
                    found.add((each.name, each.stat().st_mtime_ns))
                except OSError:  # renamed meanwhile
                    continue
        return found

    seen, before = 0, state()
    while made.poll() is None and seen < most:
        time.sleep(LOOK_S)
        if (now := state()) != before:
            seen, before = seen + 1, now
    return seen


@dataclass(frozen=True)
class Whole:
    """What a command that nobody kills takes, and leaves.

    Seconds, and changes seen on the way; files, and those of the same bytes twice.
    """

    span_s: float
    changes: int
    files: dict[str, bytes]
    fixed: dict[str, bytes]


def unharmed(words: Sequence[str], path: Path) -> Whole:
    """Run it twice: once to have what a second run replaces."""
    subprocess.run([*PROGRAM, *words], check=True, stdout=-3, stderr=-3)
    first, begun = contents(path), time.monotonic()
    made = subprocess.Popen([*PROGRAM, *words], stdout=-3, stderr=-3)
    seen = changes(made, path, inf)
    assert made.wait() == 0, words
    span_s, files = time.monotonic() - begun, contents(path)
    assert files, f"{words[0]} wrote nothing that a kill could lose"
    assert seen, f"{words[0]} was not seen writing"
    fixed = {name: content for name, content in files.items() if first.get(name) == content}
    return Whole(span_s, seen, files, fixed)


def tell(
    verbs: Sequence[str], kills: Counter[str], within: Counter[str], lost: Counter[str]
) -> None:
    """The table, as far as the count has come."""
    for verb in verbs:
        print(f"{verb:9}{kills[verb]:4} kills{within[verb]:4} before its end{lost[verb]:3} lost")
    print(
        f"{kills.total()} kills, {within.total()} before the end, {lost.total()} losses", flush=True
    )


def main() -> int:
    """Kill each verb in turn; a table of kills, those before the end, and losses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--verbs", nargs="+")
    asked = parser.parse_args()
    chance = random.Random(0)
    kills, within, losses = Counter[str](), Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        known = commands(Path(name))
        verbs = asked.verbs or list(known)
        folders, results = (Path(name), STUDY.parent), [path for _, path in known.values()]
        whole = {verb: unharmed(*known[verb]) for verb in verbs}
        apart = others(folders, results)  # With the study that `tune` writes beside the log.
        try:
            for kill in range(asked.kills):
                verb = verbs[kill % len(verbs)]
                words, path = known[verb]
                made = subprocess.Popen([*PROGRAM, *words], stdout=-3, stderr=-3)
                if kill // len(verbs) % 2:
                    time.sleep(chance.uniform(0.3, 1.1) * whole[verb].span_s)
                else:
                    changes(made, path, chance.randint(1, whole[verb].changes))
                    time.sleep(chance.uniform(0.0, AFTER_S))
                made.kill()
                kills[verb] += 1
                within[verb] += made.wait() < 0
                own = (whole[verb].files, whole[verb].fixed)
                if told := (
                    loss(path, *own)
                    or harm(apart, others(folders, results))
                    or next_run([*PROGRAM, *words], path, *own)
                    or harm(apart, others(folders, results))
                ):
                    losses[verb] += 1
                    print(kill, verb, told, flush=True)
                # A count that is cut off (it takes half an hour) still says how far it came.
                if (kill + 1) % 20 == 0:
                    tell(verbs, kills, within, losses)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        tell(verbs, kills, within, losses)
    return 1 if losses else 0


if __name__ == "__main__":
    sys.exit(main())
