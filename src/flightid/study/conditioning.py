"""What a study file may say about conditioning, and the stage that carries it out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
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
from flightid.conditioning.filter import FilterDesign
from flightid.conditioning.sensor_position import RATES
from flightid.conventions import AxisConversion
from flightid.errors import StudyError
from flightid.record import Record
from flightid.simulation import actuator_positions
from flightid.study.reading import TableReader
from flightid.study.record_files import RecordFile

Position = tuple[float, float, float]
Move = Callable[[Record, Position], Record]
SENSORS: dict[str, tuple[Move, tuple[str, str, str]]] = {
    "accelerometers_m": (accelerations_at_cg, ("ax", "ay", "az")),
    "velocities_m": (velocities_at_cg, ("u", "v", "w")),
    "air_data_m": (air_data_at_cg, ("V", "alpha", "beta")),
}
"""Keys of sensor positions: the verb that moves them to the centre of gravity, and its channels."""
BANDS = ("lowpass", "highpass", "bandpass", "bandstop")


@dataclass(frozen=True)
class ConsistencyStep:
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

    channels: tuple[str, ...] = ("phi", "theta")
    estimate: tuple[str, ...] | None = None
    apply: bool = False


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
    outliers : mapping or None
        Options of `flightid.conditioning.remove_outliers`.
    actuators : mapping of str to float
        Bandwidth of the known actuator behind an input, rad/s.
    positions : mapping of str to tuple of float
        Position of sensors from the centre of gravity, m, by key of `SENSORS`.
    consistency : ConsistencyStep or None
        Check of rates against attitudes and velocities, and whether its errors are taken out.
    filter : mapping or None
        Options of `flightid.conditioning.filter_record`.
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
    outliers: Mapping[str, Any] | None = None
    actuators: Mapping[str, float] = field(default_factory=dict)
    positions: Mapping[str, Position] = field(default_factory=dict)
    consistency: ConsistencyStep | None = None
    filter: Mapping[str, Any] | None = None
    resample_to_s: float | None = None
    detrend: str | None = None

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that the steps need beside those they change."""
        moved = [name for key in self.positions for name in SENSORS[key][1]]
        needed = [*moved, *RATES] if moved else []
        if self.axes is not None:
            needed += [*RATES, *SENSORS["accelerometers_m"][1]]
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
        reader.maybe(lambda key: _outliers(reader.table(key)), "outliers"),
        _numbers(reader, "actuators"),
        _positions(reader),
        reader.maybe(lambda key: _consistency(reader.table(key)), "consistency"),
        reader.maybe(lambda key: _filter(reader.table(key)), "filter"),
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
    if not meant or "channels" not in meant[0]:
        return meant[0] if meant else None
    held = set(channels)
    return {**meant[0], "channels": [name for name in meant[0]["channels"] if name in held]}


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
        vectors = [each for each in (RATES, SENSORS["accelerometers_m"][1]) if each[0] in record]
        record = convert_axes(record, step.axes, vectors)
    skews = {name: skew for name, skew in step.skews_s.items() if name in record}
    if skews:
        record = align(record, skews)
    if step.outliers is not None:
        record = remove_outliers(record, **step.outliers)
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
        record = filter_record(record, **step.filter)
    if step.resample_to_s is not None:
        record = resample(record, step.resample_to_s)
    return record if step.detrend is None else detrend(record, step.detrend)


def _texts(reader: TableReader, key: str) -> dict[str, str]:
    inner = reader.table(key)
    return {name: inner.text(name) for name in reader.values(key)}


def _numbers(reader: TableReader, key: str) -> dict[str, float]:
    inner = reader.table(key)
    return {name: inner.number(name) for name in reader.values(key)}


def _positions(reader: TableReader) -> dict[str, Position]:
    found = {}
    for key in SENSORS:
        given = reader.maybe(lambda name: reader.numbers(name, length=3), key)
        if given is not None:
            found[key] = (given[0], given[1], given[2])
    return found


def _consistency(reader: TableReader) -> ConsistencyStep:
    usual = ConsistencyStep()
    made = ConsistencyStep(
        reader.names("channels", usual.channels),
        reader.maybe(reader.names, "estimate"),
        reader.flag("apply", usual.apply),
    )
    reader.finish()
    return made


def _outliers(reader: TableReader) -> dict[str, Any]:
    given = {
        "deviations": reader.maybe(reader.positive, "deviations"),
        "half_width": reader.maybe(lambda key: reader.integer(key, minimum=1), "half_width"),
        "channels": reader.maybe(reader.names, "channels"),
    }
    reader.finish()
    return {key: value for key, value in given.items() if value is not None}


def _filter(reader: TableReader) -> dict[str, Any]:
    edges = reader.numbers("cutoff_hz")
    if len(edges) > 2:
        raise reader.error("cutoff_hz", "does not fit", found=edges, needed="one number or two")
    given: dict[str, Any] = {
        "cutoff_hz": edges[0] if len(edges) == 1 else edges,
        "kind": reader.choice("kind", BANDS, BANDS[0]),
        "design": reader.choice("design", [str(each) for each in FilterDesign], "butterworth"),
        "order": reader.integer("order", 4, minimum=1),
        "zero_phase": reader.flag("zero_phase", True),
        "channels": reader.maybe(reader.names, "channels"),
    }
    reader.finish()
    return given
