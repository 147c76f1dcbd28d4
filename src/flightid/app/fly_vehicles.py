"""Vehicles that the screen Fly offers: models of the library, and what a stick moves of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from flightid import Noise, load_model
from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.models import Model

RATE_HZ = 100.0
"""Frames a second of a model in continuous time."""

STICKS = ("pitch", "roll", "yaw", "heave")
"""Axes of a hand: pulled, to the right, right pedal, up; each from -1 to 1."""


@dataclass(frozen=True)
class FlyVehicle:
    """A model that a pilot flies.

    Attributes
    ----------
    name : str
        As `load_model` takes it: in the library, or a file of the workspace, from its folder.
    title : str
    travel : mapping of str to (str, float)
        By axis of the hand the model's input, and its value at the stop, in its unit; negative
        where the model counts the other way.
    gusts : mapping of str to (float, float)
        As `Noise` takes them.
    sensor : mapping of str to float
        Errors of the sensors, as `Noise` takes them.
    law : str
        Augmentation of the library; empty: there is none for it.
    note : str
        What a pilot should know.
    rate_hz : float
        Frames a second; a sampled model has its own.
    speed_m_s : float
        Trim speed forward, which the model's outputs do not hold; the scenery passes by with it.
    path : str
        Of the model's file; empty: it is in the library.
    """

    name: str
    title: str
    travel: Mapping[str, tuple[str, float]]
    gusts: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    sensor: Mapping[str, float] = field(default_factory=dict)
    law: str = ""
    note: str = ""
    rate_hz: float = RATE_HZ
    speed_m_s: float = 0.0
    path: str = ""

    @property
    def model(self) -> Model:
        """The model itself."""
        return load_model(self.path or self.name)

    @property
    def reach(self) -> dict[str, float]:
        """The most that each input is moved from trim, in its unit."""
        return {name: abs(most) for name, most in self.travel.values()}

    def inputs(self, stick: Mapping[str, float]) -> dict[str, float]:
        """Inputs of the model from a hand's stick, -1 to 1 by axis."""
        return {
            name: most * min(1.0, max(-1.0, stick.get(axis, 0.0)))
            for axis, (name, most) in self.travel.items()
        }

    def noise(self, seed: int) -> Noise | None:
        """Gusts and errors of its sensors; None where none are known of it."""
        if not (self.gusts or self.sensor):
            return None
        return Noise(gusts=dict(self.gusts), sensor=dict(self.sensor), seed=seed)


ANGULAR = dict.fromkeys(("p", "q", "r", "phi", "theta"), 0.002)
VEHICLES = (
    FlyVehicle(
        "ah64_hover",
        "AH-64, hover",
        {"pitch": ("lon", 5.0), "roll": ("lat", 4.5), "yaw": ("ped", 3.0), "heave": ("col", 5.0)},
        {"u": (3.0, 2.0), "v": (3.0, 2.0), "w": (2.0, 1.5)},
        {**dict.fromkeys(("u", "v", "w"), 0.2), **ANGULAR, "ax": 0.1, "ay": 0.1, "az": 0.2},
        "dase",
        "Unstable without its augmentation; DASE-class law of a tenth of the authority.",
    ),
    FlyVehicle(
        "r50_hover",
        "Yamaha R-50, hover",
        {
            "pitch": ("lon", -0.4),
            "roll": ("lat", 0.4),
            "yaw": ("ped", 0.3),
            "heave": ("col", 0.15),
        },
        {"u": (3.0, 2.0), "v": (3.0, 2.0), "w": (2.0, 1.5)},
        {**dict.fromkeys(("um", "vm", "w"), 0.2), **ANGULAR, "ax": 0.1, "ay": 0.1, "az": 0.2},
        note="A small helicopter with a stabiliser bar: quick, and unstable in slow motion.",
    ),
    FlyVehicle(
        "fixed_wing_lateral",
        "Fixed wing, roll and yaw",
        {"roll": ("aileron", 0.35), "yaw": ("rudder", -0.3)},
        {"beta": (0.03, 1.0)},
        {**dict.fromkeys(("p", "r", "phi", "beta"), 0.002), "ay": 0.1},
        note="Dutch roll to excite with the pedals; the stick does not pitch it.",
        speed_m_s=53.645,
    ),
)
"""A new vehicle is a new entry."""


def fly_vehicle(name: str) -> FlyVehicle:
    """A vehicle by its name.

    Raises
    ------
    UnknownNameError
        There is no such vehicle.
    """
    found = {each.name: each for each in VEHICLES}
    if name not in found:
        raise UnknownNameError(
            "there is no such vehicle to fly", found=name, needed=", ".join(found)
        )
    return found[name]
