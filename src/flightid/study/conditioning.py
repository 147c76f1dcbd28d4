"""What a study file may say about conditioning, and the stage that carries it out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from itertools import product
from typing import Any

from flightid.conditioning import (
    accelerations_at_cg,
    air_data_at_cg,
    align,
    check_consistency,
    convert_axes,
    detrend,
    filter_record,
    flip_sign,
    remove_outliers,
    resample,
    velocities_at_cg,
)
from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.conditioning.detrend import Trend
from flightid.conditioning.kinematics import UNITS as KINEMATIC_UNITS
from flightid.conditioning.options import FilterOptions, OutlierOptions
from flightid.conditioning.sensor_position import RATES
from flightid.conventions import AxisConversion
from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.options import Options, option, options_class
from flightid.record import Record
from flightid.record.unit_changes import unit_changes
from flightid.simulation import actuator_positions
from flightid.study.reading import TableReader, read_each
from flightid.study.record_files import RecordFile
from flightid.units import convert

Position = tuple[float, float, float]
Move = Callable[[Record, Position], Record]
SENSORS: dict[str, tuple[Move, tuple[str, str, str]]] = {
    "accelerometers": (accelerations_at_cg, ("ax", "ay", "az")),
    "velocities": (velocities_at_cg, ("u", "v", "w")),
    "air_data": (air_data_at_cg, ("V", "alpha", "beta")),
}
"""Sensors by key: the verb that moves them to the centre of gravity, and its channels."""
LENGTHS = ("m", "cm", "mm", "ft", "in")
"""Units that a position may be told in, behind the sensor's key: ``accelerometers_ft``."""


SensorPositions = options_class(
    "SensorPositions",
    [
        (
            f"{sensor}_{unit}",
            tuple[float, float, float] | None,
            option(None, unit=unit, doc=f"Position of {sensor} from the centre of gravity."),
        )
        for sensor in SENSORS
        for unit in LENGTHS
    ],
)
"""Where sensors sit, each told in one unit: keys of ``[[conditioning]]``."""


@dataclass(frozen=True)
class ConsistencyStep(Options):
    """A check of data compatibility; see `flightid.conditioning.check_consistency`."""

    channels: tuple[str, ...] = option(
        ("phi", "theta"), doc="Attitudes, accelerations and velocities beside the rates."
    )
    estimate: tuple[str, ...] | None = option(
        None, doc="Instrument errors to estimate; default: the usual ones."
    )
    apply: bool = option(False, doc="Records go on without the errors that were found.")


@dataclass(frozen=True)
class Conditioning(Options):
    """Steps that make records fit for estimation, carried out in the order of these attributes.

    Sensors are moved (`positions`, in m, by key of `SENSORS`) after actuators are taken out.
    """

    records: tuple[str, ...] = option((), doc="Records or segments it is meant for; default: all.")
    units: Mapping[str, str] = option(
        default_factory=dict, doc="Unit that a channel is converted to."
    )
    flip: tuple[str, ...] = option((), doc="Channels whose sign is changed.")
    axes: str | None = option(
        None, choices=map(str, AxisConversion), doc="Conversion of rates and accelerations."
    )
    skews_s: Mapping[str, float] = option(
        default_factory=dict, unit="s", doc="Lag of a channel that is taken out."
    )
    outliers: OutlierOptions | None = option(None, doc="Outliers that are bridged.")
    actuators: Mapping[str, float] = option(
        default_factory=dict, unit="rad/s", doc="Bandwidth of the known actuator behind an input."
    )
    consistency: ConsistencyStep | None = option(
        None, doc="Check of rates against attitudes and velocities."
    )
    filter: FilterOptions | None = option(None, doc="Filter of channels.")
    resample_to_s: float | None = option(None, unit="s", above=0.0, doc="New sample time.")
    detrend: str | None = option(None, choices=map(str, Trend), doc="What is taken off.")
    positions: Mapping[str, Position] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that the steps need beside those they change."""
        moved = [name for key in self.positions for name in SENSORS[key][1]]
        needed = [*moved, *RATES] if moved else []
        if self.axes is not None:
            needed += [*RATES, *SENSORS["accelerometers"][1]]
        if self.consistency is not None:
            needed += [*RATES, *self.consistency.channels]
        return tuple(dict.fromkeys(needed))


def read_conditioning(reader: TableReader) -> Conditioning:
    """Check one table ``[[conditioning]]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    made: Conditioning
    made, positions = read_each((Conditioning, SensorPositions), reader)
    return replace(made, positions=_in_metres(positions, reader))


def require_records(steps: Sequence[Conditioning], names: Sequence[str]) -> None:
    """See that conditioning is meant for records that are there.

    Raises
    ------
    StudyError
        There is no such record.
    """
    for step in steps:
        for name in step.records:
            if name not in names:
                raise StudyError(
                    "study file, [[conditioning]]: there is no such record",
                    found=name,
                    needed=", ".join(names),
                )


def outliers_first(
    steps: Sequence[Conditioning], file: RecordFile, channels: Iterable[str]
) -> list[Mapping[str, Any]] | None:
    """Options of the outliers of a file that is resampled as it is read: they go before.

    Raises
    ------
    StudyError
        Two steps take outliers off one channel of such a record.
    """
    if file.resample_to_s is None:
        return None
    meant = [
        step.outliers
        for step in steps
        if step.outliers is not None and (not step.records or file.name in step.records)
    ]
    named = [name for each in meant for name in each.channels or ()]
    if len(named) > len(set(named)) or (len(meant) > 1 and any(not e.channels for e in meant)):
        raise StudyError(
            f"study file, [[conditioning]]: outliers of record {file.name!r} are taken off twice",
            needed="one step with outliers for each channel of a record that is resampled as it is "
            "read",
        )
    held = set(channels)
    return [
        vars(each)
        | {"channels": each.channels and [name for name in each.channels if name in held]}
        for each in meant
    ] or None


def condition(
    record: Record, steps: Sequence[Conditioning], name: str
) -> tuple[Record, tuple[KinematicConsistency, ...]]:
    """Carry out the steps that are meant for the record or group of this name, in order."""
    checks: list[KinematicConsistency] = []
    for step in steps:
        if not step.records or name in step.records:
            record = _apply(record, step, checks)
    return record, tuple(checks)


def _apply(record: Record, step: Conditioning, checks: list[KinematicConsistency]) -> Record:
    units = {name: unit for name, unit in step.units.items() if name in record}
    if units:
        record = record.to_units(**units)
    flipped = [name for name in step.flip if name in record]
    if flipped:
        record = flip_sign(record, flipped)
    if step.axes is not None:
        vectors = [each for each in (RATES, SENSORS["accelerometers"][1]) if each[0] in record]
        record = convert_axes(record, step.axes, vectors)
    skews = {name: skew for name, skew in step.skews_s.items() if name in record}
    if skews:
        record = align(record, skews)
    if step.outliers is not None:
        record = remove_outliers(record, **vars(step.outliers))
    driven = {name: rate for name, rate in step.actuators.items() if name in record}
    if driven:
        record = actuator_positions(record, driven)
    for key, position in step.positions.items():
        verb, channels = SENSORS[key]
        if all(name in record for name in channels):
            record = verb(record, position)
    if step.consistency is not None:
        # Other channels of the record, in units of their own, are not looked at.
        looked = record.select([*RATES, *step.consistency.channels])
        looked = looked.to_units(**unit_changes(looked, KINEMATIC_UNITS))
        found = check_consistency(looked, estimate=step.consistency.estimate)
        checks.append(found)
        if step.consistency.apply:
            own = found.corrected.to_units(**{n: record.unit(n) for n in looked.channels})
            corrected = {name: own[name] for name in looked.channels}
            # Delays that are taken out cost samples at the ends.
            first, last = found.corrected.time_s[[0, -1]]
            record = record.segment(first, last + 0.5 * record.sample_time_s)
            record = record.replace(corrected, step=found.corrected.history[-1])
    if step.filter is not None:
        record = filter_record(record, **step.filter.of_verb())
    if step.resample_to_s is not None:
        record = resample(record, step.resample_to_s)
    return record if step.detrend is None else detrend(record, step.detrend)


def _in_metres(positions: Options, reader: TableReader) -> dict[str, Position]:
    """Positions by sensor, from whichever unit the key names."""
    found: dict[str, Position] = {}
    for sensor, unit in product(SENSORS, LENGTHS):
        given = getattr(positions, f"{sensor}_{unit}")
        if given is None:
            continue
        if sensor in found:
            key = f"{sensor}_{unit}"
            raise reader.error(key, "tells a position twice", found=given, needed="one unit")
        x, y, z = convert(given, unit, "m").tolist()
        found[sensor] = (x, y, z)
    return found
