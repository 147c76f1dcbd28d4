"""Longitudinal flights of an aircraft that starts off trim; NumPy's own Runge-Kutta integrates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import cos, sin

import numpy as np

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S = 0.02
GRAVITY, DENSITY, AREA, CHORD = 9.81, 1.0, 16.0, 1.5
MASS, INERTIA = 1200.0, 1800.0
TRUTH = {
    "CD0": 0.03, "CL0": 0.25, "CLa": 5.0, "Cm0": 0.04, "Cma": -0.8, "Cmq": -14.0, "Cmde": -1.3,
}  # fmt: skip
DRAG_OF_LIFT = 0.05
Point = tuple[float, ...]
STATES = {"V": "m/s", "alpha": "rad", "theta": "rad", "q": "rad/s"}
NOISE = {"V": 0.2, "alpha": 0.003, "theta": 0.003, "q": 0.005}
EQUATIONS = {
    "V'": "-qbar*S*CD/m + T*cos(alpha)/m - g*sin(theta - alpha)",
    "alpha'": "q - qbar*S*CL/(m*V) - T*sin(alpha)/(m*V) + g*cos(theta - alpha)/V",
    "theta'": "q",
    "q'": "qbar*S*c*Cm/Iy",
}
DEFINITIONS = {
    "qbar": ("0.5*rho*V**2", "Pa"),
    "CL": ("CL0 + CLa*alpha", "1"),
    "CD": ("CD0 + K*CL**2", "1"),
    "Cm": ("Cm0 + Cma*alpha + Cmq*q*c/(2*V) + Cmde*de", "1"),
}


@dataclass(frozen=True)
class Flight:
    """One manoeuvre: where it starts, what it weighs, what the air does.

    `gust_m_s` is the deviation of a vertical Dryden gust; `others` replaces coefficients.
    """

    seed: int
    duration_s: float = 20.0
    start: Point = (48.0, 0.08, 0.05, 0.02)
    mass: float = MASS
    gust_m_s: float = 0.0
    others: Mapping[str, float] = field(default_factory=dict)


def flown(flight: Flight) -> fid.Record:
    """Elevator pulses held between samples, and measured states with white noise."""
    random = np.random.default_rng(flight.seed)
    n = round(flight.duration_s / STEP_S)
    pulses = np.repeat(random.choice([-1.0, 0.0, 1.0], n // 25 + 1), 25)[:n]
    elevator = -0.02 + 0.03 * pulses
    thrust = np.full(n, 1400.0) + 200.0 * np.repeat(random.choice([-1, 1], n // 250 + 1), 250)[:n]
    gust = np.zeros(n)
    if flight.gust_m_s:
        gust = noises.dryden_vertical(random, n, STEP_S, flight.gust_m_s, 3.0)
    state = flight.start
    path = np.empty((n, 4))
    for place in range(n):
        path[place] = state
        now = (float(elevator[place]), float(thrust[place]), float(gust[place]))
        state = _advanced(state, now, flight)
    columns = dict(zip(STATES, path.T, strict=True))
    seen = {k: v + NOISE[k] * random.standard_normal(n) for k, v in columns.items()}
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"de": elevator, "T": thrust},
        outputs=seen,
        units={"de": "rad", "T": "N", **STATES},
        hold="zero",
        name=f"flight {flight.seed}",
    )


def _advanced(state: Point, now: tuple[float, float, float], flight: Flight) -> Point:
    one = _rates(state, now, flight)
    two = _rates(_moved(state, one, 0.5 * STEP_S), now, flight)
    three = _rates(_moved(state, two, 0.5 * STEP_S), now, flight)
    four = _rates(_moved(state, three, STEP_S), now, flight)
    slope = [a + 2.0 * (b + c) + d for a, b, c, d in zip(one, two, three, four, strict=True)]
    return _moved(state, slope, STEP_S / 6.0)


def _moved(state: Point, slope: Sequence[float], step: float) -> Point:
    return tuple(x + step * rate for x, rate in zip(state, slope, strict=True))


def _rates(state: Point, now: tuple[float, float, float], flight: Flight) -> Point:
    """Forces and moments about the centre of mass, the wind's part in the angle of attack."""
    true = {**TRUTH, **flight.others}
    speed, alpha, theta, rate = state
    elevator, thrust, gust = now
    felt = alpha + gust / speed
    lift = true["CL0"] + true["CLa"] * felt
    drag = true["CD0"] + DRAG_OF_LIFT * lift**2
    pitch = true["Cm0"] + true["Cma"] * felt + true["Cmde"] * elevator
    pitch += true["Cmq"] * rate * CHORD / (2.0 * speed)
    pressure = 0.5 * DENSITY * speed**2
    force, pull, climb = pressure * AREA / flight.mass, thrust / flight.mass, theta - alpha
    turning = (pull * sin(alpha) + force * lift - GRAVITY * cos(climb)) / speed
    return (
        pull * cos(alpha) - force * drag - GRAVITY * sin(climb),
        rate - turning,
        rate,
        pressure * AREA * CHORD * pitch / INERTIA,
    )


def model(**constants: float) -> fid.StateSpaceModel:
    """The aircraft's own equations, every coefficient half off or a fifth; no trim is declared."""
    known = {
        "rho": (DENSITY, "kg/m^3"), "S": (AREA, "m^2"), "c": (CHORD, "m"), "m": (MASS, "kg"),
        "Iy": (INERTIA, "kg*m^2"), "g": (GRAVITY, "m/s^2"), "K": (DRAG_OF_LIFT, "1"),
    }  # fmt: skip
    fixed = [
        fid.Parameter(name, constants.get(name, value), unit, free=False)
        for name, (value, unit) in known.items()
    ]
    free = [fid.Parameter(name, 0.8 * value, "1") for name, value in TRUTH.items()]
    return fid.StateSpaceModel(
        states=STATES,
        input_units={"de": "rad", "T": "N"},
        measurements={name: fid.Output(name, unit) for name, unit in STATES.items()},
        equations=EQUATIONS,
        definitions={name: fid.Output(*pair) for name, pair in DEFINITIONS.items()},
        parameters=fid.Parameters([*free, *fixed]),
        name="longitudinal",
    )


def fitted(
    seed: int, method: str, flight: Callable[[int], Flight] = Flight, **options: object
) -> Trial:
    """One flight, fitted by one method."""
    record = flown(flight(seed))
    return fit_trial(lambda: fid.identify(model(), record, method=method, **options), TRUTH)


def gusty(seed: int) -> Flight:
    """Forty seconds in light turbulence."""
    return Flight(seed, 40.0, gust_m_s=1.0)


def fleet(seed: int) -> Trial:
    """Three manoeuvres: mass is declared, the moment's constant differs with the loading."""
    random = np.random.default_rng(seed)
    loadings = zip((1000.0, 1200.0, 1400.0), 0.04 + 0.01 * random.standard_normal(3), strict=True)
    records = []
    for place, (mass, constant) in enumerate(loadings):
        flight = Flight(1000 * seed + place, 12.0, mass=mass, others={"Cm0": constant})
        record = flown(flight)
        records.append(
            fid.Record.from_arrays(
                record.time_s,
                inputs={name: record[name] for name in record.inputs},
                outputs={name: record[name] for name in record.outputs},
                others={"m": np.full(record.n_samples, mass)},
                units={**{name: record.unit(name) for name in record.channels}, "m": "kg"},
                hold="zero",
            )
        )
    truth = {name: value for name, value in TRUTH.items() if name != "Cm0"}
    own = ["m", "Cm0"]
    return fit_trial(
        lambda: fid.identify(
            model(), records, method="output_error", output_bias=False, record_parameters=own
        ),
        truth,
    )


def at_trim(seed: int) -> Trial:
    """Fourier output error where a trim is declared: far from it the equations bend."""
    record = flown(Flight(seed))
    declared = model().linearise({"V": 48.0, "alpha": 0.08, "theta": 0.05})
    return fit_trial(lambda: fid.identify(declared, record, method="fourier_output_error"), TRUTH)


def moment(seed: int) -> Trial:
    """Pitching moment measured in a tunnel: no state, an algebraic model."""
    random = np.random.default_rng(seed)
    n = 500
    angle, rate, elevator = (
        size * np.repeat(random.standard_normal(n // 10), 10) for size in (0.1, 0.02, 0.1)
    )
    true = {key: TRUTH[key] for key in ("Cm0", "Cma", "Cmq", "Cmde")}
    clean = true["Cm0"] + true["Cma"] * angle + true["Cmq"] * rate + true["Cmde"] * elevator
    record = fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"alpha": angle, "qhat": rate, "de": elevator},
        outputs={"Cm": clean + 0.02 * random.standard_normal(n)},
        units={"alpha": "rad", "qhat": "rad", "de": "rad"},
        hold="zero",
    )

    def fit() -> fid.Fit:
        units = {"Cm0": "1", "Cma": "1/rad", "Cmq": "1/rad", "Cmde": "1/rad"}
        algebraic = fid.StateSpaceModel(
            states={},
            input_units={"alpha": "rad", "qhat": "rad", "de": "rad"},
            measurements={"Cm": fid.Output("Cm0 + Cma*alpha + Cmq*qhat + Cmde*de", "1")},
            equations={},
            parameters=fid.Parameters(
                [fid.Parameter(name, 0.5 * true[name], unit) for name, unit in units.items()]
            ),
        )
        return fid.identify(algebraic, record, method="output_error", output_bias=False)

    return fit_trial(fit, true)


CASES = (
    Case("aircraft off trim, output error as it is", partial(fitted, method="output_error")),
    Case(
        "aircraft off trim, output error",
        partial(fitted, method="output_error", output_bias=False),
    ),
    Case("aircraft off trim, equation error", partial(fitted, method="equation_error")),
    Case("aircraft, Fourier output error at a trim", at_trim),
    Case(
        "aircraft in a gust, output error",
        partial(fitted, method="output_error", flight=gusty, output_bias=False),
    ),
    Case("three loadings, mass declared, Cm0 by record", fleet),
    Case("moment without states, output error", moment),
)
