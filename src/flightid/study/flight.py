"""The flight that a study simulates: its settings, and the log that flightid writes of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from flightid.control.autopilots import read_parameters
from flightid.control.tuning.result import Tuning
from flightid.errors import FlightidError, StudyError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.study.reading import TableReader, read_table
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


@dataclass(frozen=True)
class FlightPlan(Options):
    """What ``[flight]`` says of the flight that is simulated."""

    simulate: str = option(choices=SIMULATORS, doc="The vehicle.")
    parameters: str | None = option(None, doc="Parameter file of the gains that are flown.")
    log_every: int = option(1, minimum=1, doc="Loops between rows of the log.")
    seed: int = option(0, minimum=0, doc="Seed of all noise.")
    sweep: tuple[SidActivation, ...] = option((), doc="System-identification runs.")
    doublet: tuple[PilotDoublet, ...] = option((), doc="Stick movements.")
    vehicle: QuadrotorParameters = option(default_factory=QuadrotorParameters, doc="What flies.")
    autopilot: Autopilot = option(default_factory=Autopilot, doc="What flies it.")
    sensors: Sensors = option(default_factory=Sensors, doc="Errors of its sensors.")
    turbulence: Turbulence = option(default_factory=Turbulence, doc="Gusts.")

    def fly(self) -> Flight:
        """Fly it."""
        return fly(
            runs=self.sweep,
            doublets=self.doublet,
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


def read_flight(reader: TableReader, folder: Path) -> FlightPlan:
    """Check the table ``[flight]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    plan = read_table(FlightPlan, reader)
    if plan.parameters is None:
        return plan
    return replace(plan, autopilot=_with_parameters(plan.autopilot, folder / plan.parameters))


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
