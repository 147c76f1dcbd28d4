"""Known first-order actuators: put before a vehicle, or taken out of a flight's records."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from flightid import _native
from flightid.errors import OptionError, UnknownNameError
from flightid.models.linear.realisation import Matrices
from flightid.record import Record, Step


def actuator_positions(record: Record, actuators: Mapping[str, float]) -> Record:
    """Replace stick channels by the positions of their known first-order actuators.

    A model whose inputs lie behind known actuators is then fitted without them.

    Assumes: actuators without limits, known from the ground, that were at rest in trim.

    Parameters
    ----------
    record : Record
        With the stick positions.
    actuators : mapping of str to float
        Bandwidth by input, rad/s; inputs left out stay as they are.

    Raises
    ------
    UnknownNameError
        The record lacks an input.
    OptionError
        A bandwidth without meaning.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1, 0.2], inputs={"lat": [0.0, 1.0, 1.0]})
    >>> actuator_positions(record, {"lat": 15.0})["lat"].round(3)
    array([0.   , 0.482, 0.884])
    """
    check_actuators(actuators, record.channels)
    moved = {}
    for name, bandwidth in actuators.items():
        pole, unit = np.array([[-bandwidth]]), np.eye(1)
        _, found = _native.simulate_linear(
            pole,
            -pole,
            unit,
            np.zeros((1, 1)),
            np.zeros(1),
            np.ascontiguousarray(record[name][None]),
            np.array([record[name][0]]),
            record.sample_time_s,
            record.hold != "zero",
        )
        moved[name] = found[0]
    listed = ", ".join(f"{name} {bandwidth:g}" for name, bandwidth in actuators.items())
    return record.replace(
        moved,
        step=Step("actuator_positions", {"rad_s": listed}),
        # A lag leaves neither steps nor lines.
        input_shape=record.input_shape.without_hold(),
    )


def with_actuators(
    matrices: Matrices,
    inputs: tuple[str, ...],
    actuators: Mapping[str, float],
) -> Matrices:
    """State space with one more state for each actuator; an input's delay then acts before it.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D and the delay of each input, s; further inputs may follow the named ones.
    inputs : tuple of str
    actuators : mapping of str to float
        Bandwidth by input, rad/s.

    Returns
    -------
    tuple of ndarray
        Of the same kind.
    """
    a, b, c, d, delays_s = (np.array(each, dtype=np.float64) for each in matrices)
    for name, bandwidth in actuators.items():
        column, n = inputs.index(name), len(a)
        a = np.block([[a, b[:, [column]]], [np.zeros((1, n)), -bandwidth * np.eye(1)]])
        b = np.vstack([b, np.zeros((1, b.shape[1]))])
        b[:, column] = 0.0
        b[n, column] = bandwidth
        c = np.hstack([c, d[:, [column]]])
        d[:, column] = 0.0
    return contiguous((a, b, c, d, delays_s))


def contiguous(matrices: Matrices) -> Matrices:
    """The same numbers as the native half takes them: row-major double precision."""
    a, b, c, d, delays_s = (np.ascontiguousarray(each, dtype=np.float64) for each in matrices)
    return a, b, c, d, delays_s


def check_actuators(actuators: Mapping[str, float], inputs: Iterable[str]) -> None:
    """Refuse actuators without an input or a meaning.

    Raises
    ------
    UnknownNameError
        An actuator belongs to no input.
    OptionError
        A bandwidth is not a number above zero.
    """
    known = tuple(inputs)
    for name, bandwidth in actuators.items():
        if name not in known:
            raise UnknownNameError("an actuator has no input", found=name, needed=", ".join(known))
        if not (np.isfinite(bandwidth) and bandwidth > 0.0):
            raise OptionError(
                f"bandwidth of actuator {name!r} has no meaning",
                found=bandwidth,
                needed="rad/s above 0",
            )
