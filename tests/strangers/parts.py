"""Several flights of vehicles that are alike or not, and flights that change midway; SciPy's.

The truth of several flights is the mean vehicle of the fleet from which theirs are drawn; of one
flight it is that flight's own: nothing else is claimed for it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import chirp, lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial
from tests.strangers.output_error import COLOURS, STEP_S, TRUTH, Noise, model

SCATTER = 0.03
"""Relative deviation of each coefficient from flight to flight."""
DURATION_S = 30.0
SWEEP_S = 60.0
NOISE = 0.1
"""Of the output's deviation."""
ARX_TRUTH = {"a1": -0.9, "b1": 0.5}
Fit = Callable[[list[fid.Record]], fid.Fit]
Truth = dict[str, float]
Flight = Callable[[np.random.Generator, float], tuple[fid.Record, Truth]]


def drawn(random: np.random.Generator, scatter: float, truth: Truth) -> Truth:
    """One vehicle of the fleet."""
    return {name: v * (1.0 + scatter * random.standard_normal()) for name, v in truth.items()}


def response(inputs: noises.Array, rate: float, control: float, start: float) -> noises.Array:
    """Roll rate to inputs held between samples, exact by its discretisation."""
    decay = np.exp(rate * STEP_S)
    gain = control * (decay - 1.0) / rate
    return lfilter([0.0, gain], [1.0, -decay], inputs, zi=[start])[0]


def recorded(inputs: noises.Array, outputs: noises.Array) -> fid.Record:
    """One flight as a record."""
    return fid.Record.from_arrays(
        np.arange(inputs.size) * STEP_S,
        inputs={"da": inputs},
        outputs={"p": outputs},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


def stepped(random: np.random.Generator, n: int) -> noises.Array:
    """Steps of 0.6 s."""
    return 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30 + 1), 30)[:n]


def steps_flown(random: np.random.Generator, scatter: float) -> tuple[fid.Record, Truth]:
    """Steps flown by one vehicle of the fleet."""
    n = round(DURATION_S / STEP_S)
    inputs = stepped(random, n)
    vehicle = drawn(random, scatter, TRUTH)
    rate = response(inputs, *vehicle.values(), 0.0)
    return recorded(inputs, rate + NOISE * rate.std() * random.standard_normal(n)), vehicle


def quiet_tail(
    random: np.random.Generator, scatter: float, *, busy: float, noise: Noise
) -> tuple[fid.Record, Truth]:
    """Steps flown for a share of the record, nothing after it, under noise of some colour."""
    n = round(DURATION_S / STEP_S)
    inputs = stepped(random, n)
    inputs[round(busy * n) :] = 0.0
    vehicle = drawn(random, scatter, TRUTH)
    rate = response(inputs, *vehicle.values(), 0.0)
    return recorded(inputs, rate + NOISE * rate.std() * noise(random, n)), vehicle


def changed_midway(random: np.random.Generator, change: float) -> tuple[fid.Record, Truth]:
    """Steps flown by a vehicle whose coefficients move apart by `change` in mid-flight."""
    n = round(DURATION_S / STEP_S)
    inputs, half = stepped(random, n), n // 2
    low, high = ([v * (1.0 + sign * change / 2.0) for v in TRUTH.values()] for sign in (-1, 1))
    first = response(inputs[:half], *low, 0.0)
    # The filter's state is what the next sample gets of the last one.
    decay = np.exp(high[0] * STEP_S)
    carried = decay * first[-1] + high[1] * (decay - 1.0) / high[0] * inputs[half - 1]
    rate = np.concatenate([first, response(inputs[half:], *high, carried)])
    return recorded(inputs, rate + NOISE * rate.std() * random.standard_normal(n)), TRUTH


def sweep_flown(random: np.random.Generator, scatter: float) -> tuple[fid.Record, Truth]:
    """A smooth sweep, which samples hold well enough, flown by one vehicle of the fleet."""
    n = round(SWEEP_S / STEP_S)
    time_s = np.arange(n) * STEP_S
    inputs = 0.05 * chirp(time_s, 0.05, time_s[-1], 3.0, method="logarithmic")
    vehicle = drawn(random, scatter, TRUTH)
    rate = response(inputs, *vehicle.values(), 0.0)
    return recorded(inputs, rate + NOISE * rate.std() * random.standard_normal(n)), vehicle


def arx_flown(random: np.random.Generator, scatter: float) -> tuple[fid.Record, Truth]:
    """An equation with white noise in it, of one vehicle of the fleet."""
    n = round(DURATION_S / STEP_S)
    inputs = stepped(random, n)
    pole, _, driven = drawn(random, scatter, {"pole": 1.0 + ARX_TRUTH["a1"], **ARX_TRUTH}).values()
    drive = driven * np.concatenate([[0.0], inputs[:-1]]) + 0.005 * random.standard_normal(n)
    vehicle = {"a1": pole - 1.0, "b1": driven}
    return recorded(inputs, lfilter([1.0], [1.0, vehicle["a1"]], drive)), vehicle


def by_output_error(records: list[fid.Record]) -> fid.Fit:
    """All options at their defaults."""
    return fid.identify(model(), records, method="output_error", loop="open")


def by_response(records: list[fid.Record]) -> fid.Fit:
    """From a composite response, all options at their defaults."""
    return fid.identify(model(), fid.estimate_response(records, loop="open"), hold="zero")


def by_arx(records: list[fid.Record]) -> fid.Fit:
    """Regression of the right orders."""
    return fid.identify(fid.PolynomialModel.arx("da", "p", na=1, nb=1), records, loop="open")


def fly(seed: int, *, flight: Flight, count: int, scatter: float, fit: Fit, truth: Truth) -> Trial:
    """So many flights, fitted together."""
    random = np.random.default_rng(seed)
    flown = [flight(random, scatter) for _ in range(count)]
    records = [record for record, _ in flown]
    return fit_trial(lambda: fit(records), flown[0][1] if count == 1 else truth)


WAYS: dict[str, tuple[Flight, Fit, Truth]] = {
    "output error": (steps_flown, by_output_error, TRUTH),
    "frequency domain": (sweep_flown, by_response, TRUTH),
    "ARX": (arx_flown, by_arx, ARX_TRUTH),
}
FLEETS = tuple(
    Case(
        f"{name}, {count} flights, {100 * scatter:.0f} % apart",
        partial(fly, flight=flight, count=count, scatter=scatter, fit=fit, truth=truth),
    )
    for name, (flight, fit, truth) in WAYS.items()
    for scatter in (0.0, SCATTER)
    for count in (1, 2, 3, 8)
)
CHANGES = tuple(
    Case(
        f"output error, changed by {100 * change:.0f} % midway",
        partial(
            fly, flight=changed_midway, count=1, scatter=change, fit=by_output_error, truth=TRUTH
        ),
    )
    for change in (0.0, 0.2)
)
TAILS = tuple(
    Case(
        f"output error, quiet after {100 * busy:.0f} %, {name}",
        partial(
            fly,
            flight=partial(quiet_tail, busy=busy, noise=COLOURS[name]),
            count=1,
            scatter=0.0,
            fit=by_output_error,
            truth=TRUTH,
        ),
    )
    for busy in (1.0, 0.45, 0.2)
    for name in ("white", "AR(1) 0.9")
)
CASES = (*FLEETS, *CHANGES, *TAILS)
