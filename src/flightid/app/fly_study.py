"""A pilot's flight as a study says it, ``[pilot]``: flown without a page."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from flightid.app.fly_loop import Failure, FlySwitches, PilotedVehicle, PilotSeat
from flightid.app.fly_seat import vehicle_of
from flightid.app.fly_vehicles import VEHICLES, FlyVehicle, fly_vehicle
from flightid.errors import OptionError
from flightid.models import load_model
from flightid.record import Record, Step
from flightid.simulation.fly_options import FlyOptions
from flightid.simulation.realtime import FlownSession, UdpLink, fly_in_real_time
from flightid.study.pilot_settings import PilotSettings, pilot_table
from flightid.version import VERSION

OF_COMMAND = ("feedback", "limits", "sample_rate_hz")
"""Options of a model that is flown bare: a vehicle has a law, a travel and a rate of its own."""


def piloted(settings: PilotSettings) -> FlyVehicle:
    """The vehicle of a study: of the library, or of a model file.

    Raises
    ------
    FlightidError
        There is none such, or it cannot be flown.
    """
    if any(each.name == settings.vehicle for each in VEHICLES):
        return fly_vehicle(settings.vehicle)
    path = Path(settings.vehicle)
    if not path.is_file():
        known = ", ".join(each.name for each in VEHICLES)
        raise OptionError(
            "there is no such vehicle to fly",
            found=settings.vehicle,
            needed=f"a model file, or one of {known}",
        )
    return vehicle_of(load_model(path), path.stem, path.stem, str(path))


def fly_study(
    settings: PilotSettings, options: FlyOptions, *, say: Callable[[str], None] | None = None
) -> FlownSession:
    """Fly what a study says beside the clock; by UDP the pilot moves inputs of the model from trim.

    Parameters
    ----------
    settings : PilotSettings
    options : FlyOptions
        Length, and the addresses of pilot and cockpit.
    say : callable, optional
        Takes a sentence on where it listens.

    Returns
    -------
    FlownSession
        Its record holds what reached the vehicle, and what the pilot's stick did beside it.

    Raises
    ------
    FlightidError
        The vehicle cannot be flown so.
    OSError
        The port is taken.
    """
    usual = FlyOptions()
    if moved := [name for name in OF_COMMAND if getattr(options, name) != getattr(usual, name)]:
        raise OptionError(
            "a vehicle of [pilot] has a law, a travel and a rate of its own",
            found=", ".join(moved),
            needed="a model that is flown bare",
        )
    vehicle = piloted(settings)
    step_s = 1.0 / vehicle.rate_hz
    failures = cast("dict[str, Failure]", dict(settings.failures))
    switches = FlySwitches(settings.augmentation and bool(vehicle.law), settings.gusts, failures)
    seat = PilotSeat(settings.actuator_delay_s, settings.display_delay_s, settings.stick_rad_s)
    loop = PilotedVehicle(vehicle, step_s, switches=switches, seat=seat, seed=settings.seed)
    rows: list[list[float]] = []
    late: deque[Mapping[str, float]] = deque()
    heard = None if options.listen is None else (options.host, options.listen)
    with UdpLink(loop.inputs, listen=heard, send=options.cockpit, style=options.style) as link:
        if say is not None and heard is not None:
            say(f"Listening at {options.host}:{link.port} for {', '.join(loop.inputs)}")

        def show(time_s: float, outputs: Mapping[str, float]) -> None:
            rows.append(list(loop.driven.values()))
            late.append(outputs)
            if len(late) > round(settings.display_delay_s / step_s):
                link.show(time_s, late.popleft())

        def pilot(time_s: float, outputs: Mapping[str, float]) -> dict[str, float]:
            return {**dict.fromkeys(loop.inputs, 0.0), **link.pilot(time_s, outputs)}

        session = fly_in_real_time(loop, pilot, duration_s=options.duration_s, show=show)
    told = _told(session.record, loop, np.array(rows).T, settings, vehicle)
    return replace(session, record=told, options=options.to_dict())


def _told(
    flown: Record,
    loop: PilotedVehicle,
    driven: np.ndarray,
    settings: PilotSettings,
    vehicle: FlyVehicle,
) -> Record:
    """What reached the vehicle as inputs, the stick beside them: as the page keeps its flights."""
    units = {name: str(unit) for name, unit in vehicle.model.units.items()}
    moved = driven[:, : flown.n_samples]
    sticks = {f"stick_{name}": flown[name] for name in loop.inputs}
    names = (*loop.inputs, *loop.outputs)
    plain = {k: v for k, v in pilot_table(settings).items() if not isinstance(v, dict)}
    return Record.from_arrays(
        flown.time_s,
        inputs=dict(zip(loop.inputs, moved, strict=True)),
        outputs={name: flown[name] for name in loop.outputs},
        others=sticks,
        units={
            **{name: units.get(name, "1") for name in names},
            **{f"stick_{name}": units.get(name, "1") for name in loop.inputs},
        },
        name="flown",
        hold="zero",
        history=[Step("flown by a study", plain, VERSION)],
    )
