"""Kill commands at random moments, look for losses: `python -m tests.stress.kills --kills 200`.

A file is whole or the one before, a folder of a study too; one into which a verb writes file by
file (`plan`) has each whole. What a kill leaves aside, the next run clears.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from flightid.vehicles import fly
from flightid.vehicles.ardupilot_log import write_ardupilot_log
from tests.autotune_log import write_ardupilot
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis

PROGRAM = (sys.executable, "-m", "flightid")
STUDY = Path(__file__).parents[2] / "examples" / "quadrotor_rig" / "study.toml"
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


def contents(path: Path) -> dict[str, bytes]:
    """Files of a result, or one file."""
    files = [path] if path.is_file() else [each for each in path.rglob("*") if each.is_file()]
    return {each.name: each.read_bytes() for each in files}


def loss(path: Path, before: dict[str, bytes]) -> str:
    """What is wrong after a kill; empty where the old or a whole new result stands."""
    aside = list(path.parent.glob(f".{path.name}.*.old"))
    if not path.exists():
        return "" if aside else "gone"
    after = contents(path)
    if missing := set(before) - set(after):
        return f"without {sorted(missing)[:3]}"
    for name, content in after.items():
        if name.endswith(".html") and not content.rstrip().endswith(b"</html>"):
            return f"half of {name}"
        try:
            json.loads(content) if name.endswith(".json") else None
        except ValueError as error:
            return f"half of {name}: {error}"
    return "" if all(after.values()) else "empty files"


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
        spans, before = {}, {}
        for verb in verbs:
            words, path = known[verb]
            begun = time.monotonic()
            subprocess.run([*PROGRAM, *words], check=True, stdout=-3, stderr=-3)
            spans[verb], before[verb] = time.monotonic() - begun, contents(path)
            assert before[verb], f"{verb} wrote nothing that a kill could lose"
        try:
            for kill in range(asked.kills):
                verb = verbs[kill % len(verbs)]
                words, path = known[verb]
                made = subprocess.Popen([*PROGRAM, *words], stdout=-3, stderr=-3)
                time.sleep(chance.uniform(0.3, 1.1) * spans[verb])
                made.kill()
                kills[verb] += 1
                within[verb] += made.wait() < 0
                if told := loss(path, before[verb]):
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
