"""One random verb on random records, and what may not come of it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from math import isfinite

import numpy as np

import flightid as fid
from tests.stress.records import Flights, flown

P = fid.PolynomialModel
Random = np.random.Generator
LOW = 4
"""Seeds in which one run is of a method that takes longer."""


def run(seed: int) -> str:
    """What came of one seed: the name of a result, or of a typed refusal.

    Raises
    ------
    AssertionError
        A standard error that is zero, infinite or NaN, or a result that JSON does not take.
    """
    random = np.random.default_rng(seed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            flights = flown(random)
            verb = VERBS[int(random.integers(len(VERBS)))]
            result = verb(random, flights)
            plain = result.to_dict()
    except fid.FlightidError as error:
        return type(error).__name__
    faults = list(bad_bars(plain))
    assert not faults, f"seed {seed}, {verb.__name__}, {flights.story}: {faults[:3]}"
    assert json.loads(json.dumps(plain, allow_nan=False)) == json.loads(json.dumps(plain))
    return verb.__name__


def bad_bars(node: object, path: str = "") -> Iterator[str]:
    """Places of standard errors that are not positive numbers, and of intervals without ends."""
    if isinstance(node, Mapping):
        for name, each in node.items():
            here = f"{path}/{name}"
            if name == "stderr":
                yield from (f"{here} {bar}" for bar in _numbers(each) if not 0.0 < bar < np.inf)
            elif name == "interval95" and each is not None:
                yield from (f"{here} {end}" for end in _numbers(each) if not isfinite(end))
            else:
                yield from bad_bars(each, here)
    elif isinstance(node, list | tuple):
        for place, each in enumerate(node):
            yield from bad_bars(each, f"{path}/{place}")


def _numbers(node: object) -> Iterator[float]:
    if isinstance(node, list | tuple):
        for each in node:
            yield from _numbers(each)
    elif isinstance(node, int | float):
        yield float(node)


def polynomial(random: Random, flights: Flights) -> fid.Fit:
    """ARX to Box-Jenkins of small orders."""
    na, nb, nc = (int(n) for n in random.integers(1, 4, 3))
    output = flights.outputs[0]
    made = (
        lambda: P.arx(flights.inputs, output, na=na, nb=nb),
        lambda: P.armax(flights.inputs, output, na=na, nb=nb, nc=nc),
        lambda: P.oe(flights.inputs, output, nb=nb, nf=na),
        lambda: P.bj(flights.inputs, output, nb=nb, nc=nc, nd=na, nf=na),
    )[int(random.choice(4, p=[0.7, 0.1, 0.1, 0.1]))]()
    return fid.identify(made, flights.records, loop="open")


def pulse(random: Random, flights: Flights) -> fid.ImpulseResponse:
    """Pulse response of few lags."""
    lags = int(random.integers(1, 12))
    return fid.impulse_response(flights.records, outputs=flights.outputs[0], n_lags=lags)


def narx(random: Random, flights: Flights) -> fid.Fit:
    """Polynomial NARX."""
    structure = fid.NarxStructure(
        flights.inputs, flights.outputs[0], 1, 1, kernel=None, degree=int(random.integers(1, 3))
    )
    return fid.identify(structure, flights.records, loop="open")


def subspace(random: Random, flights: Flights) -> fid.Fit:
    """Subspace of any order."""
    structure = fid.InnovationsModel.subspace(
        flights.inputs, flights.outputs, order=int(random.integers(1, 5))
    )
    return fid.identify(structure, flights.records, loop="open")


def response(random: Random, flights: Flights) -> fid.FrequencyResponse:
    """A frequency response by any estimator."""
    estimator = str(random.choice(["composite", "local_polynomial"]))
    return fid.estimate_response(flights.records, estimator=estimator)


def grey(random: Random, flights: Flights) -> fid.Fit:
    """A chain of lags, one output of each, by any method for records."""
    order = min(int(random.integers(1, 7)), 2 if len(flights.outputs) < 3 else 6)
    states = {f"x{k}": "1" for k in range(order)}
    equations = {"x0'": "a0*x0 + " + " + ".join(f"b*{name}" for name in flights.inputs)}
    equations |= {f"x{k}'": f"a{k}*x{k} + x{k - 1}" for k in range(1, order)}
    outputs = {name: fid.Output(f"c*x{k % order}", "1") for k, name in enumerate(flights.outputs)}
    parameters = [fid.Parameter(f"a{k}", -1.0 - k, "1/s") for k in range(order)]
    parameters += [fid.Parameter("b", 1.0, "1/s"), fid.Parameter("c", 1.0, "1", free=False)]
    model = fid.StateSpaceModel(
        states=states,
        input_units=dict.fromkeys(flights.inputs, "1"),
        measurements=outputs,
        equations=equations,
        parameters=fid.Parameters(parameters),
    )
    method = str(
        random.choice(["output_error", "fourier_output_error", "filter_error"], p=[0.8, 0.15, 0.05])
    )
    return fid.identify(model, flights.records, method=method, maximum_iterations=8)


Verb = Callable[[Random, Flights], fid.Fit | fid.ImpulseResponse | fid.FrequencyResponse]
QUICK: tuple[Verb, ...] = (polynomial, pulse, narx)
VERBS: tuple[Verb, ...] = (*QUICK * LOW, subspace, response, grey)
