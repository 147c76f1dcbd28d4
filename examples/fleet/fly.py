"""Fly a simulated fleet: vehicles with spread, two that drift, one that gets new propellers.

Some logs are cut, some are empty, some are of another kind. The same numbers give the same bytes.

Run: python examples/fleet/fly.py FOLDER [VEHICLES FLIGHTS]      (20 vehicles, 10 flights each)
"""

import datetime
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from flightid.vehicles import (
    PilotDoublet,
    QuadrotorParameters,
    SidActivation,
    fly,
    write_ardupilot_log,
)

FIRST_DAY = datetime.date(2026, 1, 5)
DAYS_BETWEEN = 12
NEW_PROPELLERS = datetime.date(2026, 3, 1)
DRIFTING = (2, 4)
"""Motors of the one slow down; the thrust of the other wanes."""
NEW_PROPELLERS_ON = 1
EMPTY, CUT, FOREIGN, UNSWEPT = 37, 23, 41, 29
"""Every so many logs one is spoilt in this way."""
SWEEP = SidActivation(
    axis=10,
    start_s=5.0,
    magnitude=0.15,
    start_hz=0.2,
    stop_hz=12.0,
    fade_in_s=2.0,
    record_s=25.0,
    fade_out_s=1.0,
    leave_after_s=30.0,
)
DOUBLET = PilotDoublet("roll", start_s=44.0, amplitude=0.2, width_s=0.8)


def vehicle(number: int, flight: int, day: datetime.date) -> QuadrotorParameters:
    """One vehicle of the type, on one day: 4 % of thrust, 8 % of motor lag between vehicles."""
    usual, draw = QuadrotorParameters(), np.random.default_rng(number).normal(size=2)
    thrust = usual.maximum_thrust_n * (1 + 0.04 * draw[0])
    lag_s = usual.motor_lag_s * (1 + 0.08 * draw[1])
    if number == DRIFTING[0]:
        lag_s *= 1 + 0.06 * flight
    if number == DRIFTING[1]:
        thrust *= 1 - 0.02 * flight
    if number == NEW_PROPELLERS_ON and day >= NEW_PROPELLERS:
        thrust *= 1.12
    return replace(usual, maximum_thrust_n=thrust, motor_lag_s=lag_s)


def write_log(path: Path, number: int, flight: int, day: datetime.date, count: int) -> None:
    """One flight of one vehicle, or one of the ways in which logs are spoilt."""
    if count % EMPTY == EMPTY - 1:
        path.write_bytes(b"")
    elif count % FOREIGN == FOREIGN - 1:
        path.write_text("time,roll rate\n0.0,0.1\n")
    else:
        runs = [] if count % UNSWEPT == UNSWEPT - 1 else [SWEEP]
        flown = fly(
            runs=runs,
            doublets=[DOUBLET],
            vehicle=vehicle(number, flight, day),
            log_every=4,
            seed=1000 * number + flight,
        )
        write_ardupilot_log(flown, path)
        if count % CUT == CUT - 1:
            content = path.read_bytes()
            path.write_bytes(content[: len(content) // 3])


def main(folder: Path, vehicles: int = 20, flights: int = 10) -> None:
    """Write the logs of the whole fleet."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(vehicles):
        for flight in range(flights):
            day = FIRST_DAY + datetime.timedelta(days=DAYS_BETWEEN * flight + number % 3)
            path = folder / f"V{number:02d}-{day.isoformat()}.bin"
            write_log(path, number, flight, day, flights * number + flight)
    print(f"{vehicles * flights} logs of {vehicles} vehicles -> {folder}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 4):
        sys.exit(__doc__)
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
