"""Axis conventions: explicit, enumerated conversions; no orientation is guessed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flightid.conventions import COMPONENTS, AxisConversion
from flightid.errors import OptionError
from flightid.record import Record, Step
from flightid.units import convert

Triad = tuple[str, str, str]


def convert_axes(
    record: Record, conversion: AxisConversion | str, vectors: Iterable[Triad]
) -> Record:
    """Express vectors (rates, accelerations, velocities) in other axes; names and units stay.

    Parameters
    ----------
    record : Record
        Data.
    conversion : AxisConversion
        From which axes to which.
    vectors : iterable of (str, str, str)
        Channels of the x, y and z components of each vector.

    Raises
    ------
    OptionError
        `conversion` is not known, or components of a vector differ in unit.
    UnknownNameError
        There is no such channel.

    Reference
    ---------
    ROS REP 103, Standard Units of Measure and Coordinate Conventions; ISO 1151-1.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 1.0], outputs={"p": [1, 1], "q": [2, 2], "r": [3, 3]})
    >>> flipped = convert_axes(record, "flu-to-frd", [("p", "q", "r")])
    >>> [float(flipped[name][0]) for name in "pqr"]
    [1.0, -2.0, -3.0]
    """
    try:
        kind = AxisConversion(conversion)
    except ValueError:
        raise OptionError(
            "axis conversion is not known",
            found=repr(conversion),
            needed="one of " + ", ".join(AxisConversion),
        ) from None
    samples = {}
    trim = record.trim
    triads = [tuple(vector) for vector in vectors]
    for triad in triads:
        units = {record.unit(name) for name in triad}
        if len(triad) != 3 or len(units) != 1:
            raise OptionError(
                "a vector needs three components of one unit",
                found=f"{triad} in {', '.join(sorted(units))}",
                needed="(x, y, z)",
            )
        old_trim = record.trim
        for name, (index, sign) in zip(triad, COMPONENTS[kind], strict=True):
            samples[name] = sign * record[triad[index]]
            trim.pop(name, None)
            if triad[index] in old_trim:
                trim[name] = sign * old_trim[triad[index]]
    listed = "; ".join(" ".join(triad) for triad in triads)
    step = Step("conditioning.convert_axes", {"conversion": str(kind), "vectors": listed})
    return record.replace(samples, trim=trim, step=step)


def convert_attitude(record: Record, angles: Triad = ("phi", "theta", "psi")) -> Record:
    """Convert Euler angles between ENU/FLU and NED/FRD; the conversion is its own inverse.

    Roll stays, pitch changes its sign, heading becomes a quarter turn less heading (clockwise from
    north against anticlockwise from east). No angle is wrapped.

    Parameters
    ----------
    record : Record
        Data.
    angles : (str, str, str)
        Channels of roll, pitch and yaw, rotation order 3-2-1.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    UnitError
        The heading is no angle.

    Reference
    ---------
    ROS REP 103; Stevens & Lewis, Aircraft Control and Simulation (3rd ed.), section 1.3.

    Example
    -------
    >>> east = Record.from_arrays([0.0, 1.0], units={"psi": "deg"}, outputs={
    ...     "phi": [0, 0], "theta": [1, 1], "psi": [0, 0]})
    >>> converted = convert_attitude(east)
    >>> float(converted["theta"][0]), float(converted["psi"][0])
    (-1.0, 90.0)
    """
    phi, theta, psi = angles
    record.unit(phi)
    quarter = float(convert(np.pi / 2, "rad", record.unit(psi)))
    samples = {theta: -record[theta], psi: quarter - record[psi]}
    trim = record.trim
    if theta in trim:
        trim[theta] = -trim[theta]
    if psi in trim:
        trim[psi] = quarter - trim[psi]
    step = Step("conditioning.convert_attitude", {"angles": " ".join(angles)})
    return record.replace(samples, trim=trim, step=step)


def flip_sign(record: Record, channels: Iterable[str]) -> Record:
    """Change the sign of channels (a reversed servo, a left-handed sensor), trim values included.

    Parameters
    ----------
    record : Record
        Data.
    channels : iterable of str
        Channels.

    Raises
    ------
    UnknownNameError
        There is no such channel.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification (2nd ed.), chapter 6
    (sign conventions as the typical set-up error).

    Example
    -------
    >>> record = Record.from_arrays([0.0, 1.0], inputs={"elevator": [1.0, 2.0]})
    >>> flip_sign(record, ["elevator"])["elevator"].tolist()
    [-1.0, -2.0]
    """
    names = list(channels)
    samples = {name: -record[name] for name in names}
    trim = {key: -value if key in names else value for key, value in record.trim.items()}
    step = Step("conditioning.flip_sign", {"channels": ", ".join(names)})
    return record.replace(samples, trim=trim, step=step)
