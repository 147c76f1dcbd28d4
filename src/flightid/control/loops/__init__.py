"""Blocks of loops by the names of their signals; `flightid.connect` joins them."""

from flightid.control.loops.block import Block
from flightid.control.loops.digital import sampled
from flightid.control.loops.elements import (
    delay,
    gain,
    limiter,
    rate_limiter,
    sample_and_hold,
    sum_of,
    system,
)
from flightid.control.loops.filters import (
    complementary,
    high_pass,
    lead_lag,
    low_pass,
    notch,
    washout,
)
from flightid.control.loops.interconnection import Interconnection
from flightid.control.loops.rational import transfer
from flightid.control.loops.stability import Stability

__all__ = [
    "Block",
    "Interconnection",
    "Stability",
    "complementary",
    "delay",
    "gain",
    "high_pass",
    "lead_lag",
    "limiter",
    "low_pass",
    "notch",
    "rate_limiter",
    "sample_and_hold",
    "sampled",
    "sum_of",
    "system",
    "transfer",
    "washout",
]


def __dir__() -> list[str]:
    return sorted(__all__)
