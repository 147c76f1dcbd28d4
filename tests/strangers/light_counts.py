"""False greens over records that hold nothing, false reds over good ones, as one number each.

Run: python -m tests.strangers.light_counts barren|sound [--runs 500]
[--family fits|run|inspections] [--keep FILE]. Seeds go round the cases of `false_lights` (records
and the methods of fits), `rig_lights` (`flightid run`, a hundred times as dear) and
`inspected_logs`, one flight each.

Barren: hovers, loops without injection, wrong units, spikes, dead sensors, cuts. Refused is not
green, and of a sound one it counts as red.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scipy.stats import beta

from tests.strangers import false_lights, inspected_logs, rig_lights
from tests.strangers.counting import Tally
from tests.strangers.kept import KeptFlights

FAMILIES = {
    "fits": false_lights.LIGHTS,
    "run": rig_lights.LIGHTS,
    "inspections": inspected_logs.LIGHTS,
    "both": (*false_lights.LIGHTS, *rig_lights.LIGHTS),
}
WRONG = {"barren": ("green",), "sound": ("red", "refused")}


def at_most(wrong: int, runs: int) -> float:
    """Share that wrong of so many allow at 95 % (Clopper and Pearson, one side)."""
    return float(beta.ppf(0.95, wrong + 1, runs - wrong)) if wrong < runs else 1.0


def counted(
    group: str, runs: int, first_seed: int, kept: KeptFlights | None, family: str = "both"
) -> list[Tally]:
    """Flights by case, seed after seed."""
    cases = [case for case in FAMILIES[family] if case.name.startswith(group)]
    own = {case.name: {} for case in cases}
    for seed in range(first_seed, first_seed + runs):
        case = cases[seed % len(cases)]
        if kept is None:
            own[case.name][seed] = case.fly(seed)
        else:
            kept.fly(case, [seed])
            own[case.name][seed] = kept.trials[case.name][seed]
    return [Tally(name, tuple(trials.values())) for name, trials in own.items() if trials]


def lights(tally: Tally) -> list[str]:
    """Of every flight; "refused" where there was none."""
    return [trial.light or "refused" for trial in tally.trials]


def main() -> None:
    """Count by case and in all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("group", choices=WRONG)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--family", choices=FAMILIES, default="both")
    parser.add_argument("--keep", type=Path, help="file that flights are added to, and read from")
    asked = parser.parse_args()
    kept = KeptFlights(asked.keep) if asked.keep else None
    tallies = counted(asked.group, asked.runs, asked.first_seed, kept, asked.family)
    names = ("green", "amber", "red", "refused")
    print(f"{'':40s}" + "".join(f"{name:>8s}" for name in names))
    for tally in tallies:
        print(f"{tally.name:40s}" + "".join(f"{lights(tally).count(n):8d}" for n in names))
    found = [light for tally in tallies for light in lights(tally)]
    print(f"{'all':40s}" + "".join(f"{found.count(n):8d}" for n in names))
    wrong = sum(found.count(name) for name in WRONG[asked.group])
    print(
        f"false {WRONG[asked.group][0]}: {wrong} of {len(found)}; "
        f"at most {at_most(wrong, len(found)):.1%} at 95 % confidence"
    )


if __name__ == "__main__":
    main()
