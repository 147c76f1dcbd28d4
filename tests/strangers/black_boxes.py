"""Black boxes whose noise model is right or too small, or whose order is too high; SciPy's."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Reading, Trial, fit_trial

STEP_S = 0.1
SAMPLES = 800
A, B = [1.0, -1.5, 0.7], [0.0, 1.0, 0.5]
"""Of y = B/A u: a pole pair of size 0.84."""
GAIN = sum(B) / sum(A)
POLE = np.log(complex(np.roots(A)[0])) / STEP_S
MODE = {"frequency": abs(POLE), "damping": -POLE.real / abs(POLE), "gain": GAIN}
SHARE = 0.3
"""Noise over the output's deviation."""
Noise = Callable[[np.random.Generator, int], noises.Array]
WHITE = noises.white
RED: Noise = partial(noises.ar1, pole=0.9)
RESONANT: Noise = partial(noises.ar2, radius=0.95, angle=0.3)
P = fid.PolynomialModel


def steps(random: np.random.Generator, n: int = SAMPLES) -> noises.Array:
    """Levels of random size held for four samples."""
    return np.repeat(random.standard_normal(n // 4), 4)


def recorded(u: noises.Array, y: noises.Array) -> fid.Record:
    """One flight as a record."""
    time_s = np.arange(u.size) * STEP_S
    return fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")


def in_output(random: np.random.Generator, noise: Noise) -> fid.Record:
    """Noise of the sensor."""
    u = steps(random)
    y = lfilter(B, A, u)
    return recorded(u, y + SHARE * y.std() * noise(random, u.size))


def in_equation(random: np.random.Generator, noise: Noise) -> fid.Record:
    """Noise that drives the same poles as the input."""
    u = steps(random)
    return recorded(u, lfilter(B, A, u) + lfilter([1.0], A, 0.5 * noise(random, u.size)))


def under_control(random: np.random.Generator, noise: Noise) -> fid.Record:
    """Proportional feedback of the measured output, and steps on top of it."""
    r, v = steps(random), 0.5 * noise(random, SAMPLES)
    u, y, clean = np.zeros(SAMPLES), np.zeros(SAMPLES), np.zeros(SAMPLES)
    for t in range(SAMPLES):
        for k in (1, 2):
            if t >= k:
                clean[t] += B[k] * u[t - k] - A[k] * clean[t - k]
        y[t] = clean[t] + v[t]
        u[t] = r[t] - 0.1 * y[t]
    return recorded(u, y)


OTHER = [1.0, -1.2, 0.55]
"""Poles from a second input where they are not those of the first."""
SECOND = [0.0, 0.0, -2.0, 1.0]


def fly_two(seed: int, *, noise: Noise, structure: object, shared: bool) -> Trial:
    """Modes and gains of two inputs whose poles are the same or not; the choice is the data's."""
    random = np.random.default_rng(seed)
    below = A if shared else OTHER
    u, v = steps(random), np.repeat(random.standard_normal(SAMPLES // 5), 5)
    y = lfilter(B, A, u) + lfilter(SECOND, below, v)
    y += SHARE * y.std() * noise(random, SAMPLES)
    inputs, time_s = {"u": u, "v": v}, np.arange(SAMPLES) * STEP_S
    record = fid.Record.from_arrays(time_s, inputs=inputs, outputs={"y": y}, hold="zero")
    begun = time.perf_counter()
    try:
        fit = fid.identify(structure, record, loop="open")
    except fid.FlightidError as error:
        return Trial(refusal=str(error))
    seconds = time.perf_counter() - begun
    readings = [Reading("one denominator", shared, fit.model.denominators == "common")]
    for name, polynomial, above in (("u", A, B), ("v", below, SECOND)):
        pole = np.log(complex(np.roots(polynomial)[0])) / STEP_S
        readings.append(_reading(fit.details.gains[f"y/{name}"], sum(above) / sum(polynomial)))
        modes = [each for each in fit.details.modes if each.response == f"y/{name}"]
        for each in modes[:1]:
            readings.append(_reading(each.natural_frequency, abs(pole)))
            readings.append(_reading(each.damping, -pole.real / abs(pole)))
    return Trial(tuple(readings), str(fit.evidence.light), seconds)


def _reading(item: fid.Estimate, truth: float) -> Reading:
    return Reading(item.name.split(" at ")[0], truth, item.value, item.stderr, item.interval95)


Flight = Callable[[np.random.Generator], fid.Record]


def fly(
    seed: int,
    *,
    flight: Flight,
    structure: object,
    loop: str | None = None,
    truth: Mapping[str, float] = MODE,
) -> Trial:
    """Frequency, damping, gain and coefficients of a truth, all options at their defaults."""
    record = flight(np.random.default_rng(seed))
    found: list[fid.Fit] = []

    def fit() -> fid.Fit:
        found.append(fid.identify(structure, record, **({} if loop is None else {"loop": loop})))
        return found[0]

    trial = fit_trial(fit, {})
    if not found:
        return trial
    known = _mode(found[0], truth["frequency"]) | dict(found[0].parameters)
    readings = tuple(
        Reading(name, truth[name], item.value, item.stderr, item.interval95)
        for name, item in known.items()
        if name in truth
    )
    return Trial(readings, trial.light, trial.seconds, trial.refusal)


def _mode(fit: fid.Fit, frequency: float) -> dict[str, fid.Estimate]:
    """The mode nearest to the true one, and the gain."""
    gains = {"gain": fit.details.gains["y/u"]}
    modes = fit.details.modes
    if not modes:
        return gains
    best = min(modes, key=lambda each: abs(each.natural_frequency.value - frequency))
    return {"frequency": best.natural_frequency, "damping": best.damping, **gains}


NARX = {"y(t-1)": 0.7, "u(t-1)": 0.4, "u(t-1)^2": -0.3}


def fly_narx(seed: int, *, noise: Noise, at_sensor: bool) -> Trial:
    """A square in the input; weights in the channels' own units, choice apart from weights."""
    random = np.random.default_rng(seed)
    n = 2 * SAMPLES
    u, v, y = random.uniform(-1.0, 1.0, n), 0.1 * noise(random, n), np.zeros(n)
    for t in range(1, n):
        push = 0.0 if at_sensor else v[t]
        y[t] = 0.7 * y[t - 1] + 0.4 * u[t - 1] - 0.3 * u[t - 1] ** 2 + push
    record = recorded(u, y + v if at_sensor else y)
    structure = fid.NarxStructure(
        ("u",), "y", 1, 1, kernel=None, degree=2, stop="bic", held_back=0.5
    )
    scale = {name: float(np.std(record[name], ddof=1)) for name in ("u", "y")}
    mean = float(np.mean(u))
    truth = {
        "y(t-1)": NARX["y(t-1)"],
        "u(t-1)": (NARX["u(t-1)"] + 2.0 * NARX["u(t-1)^2"] * mean) * scale["u"] / scale["y"],
        "u(t-1)^2": NARX["u(t-1)^2"] * scale["u"] ** 2 / scale["y"],
    }
    return fit_trial(lambda: fid.identify(structure, record, loop="open"), truth)


def fly_impulse(seed: int, *, decay: float, noise: Noise, samples: int = 3000) -> Trial:
    """Pulse response of a mode whose size falls by `decay` a sample, 40 lags."""
    random = np.random.default_rng(seed)
    u = steps(random, samples) + 0.3 * random.standard_normal(samples)
    denominator = [1.0, -2.0 * decay * np.cos(0.15), decay**2]
    y = lfilter([0.0, 1.0], denominator, u)
    record = recorded(u, y + 0.1 * y.std() * noise(random, samples))
    pulse = lfilter([0.0, 1.0], denominator, np.eye(1, 40)[0])
    begun = time.perf_counter()
    try:
        found = fid.impulse_response(record)
    except fid.FlightidError as error:
        return Trial(refusal=str(error))
    seconds = time.perf_counter() - begun
    lags = range(0, 40, 3)
    if found.stderr is None:
        return Trial(
            tuple(Reading(f"lag {k}", pulse[k], found.values[0, k]) for k in lags), "amber", seconds
        )
    readings = []
    for k in lags:
        value, error = float(found.values[0, k]), float(found.stderr[0, k])
        readings.append(
            Reading(
                f"lag {k}", pulse[k], value, error, (value - 1.96 * error, value + 1.96 * error)
            )
        )
    return Trial(tuple(readings), "green", seconds)


ARX, ARMAX = P.arx("u", "y", na=2, nb=2), P.armax("u", "y", na=2, nb=2, nc=2)
BJ = P.bj("u", "y", nb=2, nc=0, nd=1, nf=2)
SUBSPACE = fid.InnovationsModel.subspace("u", "y", order=2)
HIGH = fid.InnovationsModel.subspace("u", "y", order=4)
BOXES: dict[str, tuple[object, Flight, str | None]] = {
    "arx, its own noise": (ARX, partial(in_equation, noise=WHITE), None),
    "arx, white noise of the sensor": (ARX, partial(in_output, noise=WHITE), None),
    "arx, AR(1) 0.9": (ARX, partial(in_output, noise=RED), None),
    "arx, AR(1) 0.9, loop closed": (ARX, partial(under_control, noise=RED), "closed"),
    "armax, white noise of the sensor": (ARMAX, partial(in_output, noise=WHITE), None),
    "armax, resonant": (ARMAX, partial(in_output, noise=RESONANT), None),
    "bj, AR(1) 0.9": (BJ, partial(in_output, noise=RED), None),
    "bj, resonant": (BJ, partial(in_output, noise=RESONANT), None),
    "bj, resonant, loop closed": (BJ, partial(under_control, noise=RESONANT), "closed"),
    "subspace, white noise of the sensor": (SUBSPACE, partial(in_output, noise=WHITE), None),
    "subspace, resonant": (SUBSPACE, partial(in_output, noise=RESONANT), None),
    "subspace, its own noise": (SUBSPACE, partial(in_equation, noise=WHITE), None),
    "subspace, order 4 of 2": (HIGH, partial(in_equation, noise=WHITE), None),
    "subspace, order 4 of 2, noise of the sensor": (HIGH, partial(in_output, noise=WHITE), None),
}
TWO = {"inputs": ("u", "v"), "outputs": "y", "nb": 2, "nf": 2, "nk": (1, 2)}
TWO_INPUTS: dict[str, tuple[object, Noise]] = {
    "oe, white": (P.oe(**TWO), WHITE),
    "oe, AR(1) 0.9": (P.oe(**TWO), RED),
    "bj, AR(1) 0.9": (P.bj(**TWO, nc=0, nd=1), RED),
}

CASES = (
    *(
        Case(
            f"{name}, {'common' if shared else 'separate'} poles of two inputs",
            partial(fly_two, noise=noise, structure=made, shared=shared),
        )
        for name, (made, noise) in TWO_INPUTS.items()
        for shared in (True, False)
    ),
    *(
        Case(f"black box, {name}", partial(fly, flight=flight, structure=made, loop=loop))
        for name, (made, flight, loop) in BOXES.items()
    ),
    Case("narx, white in the equation", partial(fly_narx, noise=WHITE, at_sensor=False)),
    Case("narx, AR(1) 0.9 in the equation", partial(fly_narx, noise=RED, at_sensor=False)),
    Case("narx, white noise of the sensor", partial(fly_narx, noise=WHITE, at_sensor=True)),
    Case("narx, AR(1) 0.9 of the sensor", partial(fly_narx, noise=RED, at_sensor=True)),
    *(
        Case(
            f"impulse response, decay {decay:g}, {name}",
            partial(fly_impulse, decay=decay, noise=noise),
        )
        for decay in (0.8, 0.95, 0.98, 0.997)
        for name, noise in (("white", WHITE), ("AR(1) 0.9", RED))
    ),
)
