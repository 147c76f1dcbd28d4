"""Kill commands at random moments, look for losses: `python -m tests.stress.kills --kills 200`."""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STUDY = Path(__file__).parents[2] / "examples" / "quadrotor_rig" / "study.toml"
MODEL = ("rate_motor_lag", "--axis", "roll")


def commands(folder: Path) -> dict[str, tuple[list[str], Path]]:
    """Arguments and what each writes."""
    written, flown, out = folder / "model.toml", folder / "flown.nc", folder / "out"
    flight = ["fly", *MODEL, "--duration", "0.5", "--output", str(flown)]
    return {
        "export": (["export", *MODEL, str(written)], written),
        "fly": (flight, flown),
        "run": (["run", str(STUDY), "--output", str(out)], out),
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
    try:
        for name, content in after.items():
            json.loads(content) if name.endswith(".json") else None
    except ValueError as error:
        return f"half written: {error}"
    return "" if all(after.values()) else "empty files"


def main() -> int:
    """Kill each verb in turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--verbs", nargs="+", default=["export", "fly", "run"])
    asked = parser.parse_args()
    chance, losses = random.Random(0), 0
    with tempfile.TemporaryDirectory() as name:
        known = {verb: commands(Path(name))[verb] for verb in asked.verbs}
        spans = {}
        for verb, (words, _) in known.items():
            begun = time.monotonic()
            subprocess.run(
                [sys.executable, "-m", "flightid", *words], check=True, stdout=subprocess.DEVNULL
            )
            spans[verb] = time.monotonic() - begun
        before = {verb: contents(path) for verb, (_, path) in known.items()}
        for kill in range(asked.kills):
            verb = asked.verbs[kill % len(asked.verbs)]
            words, path = known[verb]
            made = subprocess.Popen(
                [sys.executable, "-m", "flightid", *words], stdout=-3, stderr=-3
            )
            time.sleep(chance.uniform(0.3, 1.1) * spans[verb])
            made.kill()
            made.wait()
            if told := loss(path, before[verb]):
                losses += 1
                print(kill, verb, told, flush=True)
    print(f"{asked.kills} kills, {losses} losses")
    return 1 if losses else 0


if __name__ == "__main__":
    sys.exit(main())
