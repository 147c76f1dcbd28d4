"""Verbs as their users call them, intervals and evidence included: processor time and peak memory.

Each line runs in a process of its own, in turn with a yardstick of NumPy and SciPy alone. Their
ratio holds on any machine; `history.json` keeps it, and a check compares by it.

Run: python -m benchmarks verbs            the table beside what was kept
     python -m benchmarks.verbs --check    1 where a line is worse by more than a quarter
     python -m benchmarks.verbs --keep     keep today's ratios; with names of lines, theirs alone
     python -m benchmarks.verbs --beside SRC    in turn with another tree's package, built, in SRC
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from statistics import median

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from benchmarks import (
    nonlinear_output_error,
    output_error,
    polynomial,
    responses,
    state_space_fit,
    subspace,
)
from flightid.table import Cell, Column, Table

HISTORY = Path(__file__).with_name("history.json")
WORSE = 1.25
"""Ratio to what was kept above which a line is worse: twice what repeats differ by."""
REPEATS, SECONDS = 7, 4.0
EVIDENCE = "--evidence"
HERE = str(Path(fid.__file__).parents[1])
Work = Callable[[], object]


def _linear(n_samples: int, **options: object) -> Work:
    output_error.N = n_samples
    record, model = output_error.two_rates_record(), output_error.two_rates()
    return lambda: fid.identify(model, record, **options)


def _pitch() -> Work:
    """Nonlinear pitch in gusts, 4 records of 30 s at 50 Hz."""
    values = {"Za": -1.2, "Ma": -6.0, "Maa": -60.0, "Mq": -1.8, "Md": -9.0}
    units = dict(zip(values, ("1/s", "1/s^2", "1/s^2", "1/s", "1/s^2"), strict=True))
    model = fid.StateSpaceModel(
        states={"alpha": "rad", "q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"alpha": fid.Output("alpha", "rad"), "q": fid.Output("q", "rad/s")},
        equations={"alpha'": "Za*alpha + q", "q'": "Ma*alpha + Maa*alpha^3 + Mq*q + Md*de"},
        parameters=fid.Parameters(
            [fid.Parameter(name, 0.7 * values[name], units[name]) for name in values]
        ),
    )
    random, records = np.random.default_rng(0), []
    for _ in range(4):
        steps = 0.25 * np.repeat(random.choice([-1.0, 0.0, 1.0], 50), 30)
        kicks = random.standard_normal((1500, 2)) * np.array([0.02, 0.2]) * np.sqrt(0.02)
        path, (alpha, q) = np.empty((2, 1500)), (0.0, 0.0)
        for k in range(1500):
            path[:, k] = alpha, q
            for _ in range(10):
                turn = values["Ma"] * alpha + values["Maa"] * alpha**3 + values["Mq"] * q
                rates = values["Za"] * alpha + q, turn + values["Md"] * steps[k]
                alpha, q = alpha + 0.002 * rates[0], q + 0.002 * rates[1]
            alpha, q = alpha + kicks[k, 0], q + kicks[k, 1]
        seen = path + np.array([[0.004], [0.01]]) * random.standard_normal((2, 1500))
        record = fid.Record.from_arrays(
            np.arange(1500) * 0.02,
            inputs={"de": steps},
            outputs={"alpha": seen[0], "q": seen[1]},
            units={"de": "rad", "alpha": "rad", "q": "rad/s"},
            hold="zero",
            loop="open",
        )
        records.append(record)
    return lambda: fid.identify(model, records, method="filter_error")


def _quadrotor() -> Work:
    """Nonlinear quadrotor, 11 parameters, 60 s at 100 Hz, starts and biases free."""
    model = fid.load_model("quadrotor_6dof").with_fixed(tau_d=0.0)
    random, inputs = np.random.default_rng(0), nonlinear_output_error.quadrotor_inputs()
    time_s = np.arange(inputs.shape[1]) * nonlinear_output_error.SAMPLE_S
    driven = dict(zip(model.inputs, inputs, strict=True))
    units = {name: model.units[name] for name in model.inputs}
    flown = fid.simulate(model, fid.Record.from_arrays(time_s, inputs=driven, units=units))
    outputs = {
        name: flown[name] + 0.01 * np.std(flown[name]) * random.standard_normal(len(time_s))
        for name in model.outputs
    }
    record = fid.Record.from_arrays(
        time_s, inputs=driven, outputs=outputs, units=model.units, hold="first", loop="open"
    )
    start = model.with_values(
        {p.name: random.uniform(0.8, 1.2) * float(p.value or 0.0) for p in model.parameters.free}
    )
    return lambda: fid.identify(start, record, method="output_error")


def _orders(n_samples: int) -> Work:
    record = subspace.flown(1, n_samples)
    structure = fid.InnovationsModel.subspace("u", "y", offsets="none")
    return lambda: fid.identify(structure, record)


def _pulses() -> Work:
    record = subspace.flown(1, 10_000)
    return lambda: fid.impulse_response(record)


def _box_jenkins() -> Work:
    record = polynomial.flown(0, 4000)
    structure = fid.PolynomialModel.bj("u", "y", nb=3, nc=2, nd=2, nf=3, nk=0)
    return lambda: fid.identify(structure, record)


def _responses() -> Work:
    """4 x 9 responses of 12 records, 5 windows, 200 frequencies: records nobody has looked at."""
    records = responses.flights(responses.make_samples())
    return lambda: responses.estimate([each.replace() for each in records])


def _response_fit(n_omega: int) -> Work:
    case = state_space_fit.make_case(state_space_fit.NOISE, seed=0, spread=0.2)
    model, data = case.begun, case.responses
    return lambda: fid.identify(model, data, n_omega=n_omega)


def _redrawn() -> tuple[fid.StateSpaceModel, list[fid.FrequencyResponse]]:
    """A fitted model, and other data of the same structure."""
    case = state_space_fit.make_case(state_space_fit.NOISE, seed=0, spread=0.2)
    model = fid.identify(case.begun, case.responses).model
    return model, [
        state_space_fit.make_case(state_space_fit.NOISE, k, 0.2).responses for k in range(20)
    ]


def _refit() -> Work:
    """The same structure, other data, from the fit at hand."""
    model, drawn = _redrawn()
    data = cycle(drawn)
    return lambda: fid.identify(model, next(data))


def _refits() -> Work:
    """Twenty of them in one call; a thousand take fifty times as long."""
    model, drawn = _redrawn()
    return lambda: fid.identify_each(model, drawn)


def _live(*, with_fit: bool) -> Work:
    """What a page does when its band is moved, over the same record."""
    output_error.N = 13_000
    record, bands = output_error.two_rates_record(), cycle([(0.5, 12.0), (0.6, 11.0), (0.7, 10.0)])
    pairs = [f"{output}/{source}" for output in "pr" for source in ("aileron", "rudder")]
    model = output_error.two_rates().with_responses(*pairs)

    def moved() -> object:
        response = fid.estimate_response(record, band_rad_s=next(bands))
        return fid.identify(model, response) if with_fit else response

    return moved


REST = {"initial_state": "trim", "output_bias": False}
LINES: dict[str, Callable[[], Work]] = {
    "output error, 130 s, 8 parameters": lambda: _linear(13_000, **REST),
    "output error, 20 starts": lambda: _linear(13_000, starts=20, **REST),
    "output error, 10⁶ samples": lambda: _linear(1_000_000, **REST),
    "responses 4 × 9, 12 records": _responses,
    "response fit, 13 states, 40 parameters": lambda: _response_fit(20),
    "refit of that to other data": _refit,
    "20 such refits in one call": _refits,
    "response fit, all 60 frequencies": lambda: _response_fit(60),
    "band moved, response": lambda: _live(with_fit=False),
    "band moved, response and fit": lambda: _live(with_fit=True),
    "equation error, 130 s": lambda: _linear(13_000, method="equation_error"),
    "filter error, 130 s": lambda: _linear(13_000, method="filter_error"),
    "filter error, nonlinear, 4 × 30 s": _pitch,
    "output error, nonlinear, 16 states, 60 s": _quadrotor,
    "output error, 60 s, starts and biases": lambda: _linear(6000),
    "subspace with order search, 10⁴": lambda: _orders(10_000),
    "subspace with order search, 10⁵": lambda: _orders(100_000),
    "subspace with order search, 10⁶": lambda: _orders(1_000_000),
    "pulse response, 10⁴": _pulses,
    "Box–Jenkins, 4000 samples": _box_jenkins,
}


def _yardstick() -> object:
    """Work of the same kinds by NumPy and SciPy alone: factors, filters, and an interpreter."""
    random = np.random.default_rng(0)
    np.linalg.qr(random.standard_normal((4000, 60)), mode="r")
    lfilter([1.0], [1.0, -0.9], random.standard_normal(200_000))
    return sum(k * k for k in range(50_000))


def _taken(work: Work) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _with_evidence(work: Work) -> Work:
    """Work and the evidence of all that it gives, which a fit gathers once somebody asks for it."""

    def asked() -> object:
        found = work()
        for each in found if isinstance(found, Sequence) else (found,):
            getattr(each, "evidence", None)
        return found

    return asked


def measured(name: str, *, evidence: bool = False) -> dict[str, float]:
    """Processor seconds of one line, its ratio to the yardstick, and its peak memory in MB."""
    work = _with_evidence(LINES[name]()) if evidence else LINES[name]()
    work(), _yardstick()
    pairs: list[tuple[float, float]] = []
    while len(pairs) < 2 or (len(pairs) < REPEATS and sum(map(sum, pairs)) < SECONDS):
        pairs.append((_taken(work), _taken(_yardstick)))
    return {
        "seconds": median(each for each, _ in pairs),
        "ratio": median(each for each, _ in pairs) / median(each for _, each in pairs),
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def _apart(name: str, source: str = "") -> dict[str, float]:
    """One line in a process of its own, by the package in a folder or that at hand."""
    command = [sys.executable, "-m", "benchmarks.verbs", name, *([EVIDENCE] if source else [])]
    around = os.environ | ({"PYTHONPATH": source} if source else {})
    found = subprocess.run(command, check=True, capture_output=True, text=True, env=around).stdout
    return dict(json.loads(found))


def _history() -> dict[str, dict[str, float]]:
    return dict(json.loads(HISTORY.read_text())) if HISTORY.exists() else {}


def compared(names: Sequence[str]) -> tuple[dict[str, dict[str, float]], Table]:
    """What lines take today, and the table of it beside what was kept."""
    kept = _history()
    today = {name: _apart(name) for name in names}
    rows = []
    for name, now in today.items():
        was = kept.get(name)
        rows.append(
            (
                name,
                1e3 * now["seconds"],
                now["ratio"],
                None if was is None else now["ratio"] / was["ratio"],
                now["megabytes"],
                None if was is None else now["megabytes"] / was["megabytes"],
            )
        )
    columns = (
        Column("verb"),
        Column("processor time", "ms", 4),
        Column("over the yardstick", digits=4),
        Column("over history", digits=3),
        Column("peak memory", "MB", 4),
        Column("over history", digits=3),
    )
    return today, Table("Verbs with intervals and evidence", columns, tuple(rows))


def beside(source: str, names: Sequence[str]) -> Table:
    """Lines of this tree and of another in turn, with evidence: that, this, this, that.

    Parameters
    ----------
    source : str
        Folder that holds the other tree's package with its native half.
    names : sequence of str
        Lines; of those that the other tree cannot run the row says so.
    """
    rows: list[tuple[Cell, ...]] = []
    for name in names:
        try:
            turns = [_apart(name, each) for each in (source, HERE, HERE, source)]
        except subprocess.CalledProcessError as error:
            rows.append((name, None, None, None, error.stderr.strip().splitlines()[-1]))
            continue
        was, now = ([turns[i]["ratio"] for i in pair] for pair in ((0, 3), (1, 2)))
        seconds = 1e3 * min(turns[i]["seconds"] for i in (1, 2))
        scatter = max(max(pair) / min(pair) for pair in (was, now))
        rows.append((name, seconds, sum(now) / sum(was), scatter, ""))
    columns = (
        Column("verb"),
        Column("processor time", "ms", 4),
        Column("over the other tree", digits=3),
        Column("turns apart by", digits=3),
        Column("note"),
    )
    return Table(f"Verbs beside those of {source}", columns, tuple(rows))


def run() -> Table:
    """The table alone."""
    return compared(list(LINES))[1]


def main(arguments: list[str]) -> int:
    """One line as JSON, or all of them kept or checked."""
    if arguments and arguments[0] in LINES:
        print(json.dumps(measured(arguments[0], evidence=EVIDENCE in arguments)))
        return 0
    if arguments[:1] == ["--beside"]:
        print(beside(arguments[1], arguments[2:] or list(LINES)))
        return 0
    option, names = arguments[:1], arguments[1:] or list(LINES)
    today, table = compared(names)
    print(table)
    if option == ["--keep"]:
        text = json.dumps(_history() | today, indent=1, ensure_ascii=False)
        HISTORY.write_text(text + "\n")
    worse = [row[0] for row in table.rows if max(row[3] or 0.0, row[5] or 0.0) > WORSE]
    for name in worse:
        print(f"worse than kept by more than a quarter: {name}")
    return 1 if worse and option == ["--check"] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
