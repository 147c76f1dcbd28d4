"""Rigs that SciPy simulates, as CSV through `flightid run RECORDS`: the light of what it gives.

Sound: loop open, an input of a kind that is taught, noise of 1 to 20 % of the output. Barren:
records in which nothing of the rig can be known, or whose input a loop gives. The reasons of every
light: `python -m tests.strangers.rig_lights sound --runs 40`.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import chirp, cont2discrete, lfilter, max_len_seq, zpk2tf

import flightid as fid
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence import Evidence
from flightid.findings import Finding
from flightid.study.identified import ModelResults
from flightid.study.pipeline import identify_models
from flightid.study.proposal.propose import propose_study
from flightid.study.settings import read_settings
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.task import load_task
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

Array = NDArray[np.float64]
Columns = dict[str, Array]
STEP_S = 0.02
INPUTS = ("prbs", "sweep", "3-2-1-1", "multisine")


class Rig:
    """A plant of order 1 to 3 with a delay, drawn by a seed; gain 1 to 5."""

    def __init__(self, random: np.random.Generator) -> None:
        self.order = int(random.integers(1, 4))
        self.omega = float(random.uniform(2.0, 8.0))
        damping = float(random.uniform(0.2, 0.9))
        pair = self.omega * np.array(
            [-damping + 1j * np.sqrt(1 - damping**2), -damping - 1j * np.sqrt(1 - damping**2)]
        )
        lag = [-self.omega * float(random.uniform(0.6, 2.0))]
        poles = {1: lag, 2: [*pair], 3: [*pair, *lag]}[self.order]
        gain = float(random.uniform(1.0, 5.0)) * float(np.abs(np.prod(poles)))
        b, self.a, _ = cont2discrete(zpk2tf([], poles, gain), STEP_S, "zoh")
        self.delay = int(random.integers(0, 5))
        self.b = np.concatenate([np.zeros(self.delay), np.ravel(b)])

    def answer(self, u: Array) -> Array:
        """What it does, without noise."""
        return np.asarray(lfilter(self.b, self.a, u))


def injected(random: np.random.Generator, kind: str, n: int, omega: float) -> Array:
    """An input that excites a decade about a frequency, or nearly."""
    time_s = np.arange(n) * STEP_S
    if kind == "prbs":
        held = max(round(0.5 / omega / STEP_S), 1)
        levels = max_len_seq(10, state=random.integers(0, 2, 10) | np.eye(1, 10, dtype=int)[0])[0]
        return np.resize(np.repeat(2.0 * levels - 1.0, held), n)
    if kind == "sweep":
        return np.asarray(
            chirp(time_s, omega / 10 / 6.28, time_s[-1], 4 * omega / 6.28, "logarithmic", phi=-90)
        )
    if kind == "3-2-1-1":
        unit = max(round(0.8 / omega / STEP_S), 2)
        shape = np.repeat([1, 1, 1, -1, -1, 1, -1, 0, 0, 0, 0], unit)
        parts = [float(random.choice([-1, 1]) * random.uniform(0.5, 1)) * shape for _ in range(99)]
        return np.asarray(np.resize(np.concatenate(parts), n), dtype=np.float64)
    tones = np.geomspace(omega / 8, 4 * omega, 15)
    phases = random.uniform(0, 2 * np.pi, tones.size)
    return np.asarray(np.sum(np.sin(np.outer(time_s, tones) + phases), axis=1) / 4.0)


def noise(random: np.random.Generator, n: int, size: float) -> Array:
    """White, or coloured with a time constant of ten samples."""
    coloured = random.random() < 0.3
    made = noises.ar1(random, n, 0.9) if coloured else random.standard_normal(n)
    return size * made / float(np.std(made))


def sound(random: np.random.Generator, *, kind: str) -> Columns:
    """A rig moved well, with a sensor of 1 to 20 % noise."""
    n = int(random.integers(1500, 3000))
    rig = Rig(random)
    u = injected(random, kind, n, rig.omega)
    y = rig.answer(u)
    level = float(np.exp(random.uniform(np.log(0.01), np.log(0.2))))
    return {"u": u, "y": y + noise(random, n, level * float(np.std(y)))}


def loop(random: np.random.Generator, *, moved: float) -> Columns:
    """A proportional loop that answers disturbances of the output, with or without injection."""
    n, rig = 2000, Rig(random)
    r = moved * injected(random, "prbs", n, rig.omega)
    shaken = noise(random, n, 1.0)
    gain = 0.25 / float(np.sum(rig.b) / np.sum(rig.a))
    u, y = np.zeros(n), np.zeros(n)
    b, a = np.concatenate([rig.b, [0.0]]), rig.a
    clean = np.zeros(n)
    for k in range(n):
        past = sum(b[i] * u[k - i] for i in range(1, b.size) if k >= i)
        clean[k] = past - sum(a[i] * clean[k - i] for i in range(1, a.size) if k >= i)
        y[k] = clean[k] + shaken[k]
        u[k] = r[k] - gain * y[k]
    return {"u": u, "y": y}


def spoiled(random: np.random.Generator, *, how: str) -> Columns:
    """A record that was sound until something happened to it."""
    good = sound(random, kind=str(random.choice(INPUTS)))
    u, y = good["u"], good["y"].copy()
    n, size = y.size, float(np.std(y))
    if how == "unrelated":
        y = noise(random, n, size)
    elif how == "buried":
        y = y + noise(random, n, 8.0 * size)
    elif how == "spikes":
        y[random.choice(n, 3, replace=False)] += 40.0 * size
    elif how == "dead sensor":
        start = int(random.integers(n // 4, n // 2))
        y[start : start + n // 5] = y[start]
    elif how == "cut":
        start = int(random.integers(0, n - 60))
        u, y = u[start : start + 60], y[start : start + 60]
    elif how == "drift":
        y = y + 10.0 * size * np.cumsum(random.standard_normal(n)) / np.sqrt(n)
    return {"u": u, "y": y}


MEASURES = {
    "NEGLIGIBLE_PERCENT": r"worth ([\d.e+-]+) %",
    "WELL_TOLD": r"up to ([\d.e+-]+) times those of white",
    "PEAK_PERCENT": r"differ there by ([\d.e+-]+) %",
}
"""What is said of quantities that thresholds weigh."""


@dataclass(frozen=True)
class Judged:
    """One model of a run: its light, what is not green of it, and what that measures."""

    light: Light
    findings: tuple[Finding, ...] = ()
    measured: dict[str, float] = field(default_factory=dict)


def found_by_run(columns: Columns) -> tuple[Judged, ...]:
    """Every model of `flightid run rig.csv`: a linear one may stand beside a NARX model."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table = np.column_stack([np.arange(columns["y"].size) * STEP_S, columns["u"], columns["y"]])
        path = folder / "rig.csv"
        np.savetxt(path, table, "%.7g", ",", header="time [s],u,y", comments="")
        made = propose_study([path], folder=folder, inputs=["u"], outputs=["y"])
        if not made.models:
            return (Judged(Light.RED, made.findings),)
        settings = read_settings(made.write(folder / "study.toml"))
        tasks, runner = [load_task(each) for each in settings.models], StageRunner(None)
        records = take(settings, tasks, None, folder, runner).records
        staged = identify_models(tasks, records, None, settings.reduce, runner, lambda *_: None)
    return tuple(_judged(each.value) for each in staged)


def _judged(item: ModelResults) -> Judged:
    if item.fit is None:
        return Judged(Light.RED, item.findings)
    evidence = item.fit.evidence
    return Judged(
        evidence.light,
        tuple(each for each in evidence.findings if each.light is not Light.GREEN),
        measures(evidence, item.findings),
    )


def measures(evidence: Evidence, findings: Iterable[Finding]) -> dict[str, float]:
    """The largest of each measure that findings tell, and the band's ratio; absent: below it."""
    said = "; ".join(each.message for each in findings)
    found = {
        name: max(map(float, re.findall(form, said)))
        for name, form in MEASURES.items()
        if re.search(form, said)
    }
    band = evidence.band_rad_s
    return found | {"BAND_LEAST": 1.0 if band is None else band[1] / band[0]}


def flown(
    seed: int, *, columns: Callable[[np.random.Generator], Columns], barren: bool = False
) -> Trial:
    """One record through `run`: its worst light, of a barren one the best that any model has."""
    begun = time.perf_counter()
    try:
        judged = found_by_run(columns(np.random.default_rng([seed, 1212])))
        light = (min if barren else max)((each.light for each in judged), key=[*Light].index)
    except FlightidError as error:
        return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    return Trial((), str(light), time.perf_counter() - begun)


def in_slow_noise(seed: int) -> Trial:
    """Output error's coefficients of a rig of its own order, a multisine and AR(1) 0.98 noise."""
    random = np.random.default_rng([seed, 1225])
    rig = Rig(random)
    u = injected(random, "multisine", 2000, rig.omega)
    y = rig.answer(u)
    y = y + 0.2 * y.std() * noises.ar1(random, y.size, 0.98)
    n = rig.order
    asked = fid.PolynomialModel.oe("u", "y", nb=n, nf=n, nk=rig.delay + 1)
    truth = dict(zip(asked.names, [*rig.b[rig.delay + 1 :], *rig.a[1:]], strict=True))
    time_s = np.arange(y.size) * STEP_S
    record = fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")
    return fit_trial(lambda: fid.identify(asked, record, loop="open"), truth)


CASES = (Case("output error of rigs, multisine, AR(1) 0.98", in_slow_noise),)
SOUND = {kind: partial(sound, kind=kind) for kind in INPUTS}
BARREN: dict[str, Callable[[np.random.Generator], Columns]] = {
    "loop, no injection": partial(loop, moved=0.0),
    "loop, injection not logged": partial(loop, moved=0.5),
    **{
        how: partial(spoiled, how=how)
        for how in ("unrelated", "buried", "spikes", "dead sensor", "cut", "drift")
    },
}
LIGHTS = tuple(
    Case(f"{group}, run, {name}", partial(flown, columns=made, barren=group == "barren"))
    for group, rows in (("sound", SOUND), ("barren", BARREN))
    for name, made in rows.items()
)


def main() -> None:
    """Print the light and the reasons of each record, and how often each reason came."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("group", choices=("sound", "barren"))
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    rows = {"sound": SOUND, "barren": BARREN}[asked.group]
    names = [name for name in rows if asked.only in name]
    lights: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for seed in range(asked.first_seed, asked.first_seed + asked.runs):
        name = names[seed % len(names)]
        try:
            models = found_by_run(rows[name](np.random.default_rng([seed, 1212])))
        except FlightidError as error:
            models = (Judged(Light.RED, (Finding("refused", Light.RED, str(error)),)),)
        for model in models:
            lights[str(model.light)] += 1
            reasons.update(f"{each.light} {each.code}" for each in model.findings)
            print(f"{seed:4d} {name:28s} {model.light} {model.measured}", flush=True)
            for each in model.findings:
                print(f"      [{each.light}] {each.code}: {each.message}", flush=True)
    print(dict(lights))
    for reason, count in reasons.most_common():
        print(f"{count:4d} {reason}")


if __name__ == "__main__":
    main()
