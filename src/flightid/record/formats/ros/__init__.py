"""Bags of ROS 1 and ROS 2: containers to messages, messages to columns; nothing they say is run."""

from flightid.record.formats.ros.columns import read_columns

__all__ = ["read_columns"]
