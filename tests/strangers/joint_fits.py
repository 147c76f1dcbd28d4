"""Sweeps for a response and doublets as records in one fit: what their correction makes of bars.

The vehicles are SciPy's: linear, their input held over each sample and late by a delay.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import expm

import flightid as fid
from tests.strangers.counting import Case, Trial, fit_trial
from tests.strangers.noises import Array

STEP_S = 0.02


@dataclass(frozen=True)
class JointVehicle:
    """A vehicle, its flights and what is fitted.

    `rows` are equations and measurements as flightid reads them; `matrices` the same for SciPy.
    """

    truth: dict[str, float]
    units: dict[str, str]
    states: dict[str, str]
    equations: dict[str, str]
    measurements: dict[str, fid.Output]
    noise: float = 0.03
    sweep_s: float = 40.0
    record_s: float = 20.0
    band_rad_s: tuple[float, float] = (0.8, 25.0)
    gust: float = 0.0
    window_s: tuple[float, ...] = ()
    fixed: tuple[tuple[str, float, str], ...] = ()

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D of the truth, by evaluating the rows at unit vectors."""
        names = [*self.states, "u"]
        rows = [*self.equations.values(), *(each.expression for each in self.measurements.values())]
        known = self.truth | {name: value for name, value, _ in self.fixed}
        made = np.array(
            [
                [
                    eval(row, {}, known | dict(zip(names, unit, strict=True)))
                    for unit in np.eye(len(names))
                ]
                for row in rows
            ]
        )
        n = len(self.states)
        return made[:n, :n], made[:n, n], made[n:, :n], made[n:, n]

    def fly(self, random: np.random.Generator, held: Array) -> fid.Record:
        """One flight; the input stands still over each sample, late by the delay."""
        a, b, c, d = self.matrices()
        delay = self.truth.get("tau", 0.0) / STEP_S
        whole = int(np.ceil(delay - 1e-9))
        part = (whole - delay) * STEP_S
        older_phi, older = _step(a, b, STEP_S - part)
        newer_phi, newer = _step(a, b, part)
        phi, gusty = newer_phi @ older_phi, _step(a, b, STEP_S)[1]
        late = np.concatenate([np.zeros(whole), held])
        x, out = np.zeros(len(a)), []
        push = self.gust * random.standard_normal(len(held))
        for k in range(len(held)):
            old = late[k]
            new = late[k + 1] if whole else old
            out.append(c @ x + d * old)
            x = phi @ x + newer_phi @ older * old + newer * new + gusty * push[k]
        y = np.array(out).T
        y = y + self.noise * y.std(axis=1, keepdims=True) * random.standard_normal(y.shape)
        return fid.Record.from_arrays(
            np.arange(len(held)) * STEP_S,
            inputs={"u": held},
            outputs=dict(zip(self.measurements, y, strict=True)),
            units={"u": "rad", **{name: each.unit for name, each in self.measurements.items()}},
            hold="zero",
            loop="open",
        )

    def model(self, off: float = 0.7) -> fid.StateSpaceModel:
        """Started some way off."""
        return fid.StateSpaceModel(
            states=self.states,
            input_units={"u": "rad"},
            measurements=self.measurements,
            equations={f"{name}'": row for name, row in self.equations.items()},
            parameters=fid.Parameters(
                [
                    fid.Parameter(
                        name, off * self.truth[name], unit, minimum=0.0 if unit == "s" else -999.0
                    )
                    for name, unit in self.units.items()
                ]
                + [fid.Parameter(*each, free=False) for each in self.fixed]
            ),
            delays={"u": "tau"} if "tau" in self.truth else {},
            name="vehicle",
        )


def _step(a: Array, b: Array, time_s: float) -> tuple[Array, Array]:
    n = len(a)
    wide = np.zeros((n + 1, n + 1))
    wide[:n, :n], wide[:n, n] = a, b
    both = expm(wide * time_s)
    return both[:n, :n], both[:n, n]


def sweep(duration_s: float, low: float, high: float) -> Array:
    """Logarithmic sweep that fades in and out."""
    t = np.arange(round(duration_s / STEP_S)) * STEP_S
    rate = np.log(high / low) / t[-1]
    fade = np.clip(np.minimum(t, t[-1] - t) / 1.0, 0.0, 1.0)
    return 0.05 * fade * np.sin(low * np.expm1(rate * t) / rate)


def doublets(random: np.random.Generator, duration_s: float) -> Array:
    """Doublets of several widths, one after another."""
    found: list[float] = [0.0] * 25
    while len(found) < round(duration_s / STEP_S):
        width = int(random.integers(10, 40))
        found += [0.05] * width + [-0.05] * width + [0.0] * int(random.integers(25, 75))
    return np.array(found[: round(duration_s / STEP_S)])


def _longitudinal(zeta: float, natural: float, tau: float, **more: object) -> JointVehicle:
    za = -zeta * natural
    mq = za
    ma = -(natural**2) + za * mq
    truth = {"Za": za, "Ma": ma, "Mq": mq, "Md": -9.0, "tau": tau}
    units = {"Za": "1/s", "Ma": "1/s^2", "Mq": "1/s", "Md": "1/s^2", "tau": "s"}
    return JointVehicle(
        truth, units,
        states={"alpha": "rad", "q": "rad/s"},
        equations={"alpha": "Za*alpha + q", "q": "Ma*alpha + Mq*q + Md*u"},
        measurements={"alpha": fid.Output("alpha", "rad"), "q": fid.Output("q", "rad/s")},
        **more,
    )  # fmt: skip


def _accelerometer(tau: float, **more: object) -> JointVehicle:
    """A lateral axis whose accelerometer feels the control at once."""
    truth = {"Yv": -0.25, "Lv": -0.6, "Lp": -4.0, "Ld": 18.0, "Yd": 6.0, "tau": tau}
    units = {"Yv": "1/s", "Lv": "rad/(m*s)", "Lp": "1/s", "Ld": "1/s^2", "Yd": "m/s^2", "tau": "s"}
    return JointVehicle(
        truth, units,
        states={"v": "m/s", "p": "rad/s", "phi": "rad"},
        equations={"v": "Yv*v + g*phi + Yd*u", "p": "Lv*v + Lp*p + Ld*u", "phi": "p"},
        measurements={
            "p": fid.Output("p", "rad/s"),
            "ay": fid.Output("Yv*v + Yd*u", "m/s^2"),
        },
        fixed=(("g", 9.81, "m/s^2"),),
        **more,
    )  # fmt: skip


VEHICLES = {
    "short period": _longitudinal(0.5, 2.6, 0.073),
    "short period, short windows": _longitudinal(0.3, 2.6, 0.073, window_s=(4.0,)),
    "lightly damped, 25 s": _longitudinal(0.04, 3.0, 0.05, sweep_s=25.0),
    "accelerometer, delay on the grid": _accelerometer(0.06),
    "accelerometer, short windows": _accelerometer(0.06, window_s=(4.0,)),
}  # fmt: skip


def flights(seed: int, craft: JointVehicle) -> tuple[fid.Record, fid.Record]:
    """One sweep, and one record of doublets."""
    random = np.random.default_rng([seed, 29])
    flown = craft.fly(random, sweep(craft.sweep_s, *craft.band_rad_s))
    return flown, craft.fly(random, doublets(random, craft.record_s))


def response_of(craft: JointVehicle, flown: fid.Record) -> fid.FrequencyResponse:
    """By the windows of the case, or those that are chosen."""
    windows = list(craft.window_s) or "auto"
    return fid.estimate_response(flown, band_rad_s=craft.band_rad_s, window_s=windows)


def fly_and_fit(seed: int, *, name: str) -> fid.Fit:
    """As the documentation says."""
    craft = VEHICLES[name]
    flown, beside = flights(seed, craft)
    return fid.identify(craft.model(), (response_of(craft, flown), beside))


def fly(seed: int, *, name: str) -> Trial:
    """A response from one sweep beside one record of doublets."""
    return fit_trial(partial(fly_and_fit, seed, name=name), VEHICLES[name].truth)


CASES = tuple(
    Case(f"joint sweep and doublets, {name}", partial(fly, name=name)) for name in VEHICLES
)
