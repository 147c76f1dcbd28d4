"""Bags of ROS that hold what an autopilot publishes, as logs."""
