"""What an autopilot publishes in ROS, by its topics: the names that its own log has for them."""

from __future__ import annotations

import re

from flightid.frozen import dataclass

PX4_TYPES, MAVROS_TYPES = "px4_msgs/", "mavros_msgs/"
_PX4 = re.compile(r"(?P<vehicle>.*?)/?fmu/(?P<way>in|out)/(?P<name>[a-z0-9_]+?)(?:_v\d+)?")
_MAVROS = re.compile(r"(?P<vehicle>.*?)/?mavros/(?P<name>[a-z0-9_/]+)")
MAVROS_TOPICS = {
    "imu/data", "imu/data_raw", "setpoint_raw/target_attitude", "setpoint_raw/attitude",
    "target_actuator_control", "actuator_control", "vfr_hud", "battery",
    "local_position/velocity_body", "setpoint_attitude/cmd_vel",
}  # fmt: skip
"""Topics of MAVROS that a channel map may name."""


@dataclass(frozen=True)
class PublishedTopic:
    """What a topic is.

    Attributes
    ----------
    kind : str
        ``"px4"`` or ``"mavros"``.
    vehicle : str
        Namespace before the autopilot's own, empty of one vehicle alone.
    message : str
        As a ULog calls it, or the topic behind ``mavros/``.
    is_own : bool
        Whether the autopilot published it, and nobody asked it of the autopilot.
    """

    kind: str
    vehicle: str
    message: str
    is_own: bool


def published(topic: str, type_name: str) -> PublishedTopic | None:
    """What a topic of a bag is; None where no autopilot publishes it.

    Parameters
    ----------
    topic, type_name : str
        Such as "/fmu/out/vehicle_attitude" and "px4_msgs/VehicleAttitude".

    Reference
    ---------
    PX4, src/modules/uxrce_dds_client/dds_topics.yaml; MAVROS, mavros/src/plugins.

    Example
    -------
    >>> published("/px4_1/fmu/out/vehicle_status_v1", "px4_msgs/VehicleStatus").message
    'vehicle_status'
    """
    if type_name.startswith(PX4_TYPES):
        found = _PX4.fullmatch(topic)
        if found is None:
            return PublishedTopic("px4", "", topic.rpartition("/")[2], is_own=True)
        return PublishedTopic("px4", found["vehicle"], found["name"], found["way"] == "out")
    found = _MAVROS.fullmatch(topic)
    if found is None or found["name"] not in MAVROS_TOPICS:
        return None
    return PublishedTopic("mavros", found["vehicle"], found["name"], is_own=True)
