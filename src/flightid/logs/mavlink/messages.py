"""Messages of MAVLink that telemetry is read for, as data (`messages.toml`)."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np

from flightid.frozen import dataclass
from flightid.units import DIMENSIONLESS


@dataclass(frozen=True)
class TelemetryMessage:
    """How a message is sent.

    Attributes
    ----------
    name : str
        Name.
    id, seed : int
        Number, and seed of its checksum.
    layout : numpy.dtype
        Fields in the order in which they are sent, extensions last.
    units : dict of str to str
        Unit by field; ``"1"`` where there is none.
    """

    name: str
    id: int
    seed: int
    layout: np.dtype[np.void]
    units: dict[str, str]


@cache
def telemetry_messages() -> dict[int, TelemetryMessage]:
    """All messages by number."""
    text = files("flightid.logs.mavlink").joinpath("messages.toml").read_text(encoding="utf-8")
    made = [_message(name, item) for name, item in tomllib.loads(text).items()]
    return {message.id: message for message in made}


def _message(name: str, item: dict[str, object]) -> TelemetryMessage:
    rows = [str(row).split() for row in item["fields"]]  # type: ignore[attr-defined]
    layout = np.dtype([(field, _storage(kind)) for kind, field, *_ in rows])
    units = {field: (unit[0] if unit else DIMENSIONLESS) for _, field, *unit in rows}
    return TelemetryMessage(name, int(str(item["id"])), int(str(item["seed"])), layout, units)


def _storage(kind: str) -> str:
    """NumPy's word for a type, ``4f4`` four of them; the lowest byte is sent first."""
    if kind.startswith("S"):
        return kind
    count, size = kind[:-2], kind[-2:]
    return f"({count},)<{size}" if count else f"<{size}"
