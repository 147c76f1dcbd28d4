"""PX4's logs before ULog (sdlog2, ``.px4log``): DataFlash records, stamped by TIME messages.

Messages are given under the names of today's topics, so that the channel maps of PX4 hold for both.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.logs.dataflash.reader import GAP_S, DataflashSource, open_dataflash
from flightid.logs.log_cut import LOG_CUT
from flightid.logs.source import Event, Gap, LogSource
from flightid.logs.table_source import MessageRows, TableSource
from flightid.logs.ulog.names import AIRFRAMES, ARMED, changes_of

STAMP = ("TIME", "StartTime")
AXES = ("X", "Y", "Z")
TOPICS: Mapping[str, tuple[str, Mapping[str, tuple[str, str]]]] = {
    "ATT": (
        "vehicle_attitude",
        {name: (name.lower(), "rad") for name in ("Roll", "Pitch", "Yaw")}
        | {f"{name}Rate": (f"{name.lower()}speed", "rad/s") for name in ("Roll", "Pitch", "Yaw")},
    ),
    "ATSP": (
        "vehicle_attitude_setpoint",
        {f"{name}SP": (f"{name.lower()}_body", "rad") for name in ("Roll", "Pitch", "Yaw")}
        | {"ThrustSP": ("thrust", "1")},
    ),
    "ARSP": (
        "vehicle_rates_setpoint",
        {f"{name}RateSP": (name.lower(), "rad/s") for name in ("Roll", "Pitch", "Yaw")},
    ),
    "ATTC": (
        "actuator_controls_0",
        {
            name: (f"control[{place}]", "1")
            for place, name in enumerate(("Roll", "Pitch", "Yaw", "Thrust"))
        },
    ),
    "IMU": (
        "sensor_combined",
        {f"Gyro{axis}": (f"gyro_rad[{place}]", "rad/s") for place, axis in enumerate(AXES)}
        | {
            f"Acc{axis}": (f"accelerometer_m_s2[{place}]", "m/s^2")
            for place, axis in enumerate(AXES)
        },
    ),
    "OUT0": ("actuator_outputs", {f"Out{k}": (f"output[{k}]", "us") for k in range(16)}),
    "BATT": ("battery_status", {"V": ("voltage_v", "V"), "C": ("current_a", "A")}),
    "STAT": ("vehicle_status", {"ArmState": ("arming_state", "1")}),
    "AIRS": (
        "airspeed",
        {
            "IndSpeed": ("indicated_airspeed_m_s", "m/s"),
            "TrueSpeed": ("true_airspeed_m_s", "m/s"),
        },
    ),
}
"""Today's topic, field and unit by message and label (sdlog2_messages.h); others keep theirs."""
AUTOSTART = {"plane": range(2000, 4000), "copter": range(4000, 13000)}
"""SYS_AUTOSTART by vehicle, where MAV_TYPE is not logged."""


def open_binary(path: Path) -> LogSource:
    """Open a log of DataFlash records: of ArduPilot, or of PX4 before ULog.

    Raises
    ------
    LogFormatError
        The file holds no such record.
    OSError
        The file cannot be read.
    """
    source = open_dataflash(path)
    message, field = STAMP
    is_sdlog2 = message in source.messages and field in source.fields(message)[0]
    return _table_source(source) if is_sdlog2 else source


def _table_source(source: DataflashSource) -> TableSource:
    message, field = STAMP
    clock_s = np.maximum.accumulate(source.numbers(message, field, None)) * 1e-6
    written = source.places(message)
    tables = {}
    for name in source.messages:
        if name in (message, "PARM", "VER"):
            continue
        # A message belongs to the last TIME before it; what stands before the first has none.
        last = np.searchsorted(written, source.places(name)) - 1
        known = last >= 0
        if np.any(known):
            topic, fields = TOPICS.get(name, (name, {}))
            tables[topic] = _rows(source, name, fields, clock_s[last[known]], known)
    versions = source.texts("VER", "FwGit", None) if "VER" in source.messages else []
    firmware = next(iter(versions), "")
    return TableSource(
        "px4",
        _vehicle(source),
        f"PX4 {firmware[:8]} (sdlog2)" if firmware else "PX4 (sdlog2)",
        tables,
        parameters=source.parameters,
        events=_arming(tables),
        skipped=source.skipped,
        gaps=[
            Gap(float(clock_s[i]), float(clock_s[i + 1]), "no message of any kind")
            for i in np.flatnonzero(np.diff(clock_s) > GAP_S)
        ],
        findings=[each for each in source.findings if each.code in ("bytes-skipped", LOG_CUT)],
    )


def _rows(
    source: DataflashSource,
    message: str,
    known_fields: Mapping[str, tuple[str, str]],
    time_s: NDArray[np.float64],
    stamped: NDArray[np.bool_],
) -> MessageRows:
    labels, texts = source.fields(message)
    names = {known_fields.get(label, (label,))[0]: label for label in labels if label not in texts}
    units = {name: known_fields.get(label, ("", "1"))[1] for name, label in names.items()}

    return MessageRows(
        units, lambda name: source.numbers(message, names[name], None)[stamped], time_s
    )


def _vehicle(source: DataflashSource) -> str | None:
    kind, number = map(source.parameters.get, ("MAV_TYPE", "SYS_AUTOSTART"))
    if kind in AIRFRAMES:
        return AIRFRAMES[int(kind)]
    return next((name for name, span in AUTOSTART.items() if number in span), None)


def _arming(tables: Mapping[str, MessageRows]) -> list[Event]:
    """Changes of the arming state."""
    status = tables.get("vehicle_status")
    if status is None or "arming_state" not in status.units:
        return []
    states = status.read("arming_state").astype(np.int64)
    return changes_of(states, status.time_s, "state", "arming", ARMED)
