"""The flight that a study simulates: its settings, and the log that flightid writes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from flightid.study.reading import TableReader
from flightid.vehicles import (
    Autopilot,
    Flight,
    PilotDoublet,
    QuadrotorParameters,
    Sensors,
    SidActivation,
    Turbulence,
    fly,
)

SIMULATORS = ("quadrotor",)
Part = TypeVar("Part")


@dataclass(frozen=True)
class FlightPlan:
    """What is flown, checked.

    Attributes
    ----------
    sweeps : tuple of SidActivation
        System-identification runs.
    doublets : tuple of PilotDoublet
        Stick movements.
    vehicle, autopilot, sensors, turbulence
        What flies, and in what air.
    log_every : int
        Loops between rows of the log.
    seed : int
        Seed of all noise.
    """

    sweeps: tuple[SidActivation, ...]
    doublets: tuple[PilotDoublet, ...]
    vehicle: QuadrotorParameters
    autopilot: Autopilot
    sensors: Sensors
    turbulence: Turbulence
    log_every: int
    seed: int

    def fly(self) -> Flight:
        """Fly it."""
        return fly(
            runs=self.sweeps,
            doublets=self.doublets,
            vehicle=self.vehicle,
            autopilot=self.autopilot,
            sensors=self.sensors,
            turbulence=self.turbulence,
            log_every=self.log_every,
            seed=self.seed,
        )


def read_flight(reader: TableReader) -> FlightPlan:
    """Check the table ``[flight]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    reader.choice("simulate", SIMULATORS)
    plan = FlightPlan(
        tuple(_part(SidActivation, item, where) for where, item in reader.rows("sweep")),
        tuple(_part(PilotDoublet, item, where) for where, item in reader.rows("doublet")),
        _part(QuadrotorParameters, reader.values("vehicle"), "[flight.vehicle]"),
        _part(Autopilot, reader.values("autopilot"), "[flight.autopilot]"),
        _part(Sensors, reader.values("sensors"), "[flight.sensors]"),
        _part(Turbulence, reader.values("turbulence"), "[flight.turbulence]"),
        reader.integer("log_every", 1, minimum=1),
        reader.integer("seed", 0),
    )
    reader.finish()
    return plan


def _part(kind: type[Part], values: Mapping[str, Any], where: str) -> Part:
    """Build one of the simulator's dataclasses from a TOML table, each field by its type."""
    reader = TableReader(values, where)
    hints = get_type_hints(kind)
    given: dict[str, Any] = {}
    for item in fields(kind):  # type: ignore[arg-type]
        read = _reading(reader, hints[item.name])
        if read is None:
            continue
        required = item.default is MISSING and item.default_factory is MISSING
        if required or item.name in reader:
            given[item.name] = read(item.name)
        else:
            reader.know(item.name)
    reader.finish()
    return kind(**given)


def _reading(reader: TableReader, hint: object) -> Callable[[str], Any] | None:
    """How a field of this type is read; None for one that a study cannot set."""
    simple: dict[object, Callable[[str], Any]] = {
        bool: reader.flag,
        int: reader.integer,
        float: reader.number,
        float | None: reader.number,
        str: reader.text,
    }
    if hint in simple:
        return simple[hint]
    if get_origin(hint) is Literal:
        return lambda key: reader.choice(key, map(str, get_args(hint)))
    if get_origin(hint) is tuple and set(get_args(hint)) == {float}:
        return lambda key: reader.numbers(key, length=len(get_args(hint)))
    return None
