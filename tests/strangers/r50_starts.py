"""Starts around the truth of an R-50 with servos: how many reach the optimum of the truth.

Run: python -m tests.strangers.r50_starts --runs 100 [--spread 0.5] [--keep FILE]

The vehicle is that of `tests.strangers.helicopter`, its swashplate behind servos of 15 rad/s. Each
start draws every parameter within the spread about its true value, and `identify` has its default
options, the estimator's leakage and resolution taken out. The optimum is that from the truth.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import flightid as fid
from flightid.simulation import actuator_positions
from tests.strangers.helicopter import INPUTS, OUTPUTS, PUBLISHED, Vehicle, coherent
from tests.strangers.noises import Array

SERVOS_RAD_S = {"lat": 15.0, "lon": 15.0, "col": 15.0}
REPEATS, SAMPLES = 2, 2500
SAME_COST, SAME_ERRORS = 1e-3, 0.1
"""Of the cost, and of each standard error: by how much an end may differ from the optimum."""


class ServoVehicle(Vehicle):
    """The published vehicle, its swashplate behind first-order servos as further states."""

    def __init__(self, k: dict[str, float]) -> None:
        super().__init__(k)
        self._behind([INPUTS.index(name) for name in SERVOS_RAD_S], [*SERVOS_RAD_S.values()])
        self._discretise(k["tau_ped"])

    def _behind(self, columns: list[int], rates_rad_s: list[float]) -> None:
        n, m = self.g.shape
        count, rates = len(columns), np.diag(rates_rad_s)
        driven = np.zeros((count, m))
        driven[np.arange(count), columns] = rates_rad_s
        f = np.block([[self.f, self.g[:, columns]], [np.zeros((count, n)), -rates]])
        c = np.hstack([self.c, self.d[:, columns]])
        g, d = np.vstack([self.g, driven]), self.d.copy()
        g[:n, columns], d[:, columns] = 0.0, 0.0
        self.f, self.g, self.c, self.d = f, g, c, d


def problem(seed: int) -> tuple[fid.StateSpaceModel, fid.FrequencyResponse]:
    """The published structure and the response of one set of sweeps, servos taken out."""
    vehicle = ServoVehicle(PUBLISHED)
    flown = [
        vehicle.fly(100 * seed + 10 * again + place, place, SAMPLES)
        for again in range(REPEATS)
        for place in range(len(INPUTS))
    ]
    records = [actuator_positions(each, SERVOS_RAD_S) for each in flown if each is not None]
    response = fid.estimate_response(
        records,
        inputs=INPUTS,
        outputs=OUTPUTS,
        estimator="instrument",
        band_rad_s=(0.5027, 26.0),
        n_omega=36,
        window_s=[25.0, 12.5, 5.0],
    )
    return fid.load_model("r50_hover").with_responses(*coherent(response)), response


def reached(
    model: fid.StateSpaceModel, response: fid.FrequencyResponse, values: dict[str, float]
) -> tuple[Array, Array, float, str]:
    """Values, standard errors, cost and end of a fit from some values."""
    fit = fid.identify(model.with_values(values), response)
    ends = [fit.parameters[name] for name in values]
    errors = [np.nan if each.stderr is None else each.stderr for each in ends]
    return (
        np.array([each.value for each in ends]),
        np.array(errors),
        fit.average_cost,
        str(fit.evidence.light),
    )


def start(seed: int, spread: float, names: list[str]) -> dict[str, float]:
    """Every true value, off by up to the spread."""
    r = np.random.default_rng(seed)
    return {name: PUBLISHED[name] * r.uniform(1.0 - spread, 1.0 + spread) for name in names}


def counted(
    runs: range, spread: float, flown: int, path: Path | None, show: Callable[[str], None]
) -> list[dict[str, object]]:
    """One line a start; those of the file are not made again."""
    known: dict[int, dict[str, object]] = {}
    for line in path.read_text().splitlines() if path is not None and path.exists() else ():
        item = json.loads(line)
        if (item["spread"], item["flown"]) == (spread, flown):
            known[item["start"]] = item
    wanted = [each for each in runs if each not in known]
    if not wanted:
        return [known[key] for key in sorted(known)]
    model, response = problem(flown)
    names = [p.name for p in model.parameters.free]
    best, errors, cost, light = reached(model, response, {n: PUBLISHED[n] for n in names})
    show(f"optimum of the truth: cost {cost:.6g}, {light}")
    for each in wanted:
        begun = time.process_time()
        try:
            found, _, own, light = reached(model, response, start(each, spread, names))
            far = float(np.nanmax(np.abs(found - best) / errors))
            there = own <= cost * (1.0 + SAME_COST) and (far <= SAME_ERRORS or own < cost)
            said = f"{'reached' if there else 'MISSED'}, cost {own:.6g}, {far:.3g} errors, {light}"
        except fid.FlightidError as error:
            there, said = False, f"MISSED, {error}"
        seconds = time.process_time() - begun
        known[each] = {
            "start": each, "spread": spread, "flown": flown, "reached": bool(there), "said": said,
            "seconds": seconds,
        }  # fmt: skip
        show(f"{each:4d} {said}, {seconds:.1f} s")
        if path is not None:
            with path.open("a") as file:
                file.write(json.dumps(known[each]) + "\n")
    return [known[key] for key in sorted(known)]


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--spread", type=float, default=0.5)
    parser.add_argument("--flown", type=int, default=0, help="seed of the flights")
    parser.add_argument("--keep", type=Path, help="file that starts are added to, and read from")
    asked = parser.parse_args()
    runs = range(asked.first_seed, asked.first_seed + asked.runs)
    ends = counted(
        runs, asked.spread, asked.flown, asked.keep, lambda line: print(line, flush=True)
    )
    there = sum(bool(each["reached"]) for each in ends)
    print(f"{there} of {len(ends)} starts within {asked.spread:.0%} reach the optimum of the truth")


if __name__ == "__main__":
    main()
