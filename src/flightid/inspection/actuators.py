"""Commands to motors and servos with the limits between which they move."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.logs import Log, LogTable
from flightid.logs.blackbox.firmware import BLACKBOX

Array = NDArray[np.float64]
MOTOR_FUNCTIONS = range(33, 41)
"""SERVOn_FUNCTION of ArduPilot's motors 1 to 8."""
FEWEST_SAMPLES = 5
"""Samples above the idle level that tell a motor."""
DEFAULT_PWM = (1000.0, 2000.0)
"""Pulses, µs, of a log without parameters for them."""
SERVOS, PX4_OUTPUTS, PX4_MOTORS, MOTORS = range(1, 15), range(8), range(12), range(8)
"""Outputs of ArduPilot's RCOU; of PX4's actuator_outputs and actuator_motors; of a blackbox."""
SPIN_MIN, SPIN_MAX = 0.15, 0.95
"""Shares of the pulses between which ArduCopter's motors turn (MOT_SPIN_MIN, MOT_SPIN_MAX)."""
ABOVE = 0.01
"""Share of the range above its low end from which a motor runs."""


@dataclass(frozen=True, eq=False)
class Actuators:
    """Motor commands as logged.

    Attributes
    ----------
    message : str
        Where they were logged.
    names : tuple of str
        Field of each motor.
    time_s : ndarray, shape (n,)
        Stamps, s.
    values : ndarray, shape (n_motors, n)
        Commands, in the unit of the limits; in single precision where that is exact.
    low, high : float
        Limits between which the mixer may move them in flight.
    """

    message: str
    names: tuple[str, ...]
    time_s: NDArray[np.float64]
    values: NDArray[Any]
    low: float
    high: float

    @property
    def ran(self) -> bool:
        """Whether any motor was commanded above the lower limit of flight, a few samples at least.

        A single sample may be damage.
        """
        above = self.values > self.low + ABOVE * (self.high - self.low)
        return bool(np.any(np.count_nonzero(above, axis=1) >= FEWEST_SAMPLES))


def find_actuators(log: Log) -> Actuators | None:
    """Motor commands of a log, or None where it holds none that can be told apart."""
    known = {"ardupilot": _ardupilot, "px4": _px4, **dict.fromkeys(BLACKBOX, _blackbox)}
    return known[log.kind](log) if log.kind in known else None


def _ardupilot(log: Log) -> Actuators | None:
    if "RCOU" not in log:
        return None
    parameters = log.parameters
    table = log.table("RCOU")
    motors = [
        f"C{number}"
        for number in SERVOS
        if parameters.get(f"SERVO{number}_FUNCTION") in MOTOR_FUNCTIONS and f"C{number}" in table
    ]
    if not motors:
        return None
    channel = int(parameters.get("RCMAP_THROTTLE", 3))
    least, most = _limits(parameters, ("MOT_PWM", f"RC{channel}"), DEFAULT_PWM)
    span = most - least
    return _made(
        table,
        table.arrays(motors),
        least + span * parameters.get("MOT_SPIN_MIN", SPIN_MIN),
        least + span * parameters.get("MOT_SPIN_MAX", SPIN_MAX),
    )


def _px4(log: Log) -> Actuators | None:
    if "actuator_motors" in log:
        table = log.table("actuator_motors", log.messages["actuator_motors"].instances[0])
        names = [f"control[{i}]" for i in PX4_MOTORS if f"control[{i}]" in table]
        found = _moving(log, table, names, np.isfinite)
        return _made(table, found, 0.0, 1.0) if found else None
    if "actuator_outputs" not in log:
        return None
    table = log.table("actuator_outputs", log.messages["actuator_outputs"].instances[0])
    names = [f"output[{i}]" for i in PX4_OUTPUTS if f"output[{i}]" in table]
    found = _moving(log, table, names, lambda values: values > 0)
    low, high = _limits(log.parameters, ("PWM", "PWM_MAIN"), DEFAULT_PWM)
    return _made(table, found, low, high) if found else None


def _moving(
    log: Log, table: LogTable, names: list[str], test: Callable[[Array], NDArray[np.bool_]]
) -> dict[str, Array]:
    """Columns of which any row passes a test, read one after the other: the others are not kept."""
    found = {}
    for name in names:
        column = log.table(table.name, table.instance)[name]
        if np.any(test(column)):
            found[name] = _short(column)
    return found


def _blackbox(log: Log) -> Actuators | None:
    """Commands of a blackbox, whose header says between which of them the mixer moves."""
    if "main" not in log:
        return None
    table = log.table("main")
    used = [f"motor[{i}]" for i in MOTORS if f"motor[{i}]" in table]
    low, high = (log.parameters.get(f"motorOutput[{i}]", 0.0) for i in range(2))
    if not used or not 0.0 < low < high:
        return None
    return _made(table, table.arrays(used), low, high)


def _limits(
    parameters: Mapping[str, float], names: Iterable[str], default: tuple[float, float]
) -> tuple[float, float]:
    """The first pair of limits that is one: autopilots write 0 where another pair counts.

    ArduPilot takes the throttle channel's where MOT_PWM_MIN and MOT_PWM_MAX are 0
    (AP_MotorsMulticopter::get_pwm_output_min).
    """
    pairs = ((parameters.get(f"{n}_MIN", 0.0), parameters.get(f"{n}_MAX", 0.0)) for n in names)
    return next((pair for pair in pairs if 0.0 < pair[0] < pair[1]), default)


def _made(table: LogTable, motors: dict[str, Array], low: float, high: float) -> Actuators:
    columns = [_short(np.nan_to_num(column, nan=low)) for column in motors.values()]
    values = np.empty((len(columns), columns[0].size), np.result_type(*columns))
    for row, column in zip(values, columns, strict=True):
        row[:] = column
    # Limits of double precision: comparisons with short values are then made in it.
    limits = np.float64(low), np.float64(high)
    return Actuators(table.name, tuple(motors), table.time_s, values, *limits)


def _short(column: NDArray[Any]) -> NDArray[Any]:
    """A column in single precision, where that is exact."""
    with np.errstate(over="ignore"):
        short = column.astype(np.float32)
    return short if np.array_equal(short, column, equal_nan=True) else column
