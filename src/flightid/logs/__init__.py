"""Logs: what an autopilot wrote, in its own names, and the channels made from it."""

from flightid.logs.channels.channel_map import ChannelMap, ChannelSource, MappedChannel, channel_map
from flightid.logs.dataflash.layout import MessageLayout
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.logs.log import Log
from flightid.logs.log_table import LogTable
from flightid.logs.reader import is_log, is_table_too, read_log
from flightid.logs.self_check import AxisCheck, InjectionCheck
from flightid.logs.source import ByteRange, Event, Gap, LogSource, MessageInfo, ParameterChange

__all__ = [
    "AxisCheck",
    "ByteRange",
    "ChannelMap",
    "ChannelSource",
    "DataflashWriter",
    "Event",
    "Gap",
    "InjectionCheck",
    "Log",
    "LogSource",
    "LogTable",
    "MappedChannel",
    "MessageInfo",
    "MessageLayout",
    "ParameterChange",
    "SidRun",
    "channel_map",
    "is_log",
    "is_table_too",
    "read_log",
]
