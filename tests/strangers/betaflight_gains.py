"""Gains of Betaflight quadrotors from their blackbox, flown again: promised beside measured.

`python -m tests.strangers.betaflight_gains --vehicles 40` flies them in batches, tunes each from
its file and measures the margins of the new gains in the same simulation, with the loop closed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flightid.findings import worst
from flightid.study import run_study
from flightid.study.proposal import propose_study
from tests import betaflight_flight as betaflight

BATCH = 10
TOLERANCE = {"phase margin": 0.25, "gain margin": 0.1}
"""Of the measurement: its frequencies are 3 % apart."""


def tuned(path: Path) -> dict[str, Any]:
    """Axes of a file with their light, gains and what is promised of the worst vehicle."""
    study = path.with_suffix(".toml")
    propose_study([path], folder=path.parent, tune=True).write(study)
    tuning = run_study(study, output=path.parent / f"{path.stem}-output").tuning
    if tuning is None:
        return {}
    made: dict[str, Any] = {}
    for each in tuning.designs:
        sound = each in tuning.sound
        light = str(worst(each.findings)) if each.findings else "green"
        promised = {q: each.worst_case("rate loop", q).worst for q in TOLERANCE} if sound else {}
        flown = {q: each.worst_case("rate loop", q).flown_worst for q in TOLERANCE}
        codes = [f.code for f in each.findings if str(f.light) == light]
        made[each.axis] = {
            "sound": sound, "light": light, "gains": each.gains, "promised": promised,
            "flown": flown, "codes": codes, "why": tuning.left_out.get(each.axis, ""),
        }  # fmt: skip
    for refused in tuning.refused:
        made[refused.axis] = {"sound": False, "light": "refused", "why": str(refused)[:200]}
    return made


def batch(n: int, seed: int, rounds: int) -> Iterator[dict[str, Any]]:
    """Outcomes of a batch of vehicles, one an axis."""
    quads, gains = betaflight.Quads.of(n, seed), betaflight.default_gains(n)
    phase, axis = betaflight.chirp_flight(rounds)
    flown = betaflight.fly(quads, gains, phase, axis, seed=seed)
    before = betaflight.flown_margins(quads, gains)
    new = {name: each.copy() for name, each in gains.items()}
    made = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(n):
            path = Path(folder, f"quad{k}.bfl")
            path.write_bytes(betaflight.blackbox_of(flown, quads, phase, axis, k))
            made.append(tuned(path))
            path.unlink()
            for place, name in enumerate(betaflight.AXES):
                for gain, value in made[k].get(name, {}).get("gains", {}).items():
                    new[gain[0]][k, place] = value
    after = betaflight.flown_margins(quads, new)
    for k in range(n):
        for place, name in enumerate(betaflight.AXES):
            margins = {
                word: {"phase margin": float(m["phase"][k, place]),
                       "gain margin": float(m["gain"][k, place])}
                for word, m in (("before", before), ("after", after))
            }  # fmt: skip
            yield {"seed": seed, "vehicle": k, "axis": name, **made[k].get(name, {}), **margins}


def broken(outcome: dict[str, Any]) -> list[str]:
    """Promises that the flight does not keep: of the new gains, and of those that flew."""
    found = []
    for which, measured in (("promised", "after"), ("flown", "before")):
        for name, least in outcome.get(which, {}).items():
            if least is not None and outcome[measured][name] < least - TOLERANCE[name]:
                found.append(f"{which} {name} {least:.3g}, flown {outcome[measured][name]:.3g}")
    return found


def main() -> None:
    """Fly, tune, fly again and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="file of outcomes")
    asked = parser.parse_args()
    outcomes = []
    for seed in range(asked.first_seed, asked.first_seed + -(-asked.vehicles // BATCH)):
        for each in batch(BATCH, seed, asked.rounds):
            outcomes.append(each)
            if asked.keep:
                with asked.keep.open("a") as stream:
                    stream.write(json.dumps(each) + "\n")
            if said := broken(each):
                print(seed, each["vehicle"], each["axis"], each.get("light"), said, flush=True)
    for light in ("green", "amber", "red", "refused", None):
        told = [each for each in outcomes if each.get("light") == light]
        bad = [each for each in told if each.get("sound") and broken(each)]
        made = sum(bool(each.get("sound")) for each in told)
        print(f"{light}: {len(told)} axes, {made} with gains, {len(bad)} promises broken")


if __name__ == "__main__":
    main()
