"""A seat for any model: which hand moves which input, how far, and which law it can carry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from flightid.app.fly_vehicles import RATE_HZ, VEHICLES, FlyVehicle, fly_vehicle
from flightid.control.laws.augmentation import augmentation_law
from flightid.errors import ModelError
from flightid.models import Model, StateSpaceModel
from flightid.simulation.stepper import Stepper
from flightid.units import conversion_factor, is_convertible

HANDS = {
    "roll": ("lat", "aileron", "tau_phi"),
    "pitch": ("lon", "elevator", "tau_theta"),
    "yaw": ("ped", "rudder", "tau_psi"),
    "heave": ("col", "throttle", "thrust", "F"),
}
"""Names of inputs that say which hand moves them; others are told by what they move."""
SHOWN = {
    "roll": (("p", "rad/s"), ("phi", "rad")),
    "pitch": (("q", "rad/s"), ("theta", "rad")),
    "yaw": (("r", "rad/s"), ("psi", "rad")),
    "heave": (("w", "m/s"), ("az", "m/s^2")),
}
"""By hand the outputs that tell of its axis, the first that there is, with their unit."""
PULLED = {"roll": 1.0, "pitch": 1.0, "yaw": 1.0, "heave": -1.0}
"""Which way such an output goes for a hand that moves the way of its axis."""
TRIED_S, SMALL = 1.0, 1e-3
FULL = {"roll": 1.0, "pitch": 1.0, "yaw": 1.0, "heave": 3.0}
"""What a whole stick shall have made of that output after `TRIED_S`, rad/s, rad or m/s."""
NEEDED = ("p", "q", "r", "phi", "theta", "psi")
SLOWEST_HZ, FASTEST_HZ = 10.0, 500.0


def vehicle_of(model: Model, name: str, title: str, path: str) -> FlyVehicle:
    """A vehicle of a model that nobody has furnished for a pilot.

    One with the inputs of a vehicle of the library, in their units, takes its seat: the same
    travel, gusts, and law. Another is tried: a small step on each input for a second.

    Raises
    ------
    ModelError
        It tells no attitude and no rate of a vehicle, or no input moves any.
    OptionError, DataError
        It cannot be stepped.
    """
    rate_hz = RATE_HZ if model.sample_time_s is None else 1.0 / model.sample_time_s
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise ModelError(
            "this model cannot be flown at its own rate", found=f"{rate_hz:g} Hz",
            needed=f"{SLOWEST_HZ:g} to {FASTEST_HZ:g} Hz",
        )  # fmt: skip
    if not any(_is(model, each, unit) for rows in SHOWN.values() for each, unit in rows[:2]
               if each in NEEDED):  # fmt: skip
        raise ModelError(
            "this model tells nothing that an attitude could be drawn of",
            found=f"outputs {', '.join(model.outputs)}",
            needed=f"one of {', '.join(NEEDED)}, in rad or rad/s",
        )
    made = FlyVehicle(name, title, {}, path=path, rate_hz=rate_hz, speed_m_s=_speed(model))
    for kin in VEHICLES:
        if _has_seat(model, kin):
            return _seated(made, model, kin)
    travel = _tried(model, 1.0 / rate_hz)
    if not travel:
        raise ModelError(
            "no input of this model moves an attitude", found=f"inputs {', '.join(model.inputs)}"
        )
    note = "A whole stick makes 1 rad/s, or 3 m/s of heave, within a second of trim."
    return replace(made, travel=travel, note=note)


def _is(model: Model, channel: str, unit: str) -> bool:
    """Whether a model has such an output, of that dimension."""
    if channel not in model.outputs:
        return False
    return is_convertible(model.units[channel], unit)


@cache
def _units(kin: str) -> Mapping[str, str]:
    return fly_vehicle(kin).model.units


def _has_seat(model: Model, kin: FlyVehicle) -> bool:
    units = _units(kin.name)
    moved = [name for name, _ in kin.travel.values()]
    return all(name in model.inputs and model.units[name] == units[name] for name in moved)


def _seated(made: FlyVehicle, model: Model, kin: FlyVehicle) -> FlyVehicle:
    """The seat of the vehicle of the library that has these inputs."""
    law = kin.law
    if law:
        told = augmentation_law(law)
        law = law if all(each in model.outputs for each in told.sensors) else ""
    states: Mapping[str, object] = {}
    if (
        isinstance(model, StateSpaceModel) and model.is_linear
    ):  # noise is flown on linear ones alone
        states = dict.fromkeys(model.states)
    gusts = {n: g for n, g in kin.gusts.items() if n in states}
    sensor = {n: s for n, s in kin.sensor.items() if states and n in model.outputs}
    return replace(
        made, travel=kin.travel, gusts=gusts, sensor=sensor, law=law,
        speed_m_s=made.speed_m_s or kin.speed_m_s, note=f"In the seat of the {kin.title}.",
    )  # fmt: skip


def _speed(model: Model) -> float:
    """Trim speed forward, m/s, where equations hold it as a constant; outputs are beside it."""
    constant = model.parameters.get("U0")
    if constant is None or constant.value is None or not is_convertible(constant.unit, "m/s"):
        return 0.0
    return float(constant.value) * conversion_factor(constant.unit, "m/s")


def _tried(model: Model, step_s: float) -> dict[str, tuple[str, float]]:
    """By hand the input that moves its axis, and the input at the stop."""
    felt = {name: _felt(model, name, step_s) for name in model.inputs}
    found: dict[str, tuple[str, float]] = {}
    for hand, names in HANDS.items():
        for name in names:
            if felt.get(name, {}).get(hand):
                found[hand] = (name, felt[name][hand])
                break
    named = {name for names in HANDS.values() for name in names}
    shares = sorted(
        ((abs(made) / sum(map(abs, felt[name].values())), name, hand)
         for name in felt if name not in named for hand, made in felt[name].items() if made),
        reverse=True,
    )  # fmt: skip
    for _, name, hand in shares:
        if hand not in found and name not in dict(found.values()):
            found[hand] = (name, felt[name][hand])
    return {
        hand: (name, float(f"{PULLED[hand] * FULL[hand] / made:.2g}"))
        for hand, (name, made) in found.items()
    }


def _felt(model: Model, name: str, step_s: float) -> dict[str, float]:
    """The most that each axis shows of a step of 1 on an input within a second, in SI.

    The sign is that of the first swing: a quick mode may have turned by the end.
    """
    rows = [_flown(model, {name: part}, step_s) for part in (0.0, SMALL)]
    found = {}
    for hand, told in SHOWN.items():
        channel, unit = next((each for each in told if _is(model, *each)), ("", ""))
        if not channel:
            continue
        change = np.array(
            [after[channel] - before[channel] for before, after in zip(*rows, strict=True)]
        )
        made = change / SMALL * conversion_factor(model.units[channel], unit)
        most = float(np.abs(made).max())
        first = made[np.argmax(np.abs(made) >= 0.5 * most)]
        found[hand] = float(np.copysign(most, first)) if 1e-9 < most < 1e9 else 0.0
    return found


def _flown(model: Model, moved: Mapping[str, float], step_s: float) -> list[dict[str, float]]:
    """A second of outputs with inputs moved from rest."""
    stepper = Stepper(model, step_s)
    given = {name: stepper.rest[name] + part for name, part in moved.items()}
    return [stepper.step(given) for _ in range(round(TRIED_S / step_s) + 1)]
