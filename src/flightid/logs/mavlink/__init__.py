"""Telemetry logs of ground stations."""
