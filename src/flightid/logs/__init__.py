"""Logs: what an autopilot wrote, in its own names, and the channels made from it."""

from flightid.logs.dataflash_layout import MessageLayout
from flightid.logs.dataflash_writer import DataflashWriter
from flightid.logs.log import Log
from flightid.logs.log_table import LogTable
from flightid.logs.reader import read_log
from flightid.logs.source import ByteRange, Event, Gap, LogSource, MessageInfo, ParameterChange

__all__ = [
    "ByteRange",
    "DataflashWriter",
    "Event",
    "Gap",
    "Log",
    "LogSource",
    "LogTable",
    "MessageInfo",
    "MessageLayout",
    "ParameterChange",
    "read_log",
]
