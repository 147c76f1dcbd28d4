"""Second opinion on an autopilot's autotune."""
