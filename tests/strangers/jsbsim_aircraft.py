"""A Cessna 172 of JSBSim in level flight, flown by its own integrators, actuators and hysteresis.

Truth is what its accelerations at trim do when one state or surface moves; surfaces are logged
where they act. No cases where JSBSim is not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from tempfile import gettempdir
from typing import Any

import numpy as np

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Trial, fit_trial
from tests.strangers.responses import STEP_S

FINE = 20
"""Steps of JSBSim between two samples: its angular rates take Euler's."""
STATES = {
    "beta": ("aero/beta-rad", "ic/beta-rad", "aero/betadot-rad_sec"),
    "p": ("velocities/p-rad_sec", "ic/p-rad_sec", "accelerations/pdot-rad_sec2"),
    "phi": ("attitude/phi-rad", "ic/phi-rad", "velocities/phidot-rad_sec"),
    "r": ("velocities/r-rad_sec", "ic/r-rad_sec", "accelerations/rdot-rad_sec2"),
}
"""Where each state is read, set, and its derivative read."""
SURFACES = {
    "da": ("fcs/effective-aileron-pos", "fcs/aileron-cmd-norm"),
    "dr": ("fcs/rudder-pos-rad", "fcs/rudder-cmd-norm"),
}
"""Where each surface is read, and commanded."""
SWEEPS_S = 120.0
SPEED = "velocities/vt-fps"
"""Trimmed ailerons hold the propeller's torque: what speed is lost moves the bank."""
UNITS = {
    "V": "ft/s",
    "beta": "rad",
    "p": "rad/s",
    "phi": "rad",
    "r": "rad/s",
    "da": "rad",
    "dr": "rad",
}
NOISE = {"beta": 0.001, "p": 0.004, "phi": 0.002, "r": 0.002}
NAMES = {
    "Lb": ("p", "beta"), "Lp": ("p", "p"), "Lr": ("p", "r"), "Lda": ("p", "da"),
    "Nb": ("r", "beta"), "Np": ("r", "p"), "Nr": ("r", "r"), "Ndr": ("r", "dr"),
}  # fmt: skip
KNOWN = {
    "Yb": ("beta", "beta"), "Yp": ("beta", "p"), "Yphi": ("beta", "phi"), "Yr": ("beta", "r"),
    "Yda": ("beta", "da"), "Ydr": ("beta", "dr"), "Tr": ("phi", "r"), "Ldr": ("p", "dr"),
    "Lv": ("p", "V"), "Nda": ("r", "da"), "Nv": ("r", "V"),
}  # fmt: skip
Array = noises.Array


def _craft() -> Any:
    """Trimmed at 90 kt and 4000 ft; what it begins with from now on is its trim."""
    jsbsim = import_module("jsbsim")
    jsbsim.FGJSBBase().debug_lvl = 0
    craft = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    craft.set_debug_level(0)
    craft.set_output_path(gettempdir())
    craft.load_model("c172x")
    craft.set_dt(STEP_S / FINE)
    craft["ic/h-sl-ft"], craft["ic/vc-kts"], craft["ic/gamma-deg"] = 4000.0, 90.0, 0.0
    craft.run_ic()
    craft["propulsion/set-running"] = -1
    craft["fcs/throttle-cmd-norm"], craft["fcs/mixture-cmd-norm"] = 0.7, 0.87
    craft.do_trim(1)
    for place, found in (
        ("ic/alpha-rad", "aero/alpha-rad"),
        ("ic/theta-rad", "attitude/theta-rad"),
        ("ic/phi-rad", "attitude/phi-rad"),
    ):
        craft[place] = craft[found]
    return craft


@lru_cache
def slopes() -> dict[tuple[str, str], float]:
    """Central differences of the states' derivatives at trim, by row and by state or surface."""
    craft = _craft()
    rows = [derivative for _, _, derivative in STATES.values()]
    moves = {name: (begin, read, 0.005) for name, (read, begin, _) in STATES.items()}
    moves |= {name: (command, read, 0.05) for name, (read, command) in SURFACES.items()}
    moves["V"] = "ic/vt-fps", SPEED, 0.5
    found = {}
    for name, (place, read, change) in moves.items():
        middle, ends = craft[place], []
        for turn in (change, -change):
            craft[place] = middle + turn
            craft.run_ic()
            ends.append(np.array([craft[each] for each in (read, *rows)]))
        craft[place] = middle
        moved, *risen = ends[0] - ends[1]
        found |= {(row, name): rise / moved for row, rise in zip(STATES, risen, strict=True)}
    return found


def _sweeps() -> Array:
    """A sweep of the ailerons, then one of the rudder, 0.3 to 12 rad/s; quiet between and after."""
    n = round(SWEEPS_S / STEP_S)
    t, u = np.arange(n) * STEP_S, np.zeros((2, n))
    half, low, high = SWEEPS_S / 2.0, 0.3, 12.0
    rate = np.log(high / low) / (half - 6.0)
    for row in (0, 1):
        at = np.clip(t - row * half - 1.0, 0.0, half - 6.0)
        fade = np.minimum(1.0, np.minimum(at, half - 6.0 - at))
        u[row] = 0.04 * fade * np.sin(low * (np.exp(rate * at) - 1.0) / rate)
    return u


def _doublets() -> Array:
    """Doublets of ailerons and rudder, share of full, at the samples; straight lines between."""
    n = round(20.0 / STEP_S)
    t, u = np.arange(n) * STEP_S, np.zeros((2, n))
    # The second pair is turned round: the ailerons' hysteresis leaves the bank where it was.
    for row, first, size in ((0, 1.0, 0.06), (1, 5.0, 0.06), (0, 9.0, -0.06), (1, 13.0, -0.06)):
        for begin, turn in ((first, size), (first + 0.7, -size)):
            inside = (t > begin) & (t < begin + 0.7)
            u[row] += turn * np.sin(np.pi * (t - begin) / 0.7) ** 2 * inside
    return u


@lru_cache
def flown(commands: Callable[[], Array] = _doublets) -> tuple[Array, Array]:
    """Surfaces with airspeed, and states, of one run from trim, departures, without noise."""
    asked = commands()
    n = asked.shape[1]
    fine = np.arange(n * FINE) / FINE
    asked = np.array([np.interp(fine, np.arange(n), row) for row in asked])
    craft = _craft()
    surfaces = [*(read for read, _ in SURFACES.values()), SPEED]
    states = [read for read, _, _ in STATES.values()]
    middle = {command: craft[command] for _, command in SURFACES.values()}
    u, y = np.zeros((3, n)), np.zeros((len(states), n))
    rest = np.array([[craft[each]] for each in (*surfaces, *states)])
    for k, moved in enumerate(asked.T):
        for (command, value), change in zip(middle.items(), moved, strict=True):
            craft[command] = value + change
        craft.run()
        if k % FINE == 0:
            u[:, k // FINE] = [craft[each] for each in surfaces]
            y[:, k // FINE] = [craft[each] for each in states]
    return u - rest[:3], y - rest[3:]


def record(seed: int, commands: Callable[[], Array] = _doublets) -> fid.Record:
    """A run with white noise on its sensors."""
    u, y = flown(commands)
    random = np.random.default_rng(seed)
    n = u.shape[1]
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs=dict(zip((*SURFACES, "V"), u, strict=True)),
        outputs={
            name: row + NOISE[name] * noises.white(random, n)
            for name, row in zip(STATES, y, strict=True)
        },
        units=UNITS,
        hold="first",
    )


def model(*, airspeed: bool = True) -> fid.StateSpaceModel:
    """Lateral motion; kinematics, side force and small cross-controls are known.

    What `airspeed` does is fitted: the propeller's torque settles with it.
    """
    at = slopes()
    units = {"da": "1/s^2", "dr": "1/s^2", "beta": "1/s^2", "p": "1/s", "r": "1/s"}
    plain = {"Yp": "1", "Yr": "1", "Tr": "1", "Ldr": "1/s^2", "Nda": "1/s^2", "Yda": "1/s"}
    plain |= {"Lv": "1/(ft*s)", "Nv": "1/(ft*s)"}
    free = [fid.Parameter(n, 1.2 * at[place], units[place[1]]) for n, place in NAMES.items()]
    fixed = [
        fid.Parameter(n, at[place], plain.get(n, "1/s"), free=n in ("Lv", "Nv"))
        for n, place in KNOWN.items()
        if airspeed or place[1] != "V"
    ]
    inputs, roll, yaw = (*SURFACES, "V"), " + Lv*V", " + Nv*V"
    if not airspeed:
        inputs, roll, yaw = tuple(SURFACES), "", ""
    states = {name: UNITS[name] for name in STATES}
    return fid.StateSpaceModel(
        states=states,
        input_units={name: UNITS[name] for name in inputs},
        equations={
            "beta'": "Yb*beta + Yp*p + Yphi*phi + Yr*r + Yda*da + Ydr*dr",
            "p'": "Lb*beta + Lp*p + Lr*r + Lda*da + Ldr*dr" + roll,
            "phi'": "p + Tr*r",
            "r'": "Nb*beta + Np*p + Nr*r + Nda*da + Ndr*dr" + yaw,
        },
        measurements={name: fid.Output(name, unit) for name, unit in states.items()},
        parameters=fid.Parameters((*free, *fixed)),
    )


def fly(seed: int) -> Trial:
    """Output error on doublets.

    The slope Lr at trim was held in 85 % of 60, the others in 95 %: the wash makes 7.8 rad/s² of
    roll a rad of the angle of attack, which the model lacks and which goes with r (correlation
    0.97 with what slopes leave of p', -0.6 with r). Without noise Lr comes out 1.1 standard errors
    low; beside alpha and pitch rate as inputs 0.1, Lr held in 90 % and Ndr in 88 % of 100.
    """
    truth = {name: slopes()[at] for name, at in NAMES.items()}
    return fit_trial(
        lambda: fid.identify(model(), record(seed), method="output_error"),
        truth,
    )


def fly_sweeps(seed: int) -> Trial:
    """Fit to the responses of all states to both surfaces, all options at their defaults.

    Airspeed is no input that a sweep moves: it is left out, as the refusal of its responses says.
    """
    truth = {name: slopes()[at] for name, at in NAMES.items()}
    swept = record(seed, _sweeps)
    return fit_trial(
        lambda: fid.identify(
            model(airspeed=False),
            fid.estimate_response(swept, inputs=tuple(SURFACES), loop="open"),
        ),
        truth,
    )


CASES = (
    (
        Case("JSBSim c172x, doublets, output error", fly),
        Case("JSBSim c172x, sweeps, response", fly_sweeps),
    )
    if find_spec("jsbsim")
    else ()
)
