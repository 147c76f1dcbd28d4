"""What a study file may say about conditioning, and the stage that carries it out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

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
from flightid.conditioning.options import FilterOptions, OutlierOptions
from flightid.conditioning.sensor_position import RATES
from flightid.conventions import AxisConversion
from flightid.errors import StudyError
from flightid.options import Options, option
from flightid.record import Record
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
Made = TypeVar("Made", bound=Options)


@dataclass(frozen=True)
class ConsistencyStep(Options):
    """A check of data compatibility; see `flightid.conditioning.check_consistency`.

    Attributes
    ----------
    channels : tuple of str
        Attitudes, accelerations and velocities to look at, beside the rates.
    estimate : tuple of str, or None
        Instrument errors; None: the usual ones.
    apply : bool
        Whether records go on without the errors that were found.
    """

    channels: tuple[str, ...] = option(
        ("phi", "theta"), doc="Attitudes, accelerations and velocities beside the rates."
    )
    estimate: tuple[str, ...] | None = option(
        None, doc="Instrument errors to estimate; default: the usual ones."
    )
    apply: bool = option(False, doc="Records go on without the errors that were found.")


@dataclass(frozen=True)
class Conditioning:
    """Steps that make records fit for estimation, carried out in the order of these attributes.

    Attributes
    ----------
    records : tuple of str
        Records or segments it is meant for; empty: all.
    units : mapping of str to str
        Unit that a channel is converted to.
    flip : tuple of str
        Channels whose sign is changed.
    axes : str or None
        Conversion of rates and accelerations.
    skews_s : mapping of str to float
        Lag of a channel that is taken out, s.
    outliers : OutlierOptions or None
    actuators : mapping of str to float
        Bandwidth of the known actuator behind an input, rad/s.
    positions : mapping of str to tuple of float
        Position of sensors from the centre of gravity, m, by key of `SENSORS`.
    consistency : ConsistencyStep or None
        Check of rates against attitudes and velocities, and whether its errors are taken out.
    filter : FilterOptions or None
    resample_to_s : float or None
        New sample time, s.
    detrend : str or None
        ``"mean"``, ``"linear"`` or ``"trim"``.
    """

    records: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    flip: tuple[str, ...] = ()
    axes: str | None = None
    skews_s: Mapping[str, float] = field(default_factory=dict)
    outliers: OutlierOptions | None = None
    actuators: Mapping[str, float] = field(default_factory=dict)
    positions: Mapping[str, Position] = field(default_factory=dict)
    consistency: ConsistencyStep | None = None
    filter: FilterOptions | None = None
    resample_to_s: float | None = None
    detrend: str | None = None

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
    made = Conditioning(
        reader.names("records", ()),
        _texts(reader, "units"),
        reader.names("flip", ()),
        reader.maybe(
            lambda key: reader.choice(key, [str(each) for each in AxisConversion]), "axes"
        ),
        _numbers(reader, "skews_s"),
        _options(reader, "outliers", OutlierOptions),
        _numbers(reader, "actuators"),
        _positions(reader),
        _options(reader, "consistency", ConsistencyStep),
        _options(reader, "filter", FilterOptions),
        reader.maybe(reader.positive, "resample_to_s"),
        reader.maybe(lambda key: reader.choice(key, [str(each) for each in Trend]), "detrend"),
    )
    reader.finish()
    return made


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
) -> Mapping[str, Any] | None:
    """Options of the outliers of a file that is resampled as it is read: they go before.

    Raises
    ------
    StudyError
        Two steps take outliers off one such record.
    """
    if file.resample_to_s is None:
        return None
    meant = [
        step.outliers
        for step in steps
        if step.outliers is not None and (not step.records or file.name in step.records)
    ]
    if len(meant) > 1:
        raise StudyError(
            f"study file, [[conditioning]]: outliers of record {file.name!r} are taken off twice",
            needed="one step with outliers for a record that is resampled as it is read",
        )
    if not meant:
        return None
    held = set(channels)
    chosen = meant[0].channels
    return vars(meant[0]) | {"channels": chosen and [name for name in chosen if name in held]}


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
        found = check_consistency(looked, estimate=step.consistency.estimate)
        checks.append(found)
        if step.consistency.apply:
            corrected = {name: found.corrected[name] for name in looked.channels}
            # Delays that are taken out cost samples at the ends.
            first, last = found.corrected.time_s[[0, -1]]
            record = record.segment(first, last + 0.5 * record.sample_time_s)
            record = record.replace(corrected, step=found.corrected.history[-1])
    if step.filter is not None:
        record = filter_record(record, **step.filter.of_verb())
    if step.resample_to_s is not None:
        record = resample(record, step.resample_to_s)
    return record if step.detrend is None else detrend(record, step.detrend)


def _options(reader: TableReader, key: str, kind: type[Made]) -> Made | None:
    """A table in the table as options; None where it is not there."""
    if key not in reader:
        return None
    made: list[Made] = read_each((kind,), reader.table(key))
    return made[0]


def _texts(reader: TableReader, key: str) -> dict[str, str]:
    inner = reader.table(key)
    return {name: inner.text(name) for name in reader.values(key)}


def _numbers(reader: TableReader, key: str) -> dict[str, float]:
    inner = reader.table(key)
    return {name: inner.number(name) for name in reader.values(key)}


def _positions(reader: TableReader) -> dict[str, Position]:
    """Positions in m, from whichever unit the key names."""
    found: dict[str, Position] = {}
    for sensor in SENSORS:
        for unit in LENGTHS:
            key = f"{sensor}_{unit}"
            given = reader.maybe(lambda name: reader.numbers(name, length=3), key)
            if given is None:
                continue
            if sensor in found:
                raise reader.error(key, "tells a position twice", found=given, needed="one unit")
            x, y, z = convert(given, unit, "m").tolist()
            found[sensor] = (x, y, z)
    return found
