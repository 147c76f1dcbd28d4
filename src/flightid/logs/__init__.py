"""Logs: what an autopilot wrote, in its own names, and the channels made from it."""

from flightid.logs.log import Log
from flightid.logs.log_table import LogTable
from flightid.logs.reader import read_log
from flightid.logs.source import ByteRange, Event, Gap, LogSource, MessageInfo, ParameterChange

__all__ = [
    "ByteRange",
    "Event",
    "Gap",
    "Log",
    "LogSource",
    "LogTable",
    "MessageInfo",
    "ParameterChange",
    "read_log",
]
