"""Output error in turbulence, and where residuals have colours of other origin; SciPy's flights.

Three vehicles in air that moves or under noise of each sensor by itself, loops open and closed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import expm

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial

STEP_S, FINE = 0.02, 4
Array = noises.Array
Noise = Callable[[np.random.Generator, int], Array]


@dataclass(frozen=True)
class Vehicle:
    """Equations by states; `felt` is the state that a gust adds to, `fed` the loop's gains."""

    name: str
    states: dict[str, str]
    equations: dict[str, str]
    outputs: dict[str, tuple[str, str]]
    truth: dict[str, tuple[float, str]]
    a: Callable[[dict[str, float]], list[list[float]]]
    b: Callable[[dict[str, float]], list[float]]
    felt: int
    fed: tuple[float, ...]
    size: tuple[float, ...]

    def numbers(self) -> dict[str, float]:
        """The truth without units."""
        return {name: value for name, (value, _) in self.truth.items()}

    def model(self) -> fid.StateSpaceModel:
        """Started a fifth off."""
        return fid.StateSpaceModel(
            states=self.states,
            input_units={"d": "rad"},
            measurements={k: fid.Output(*pair) for k, pair in self.outputs.items()},
            equations=self.equations,
            parameters=fid.Parameters(
                [fid.Parameter(k, 0.8 * value, unit) for k, (value, unit) in self.truth.items()]
            ),
            name=self.name,
        )


PITCH = Vehicle(
    "short period",
    {"alpha": "rad", "q": "rad/s"},
    {"alpha'": "Za*alpha + q", "q'": "Ma*alpha + Mq*q + Md*d"},
    {"alpha": ("alpha", "rad"), "q": ("q", "rad/s")},
    {"Za": (-1.2, "1/s"), "Ma": (-6.0, "1/s^2"), "Mq": (-1.8, "1/s"), "Md": (-9.0, "1/s^2")},
    lambda t: [[t["Za"], 1.0], [t["Ma"], t["Mq"]]],
    lambda t: [0.0, t["Md"]],
    0,
    (0.2, 0.1),
    (0.025, 0.06),
)
ROLL = Vehicle(
    "roll",
    {"p": "rad/s"},
    {"p'": "Lp*p + Ld*d"},
    {"p": ("p", "rad/s")},
    {"Lp": (-3.0, "1/s"), "Ld": (12.0, "1/s^2")},
    lambda t: [[t["Lp"]]],
    lambda t: [t["Ld"]],
    0,
    (-0.1,),
    (0.1,),
)
YAW = Vehicle(
    "dutch roll",
    {"beta": "rad", "r": "rad/s"},
    {"beta'": "Yb*beta - r", "r'": "Nb*beta + Nr*r + Nd*d"},
    {"r": ("r", "rad/s")},
    {"Yb": (-0.2, "1/s"), "Nb": (9.0, "1/s^2"), "Nr": (-0.4, "1/s"), "Nd": (-4.0, "1/s^2")},
    lambda t: [[t["Yb"], -1.0], [t["Nb"], t["Nr"]]],
    lambda t: [0.0, t["Nd"]],
    0,
    (0.1,),
    (0.06,),
)


def flight(
    seed: int,
    vehicle: Vehicle,
    *,
    noise: Noise = noises.white,
    level: float = 0.1,
    gust: float = 0.0,
    time_s: float = 1.0,
    closed: bool = False,
    duration_s: float = 30.0,
) -> fid.Record:
    """Steps of 0.6 s held between samples; sensors that err by themselves, `level` of their signal.

    `gust` is the deviation of a vertical Dryden gust in the unit of the state that feels it. In a
    closed loop the measured outputs are fed back to the control.
    """
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    steps = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 30 + 1), 30)[:n]
    t = vehicle.numbers()
    a, b = np.array(vehicle.a(t)), np.array(vehicle.b(t))
    order = len(a)
    whole = np.zeros((order + 2, order + 2))
    whole[:order] = np.column_stack([a, b, a[:, vehicle.felt] * (np.arange(order) >= 0)])
    phi = expm(whole * STEP_S / FINE)[:order]
    air = gust * noises.dryden_vertical(random, FINE * n, STEP_S / FINE, 1.0, time_s)
    places = [list(vehicle.states).index(key) for key in vehicle.outputs]
    # The first column of a gust on kinematics is a known number and does not count.
    sensed = np.array([noise(random, n) for _ in places])
    sensed *= level * np.array(vehicle.size)[:, None]
    state, control, seen = np.zeros(order), np.zeros(n), np.empty((len(places), n))
    for k in range(n):
        seen[:, k] = state[places] + sensed[:, k]
        control[k] = steps[k] + (np.dot(vehicle.fed, seen[:, k]) if closed else 0.0)
        for fine in range(FINE):
            state = phi @ np.array([*state, control[k], air[FINE * k + fine]])
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"d": control},
        outputs=dict(zip(vehicle.outputs, seen, strict=True)),
        units={"d": "rad", **{k: unit for k, (_, unit) in vehicle.outputs.items()}},
        hold="zero",
        loop="closed" if closed else "open",
    )


def fly(seed: int, *, vehicle: Vehicle, **how: object) -> Trial:
    """Output error as the documentation says, all options at their defaults."""
    record = flight(seed, vehicle, **how)
    return fit_trial(
        lambda: fid.identify(vehicle.model(), record, method="output_error"), vehicle.numbers()
    )


def calm(seed: int, *, vehicle: Vehicle, **how: object) -> bool:
    """Whether a fit says that there is process noise."""
    fit = fid.identify(vehicle.model(), flight(seed, vehicle, **how), method="output_error")
    return any(finding.code == "process-noise" for finding in fit.findings)


VEHICLES = (PITCH, ROLL, YAW)
COLOURS: dict[str, dict[str, object]] = {
    "white": {},
    "AR(1) 0.6": {"noise": partial(noises.ar1, pole=0.6)},
    "AR(1) 0.95": {"noise": partial(noises.ar1, pole=0.95)},
    "AR(2)": {"noise": partial(noises.ar2, radius=0.97, angle=0.15)},
    "drift": {"noise": noises.drift},
    "AR(1) 0.9, loop closed": {"noise": partial(noises.ar1, pole=0.9), "closed": True},
}
GUSTS: dict[str, dict[str, object]] = {
    f"{size:g} of its size, {time_s:g} s": {"gust": size, "time_s": time_s, "level": 0.05}
    for size in (0.3, 1.0)
    for time_s in (0.3, 3.0)
}
CASES = tuple(
    Case(
        f"output error, {vehicle.name}, {what} {name}",
        partial(
            fly,
            vehicle=vehicle,
            **(how if what == "noise" else {**how, "gust": how["gust"] * vehicle.size[0]}),
        ),
    )
    for vehicle in VEHICLES
    for what, each in (("noise", COLOURS), ("gust", GUSTS))
    for name, how in each.items()
)
