"""The flight that a study simulates: its settings, and the log that flightid writes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

from flightid.control.autopilots import read_parameters
from flightid.control.tuning.result import Tuning
from flightid.errors import FlightidError, StudyError
from flightid.study.reading import TableReader, read_each
from flightid.vehicles import (
    Autopilot,
    Flight,
    GainFlight,
    GainFlightOptions,
    PilotDoublet,
    QuadrotorParameters,
    Sensors,
    SidActivation,
    Turbulence,
    fly,
    fly_gains,
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


def fly_again(tuning: Tuning | None, plan: FlightPlan, options: GainFlightOptions) -> GainFlight:
    """The gains that were tuned, in the vehicle and the air of the first flight.

    Raises
    ------
    DataError
        No axis has sound gains.
    """
    return fly_gains(
        tuning or Tuning((), ()),
        vehicle=plan.vehicle,
        autopilot=plan.autopilot,
        sensors=plan.sensors,
        turbulence=plan.turbulence,
        options=options,
    )


def read_fly(reader: TableReader) -> GainFlightOptions:
    """Check the table ``[fly]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    (made,) = read_each((GainFlightOptions,), reader)
    return cast("GainFlightOptions", made)


def read_flight(reader: TableReader, folder: Path) -> FlightPlan:
    """Check the table ``[flight]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    reader.choice("simulate", SIMULATORS)
    parameters = reader.maybe(reader.text, "parameters")
    autopilot = _part(Autopilot, reader.values("autopilot"), "[flight.autopilot]")
    if parameters is not None:
        autopilot = _with_parameters(autopilot, folder / parameters)
    plan = FlightPlan(
        tuple(_part(SidActivation, item, where) for where, item in reader.rows("sweep")),
        tuple(_part(PilotDoublet, item, where) for where, item in reader.rows("doublet")),
        _part(QuadrotorParameters, reader.values("vehicle"), "[flight.vehicle]"),
        autopilot,
        _part(Sensors, reader.values("sensors"), "[flight.sensors]"),
        _part(Turbulence, reader.values("turbulence"), "[flight.turbulence]"),
        reader.integer("log_every", 1, minimum=1),
        reader.integer("seed", 0),
    )
    reader.finish()
    return plan


def _with_parameters(autopilot: Autopilot, path: Path) -> Autopilot:
    """The autopilot with the gains of a parameter file."""
    try:
        return autopilot.with_parameters(read_parameters(path))
    except (FlightidError, OSError) as error:
        raise StudyError(
            "study file, [flight] parameters: the gains cannot be flown",
            found=f"{path.name}: {error}",
            needed="a parameter file as `flightid tune --write` makes it",
        ) from error


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
