"""How near free runs must be to count as alike: what each limit makes of SciPy's rigs.

Run: python -m tests.strangers.alike_kinds sound --runs 100 [--limits 0.02 0.1] [--keep FILE]

Rigs of `tests.strangers.rig_lights` go through `flightid run` once for each limit. Counted are the
light; the error of a free run along inputs that nobody has fitted, against the rig without noise,
over the deviation of its output; and how often the response's intervals hold the rig's at five
frequencies.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from collections.abc import MutableMapping
from pathlib import Path
from typing import Any

import numpy as np

import flightid as fid
from flightid.errors import FlightidError
from flightid.identification.uncertain_of import uncertain_of
from flightid.responses import CoherentPairs
from flightid.study import structures
from flightid.study.pipeline import identify_models
from flightid.study.proposal.propose import propose_study
from flightid.study.settings import read_settings
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.task import load_task
from flightid.validation import OrderScan
from tests.strangers.rig_lights import BARREN, SOUND, STEP_S, Array, Columns, Rig, injected

LIMITS = (0.02, 0.05, 0.1, 0.2)
FREQUENCIES = (0.3, 0.55, 1.0, 1.8, 3.0)
"""Of the rig's own, at which intervals are held against its response."""
FRESH_SAMPLES = 1500
KEPT = (OrderScan, fid.FrequencyResponse, CoherentPairs, list)
"""Results of stages that no limit has a share in."""


def drawn(seed: int, group: str) -> tuple[str, Columns, Rig | None]:
    """Name and columns of a seed, and the rig behind sound ones."""
    rows = {"sound": SOUND, "barren": BARREN}[group]
    name = list(rows)[seed % len(rows)]
    columns = rows[name](np.random.default_rng([seed, 1212]))
    if group == "barren":
        return name, columns, None
    again = np.random.default_rng([seed, 1212])
    again.integers(1500, 3000)
    return name, columns, Rig(again)


def fitted(
    path: Path, limit: float, cache: MutableMapping[str, Any]
) -> tuple[str, str, fid.Fit | None]:
    """Light and kind of `flightid run` with a limit, and the fit."""
    structures.RUNS_ALIKE = limit
    for key in [key for key, made in cache.items() if not isinstance(made, KEPT)]:
        del cache[key]
    folder = path.parent
    made = propose_study([path], folder=folder, inputs=["u"], outputs=["y"], cache=cache)
    if not made.models:
        return "red", "none", None
    settings = read_settings(made.write(folder / f"study-{limit:g}.toml"))
    tasks, runner = [load_task(each) for each in settings.models], StageRunner(cache)
    records = take(settings, tasks, None, folder, runner).records
    (staged,) = identify_models(tasks, records, None, settings.reduce, runner, lambda *_: None)
    fit, asked = staged.value.fit, settings.models[0].structure
    kind = "none" if asked is None else asked.structure
    return ("red", kind, None) if fit is None else (str(fit.evidence.light), kind, fit)


def truth_of(rig: Rig, omega: Array) -> Array:
    """The rig's own response, sampled."""
    z = np.exp(1j * omega * STEP_S)
    above = np.polyval(rig.b[::-1], 1 / z)
    return np.asarray(above / np.polyval(rig.a[::-1], 1 / z))


def off_by(fit: fid.Fit, rig: Rig, kind: str, seed: int) -> float:
    """Error of a free run along fresh inputs, over the deviation of the rig's own output."""
    random = np.random.default_rng([seed, 77])
    u = injected(random, kind, FRESH_SAMPLES, rig.omega)
    y = rig.answer(u)
    time_s = np.arange(FRESH_SAMPLES) * STEP_S
    fresh = fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")
    (run,) = fid.predict(fit.model, [fresh])
    measured, predicted = run.scored("y")
    return float(np.std(measured - predicted) / np.std(measured))


def held(fit: fid.Fit, rig: Rig) -> list[bool]:
    """Of each frequency's real and imaginary part: whether its interval holds the rig's."""
    omega = rig.omega * np.array(FREQUENCIES)
    omega = omega[omega < 0.8 * np.pi / STEP_S]
    known = uncertain_of(fit)
    if not known.known:
        return []

    def parts(model: Any) -> Array:
        found = np.ravel(model.frequency_response(omega))
        return np.concatenate([found.real, found.imag])

    bounds = known.carried(parts).interval()
    truth = truth_of(rig, omega)
    if bounds is None:
        return []
    low, high = np.asarray(bounds).T
    wanted = np.concatenate([truth.real, truth.imag])
    return [bool(each) for each in (low <= wanted) & (wanted <= high)]


def tried(seed: int, group: str, limits: tuple[float, ...]) -> dict[str, Any]:
    """What each limit makes of one record."""
    name, columns, rig = drawn(seed, group)
    table = np.column_stack([np.arange(columns["y"].size) * STEP_S, columns["u"], columns["y"]])
    found: dict[str, Any] = {"group": group, "seed": seed, "name": name}
    with tempfile.TemporaryDirectory() as place:
        path, cache = Path(place) / "rig.csv", {}
        np.savetxt(path, table, "%.7g", ",", header="time [s],u,y", comments="")
        for limit in limits:
            begun, said = time.process_time(), {}
            try:
                light, kind, fit = fitted(path, limit, cache)
                said = {"light": light, "kind": kind}
                if fit is not None and rig is not None:
                    said |= {"off": off_by(fit, rig, name, seed), "held": held(fit, rig)}
            except FlightidError as error:
                said |= {"light": said.get("light", "red"), "refused": str(error)[:120]}
            found[f"{limit:g}"] = said | {"seconds": time.process_time() - begun}
    return found


def table(rows: list[dict[str, Any]], limits: tuple[float, ...]) -> str:
    """One line for each limit."""
    lines = []
    for limit in limits:
        each = [row[f"{limit:g}"] for row in rows if f"{limit:g}" in row]
        lights = Counter(item["light"] for item in each)
        kinds = Counter(item.get("kind", "none") for item in each)
        off = [item["off"] for item in each if "off" in item]
        inside = [one for item in each for one in item.get("held", ())]
        green = [one for item in each if item["light"] == "green" for one in item.get("held", ())]
        shares = [np.mean(part) if part else np.nan for part in (inside, green)]
        middle = np.percentile(off, [50, 90]) if off else [np.nan, np.nan]
        lines.append(
            f"{limit:5.0%} of {len(each):4d}: {dict(lights)} {dict(kinds)} free run off "
            f"{middle[0]:.2%} (9 of 10 below {middle[1]:.2%}), held {shares[0]:.1%} of "
            f"{len(inside)}, green {shares[1]:.1%} of {len(green)}"
        )
    return "\n".join(lines)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("group", choices=("sound", "barren"))
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--limits", type=float, nargs="+", default=LIMITS)
    parser.add_argument("--keep", type=Path, help="file that records are added to, and read from")
    asked = parser.parse_args()
    limits, known = tuple(asked.limits), {}
    for line in asked.keep.read_text().splitlines() if asked.keep and asked.keep.exists() else ():
        row = json.loads(line)
        known[row["group"], row["seed"]] = row
    rows = []
    for seed in range(asked.first_seed, asked.first_seed + asked.runs):
        row = known.get((asked.group, seed))
        if row is None:
            row = tried(seed, asked.group, limits)
            if asked.keep:
                with asked.keep.open("a") as file:
                    file.write(json.dumps(row) + "\n")
        rows.append(row)
    print(table(rows, limits))


if __name__ == "__main__":
    main()
